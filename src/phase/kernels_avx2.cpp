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
FRINGE_FUSION_AVX2 void CheckLight(const LightArgs& args, int count) {
  CheckLightBody(args, count);
}
FRINGE_FUSION_AVX2 std::int32_t FitThree(const FitArgs& args, const FitOut& out, int count) {
  return FitThreeBody(args, out, count);
}
FRINGE_FUSION_AVX2 std::int32_t FitFour(const FitArgs& args, const FitOut& out, int count) {
  return FitFourBody(args, out, count);
}
FRINGE_FUSION_AVX2 std::int32_t FitWeighted(const FitArgs& args, const FitOut& out, int count) {
  return FitWeightedBody(args, out, count);
}
FRINGE_FUSION_AVX2 void Raise(const std::int32_t* in, std::int32_t* status, int count) {
  RaiseBody(in, status, count);
}
FRINGE_FUSION_AVX2 void NestOpen(const NestArgs& args, int count) { NestOpenBody(args, count); }
FRINGE_FUSION_AVX2 void NestInterval(const NestArgs& args, int count) {
  NestIntervalBody(args, count);
}
FRINGE_FUSION_AVX2 void Nest(const NestArgs& args, int count) { NestBody(args, count); }
FRINGE_FUSION_AVX2 void JointCost(const JointArgs& args) { JointCostBody(args); }
FRINGE_FUSION_AVX2 void Finish(const FinishArgs& args, int count) { FinishBody(args, count); }
FRINGE_FUSION_AVX2 void Compose(const ComposeArgs& args, int count) { ComposeBody(args, count); }
FRINGE_FUSION_AVX2 void ToRgb(const float* grey, float full_scale, std::uint8_t* rgb, int count) {
  ToRgbBody(grey, full_scale, rgb, count);
}
FRINGE_FUSION_AVX2 void Ratio(const float* modulation, const float* offset,
                              const std::uint8_t* mask, float* ratio, int count) {
  RatioBody(modulation, offset, mask, ratio, count);
}
FRINGE_FUSION_AVX2 void FindEdges(const EdgeArgs& args, int count) { FindEdgesBody(args, count); }

constexpr Kernels kKernels{"avx2",       BytesToFloat, WordsToFloat, ExtendRange, CheckLight,
                           FitThree,     FitFour,      FitWeighted,  Raise,       NestOpen,
                           NestInterval, Nest,         JointCost,    Finish,      Compose,
                           ToRgb,        Ratio,        FindEdges};

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
