#include "kernel_bodies.hpp"

namespace fringe_fusion::decode {
namespace {

void BytesToFloat(const std::uint8_t* in, float* out, int count) {
  BytesToFloatBody(in, out, count);
}
void WordsToFloat(const std::uint16_t* in, float* out, int count) {
  WordsToFloatBody(in, out, count);
}
void ExtendRange(const float* in, float* low, float* high, int count) {
  ExtendRangeBody(in, low, high, count);
}
void FitThree(const FitArgs& args, const FitOut& out, int count) { FitThreeBody(args, out, count); }
void FitFour(const FitArgs& args, const FitOut& out, int count) { FitFourBody(args, out, count); }
void FitWeighted(const FitArgs& args, const FitOut& out, int count) {
  FitWeightedBody(args, out, count);
}
void Nest(const NestArgs& args, int count) { NestBody(args, count); }
void JointCost(const JointArgs& args) { JointCostBody(args); }

constexpr Kernels kKernels{"portable", BytesToFloat, WordsToFloat, ExtendRange, FitThree,
                           FitFour,    FitWeighted,  Nest,         JointCost};

}  // namespace

const Kernels& PortableKernels() { return kKernels; }

}  // namespace fringe_fusion::decode
