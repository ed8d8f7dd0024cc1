#include "kernel_bodies.hpp"

#if defined(__x86_64__)

#define FRINGE_FUSION_AVX2 __attribute__((target("avx2")))

namespace fringe_fusion::decode {
namespace {

FRINGE_FUSION_AVX2 void BytesToFloat(const std::uint8_t* in, float* out, int count) {
  BytesToFloatBody(in, out, count);
}
FRINGE_FUSION_AVX2 void WordsToFloat(const std::uint16_t* in, float* out, int count) {
  WordsToFloatBody(in, out, count);
}
FRINGE_FUSION_AVX2 void ExtendRange(const float* in, float* low, float* high, int count) {
  ExtendRangeBody(in, low, high, count);
}
FRINGE_FUSION_AVX2 void FitThree(const FitArgs& args, const FitOut& out, int count) {
  FitThreeBody(args, out, count);
}
FRINGE_FUSION_AVX2 void FitFour(const FitArgs& args, const FitOut& out, int count) {
  FitFourBody(args, out, count);
}
FRINGE_FUSION_AVX2 void FitWeighted(const FitArgs& args, const FitOut& out, int count) {
  FitWeightedBody(args, out, count);
}
FRINGE_FUSION_AVX2 void Nest(const NestArgs& args, int count) { NestBody(args, count); }
FRINGE_FUSION_AVX2 void JointCost(const JointArgs& args) { JointCostBody(args); }

constexpr Kernels kKernels{"avx2",  BytesToFloat, WordsToFloat, ExtendRange, FitThree,
                           FitFour, FitWeighted,  Nest,         JointCost};

}  // namespace

const Kernels& BestKernels() {
  return __builtin_cpu_supports("avx2") != 0 ? kKernels : PortableKernels();
}

}  // namespace fringe_fusion::decode

#else

namespace fringe_fusion::decode {

const Kernels& BestKernels() { return PortableKernels(); }

}  // namespace fringe_fusion::decode

#endif
