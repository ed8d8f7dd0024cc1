// The kernels of one instruction set. Included once by each, with Lanes and kName defined.

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
void ClimbBytes(const ClimbArgs& args, int count) { ClimbBody<Lanes, std::uint8_t>(args, count); }
void ClimbWords(const ClimbArgs& args, int count) { ClimbBody<Lanes, std::uint16_t>(args, count); }
std::int32_t RangeBytes(const RangeArgs& args, int count) {
  return RangeBody<Lanes, std::uint8_t>(args, count);
}
std::int32_t RangeWords(const RangeArgs& args, int count) {
  return RangeBody<Lanes, std::uint16_t>(args, count);
}
std::int32_t PeakBytes(const void* const* rows, int num_rows, int count) {
  return PeakBody<Lanes, std::uint8_t>(rows, num_rows, count);
}
std::int32_t PeakWords(const void* const* rows, int num_rows, int count) {
  return PeakBody<Lanes, std::uint16_t>(rows, num_rows, count);
}
void SubtractBytes(const SubtractArgs& args, int count) {
  SubtractBody<Lanes, std::uint8_t>(args, count);
}
void SubtractWords(const SubtractArgs& args, int count) {
  SubtractBody<Lanes, std::uint16_t>(args, count);
}
void Quick(const QuickArgs& args, int count) { QuickBody<Lanes>(args, count); }
void MarkUnlitBytes(const UnlitArgs& args, int count) { MarkUnlitBody<std::uint8_t>(args, count); }
void MarkUnlitWords(const UnlitArgs& args, int count) { MarkUnlitBody<std::uint16_t>(args, count); }
void CheckLight(const LightArgs& args, int count) { CheckLightBody(args, count); }
std::int32_t FitThreeSteps(const FitArgs& args, const FitOut& out, int count) {
  return FitThreeBody(args, out, count);
}
std::int32_t FitFourSteps(const FitArgs& args, const FitOut& out, int count) {
  return FitFourBody(args, out, count);
}
std::int32_t FitWeighted(const FitArgs& args, const FitOut& out, int count) {
  return FitWeightedBody(args, out, count);
}
void Raise(const std::int32_t* in, std::int32_t* status, int count) {
  RaiseBody(in, status, count);
}
void NestOpen(const NestArgs& args, int count) { NestOpenBody(args, count); }
void NestInterval(const NestArgs& args, int count) { NestIntervalBody(args, count); }
void Nest(const NestArgs& args, int count) { NestBody(args, count); }
void JointCost(const JointArgs& args) { JointCostBody(args); }
void Finish(const FinishArgs& args, int count) { FinishBody<Lanes>(args, count); }
void Compose(const ComposeArgs& args, int count) { ComposeBody<Lanes>(args, count); }
void ToRgb(const float* grey, float full_scale, std::uint8_t* rgb, int count) {
  ToRgbBody(grey, full_scale, rgb, count);
}
void Blank(const std::int32_t* light, const MapRow& out, int count) {
  BlankBody<Lanes>(light, out, count);
}
void FindBends(const EdgeArgs& args, int count) { FindBendsBody<Lanes>(args, count); }

constexpr Kernels kKernels{
    kName,       BytesToFloat,   WordsToFloat,   ExtendRange,  ClimbBytes,    ClimbWords,
    RangeBytes,  RangeWords,     PeakBytes,      PeakWords,    SubtractBytes, SubtractWords,
    Quick,       MarkUnlitBytes, MarkUnlitWords, CheckLight,   FitThreeSteps, FitFourSteps,
    FitWeighted, Raise,          NestOpen,       NestInterval, Nest,          JointCost,
    Finish,      Compose,        ToRgb,          Blank,        FindBends};

}  // namespace
}  // namespace fringe_fusion::decode
