#include "fringe_fusion/diagnosis/diagnose_stack.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

#include "bench/diagnosis_scenes.hpp"

namespace fringe_fusion {
namespace {

using bench::Fault;

ImageStack TuningStack(Fault fault, int strength, int scene) {
  return bench::CaptureWithFault(bench::MakeDiagnosisScene(bench::TuningSeed(scene), fault), fault,
                                 strength);
}

std::string FirstName(const ImageStack& stack) {
  const auto diagnosis = DiagnoseStack(stack, {}, {}, bench::DiagnosisCalibration());
  if (!diagnosis) return diagnosis.error().message;
  return diagnosis->findings.empty() ? "none" : FindingName(diagnosis->findings.front().kind);
}

TEST(DiagnoseStack, NamesAreStableAndDistinct) {
  std::set<std::string> names;
  for (int k = 0; k < kNumFindingKinds; ++k) names.insert(FindingName(static_cast<FindingKind>(k)));
  EXPECT_EQ(names.size(), static_cast<std::size_t>(kNumFindingKinds));
  EXPECT_EQ(names.count("unknown"), 0U);
  EXPECT_STREQ(FindingName(static_cast<FindingKind>(99)), "unknown");
}

TEST(DiagnoseStack, FindsNothingInACleanStack) {
  EXPECT_EQ(FirstName(TuningStack(Fault::kNone, 0, 1000)), "none");
}

TEST(DiagnoseStack, NamesTooLittleLight) {
  EXPECT_EQ(FirstName(TuningStack(Fault::kTooDark, 1, 0)), "too_little_light");
}

TEST(DiagnoseStack, NamesAFrameThatTheCameraHandedOutTwice) {
  EXPECT_EQ(FirstName(TuningStack(Fault::kDuplicated, 2, 0)), "frames_duplicated");
}

TEST(DiagnoseStack, NamesMissingFrames) {
  ImageStack stack = TuningStack(Fault::kNone, 0, 1000);
  stack.frames.pop_back();
  EXPECT_EQ(FirstName(stack), "frames_dropped");
}

TEST(DiagnoseStack, RefusesWhatIsNoStack) {
  const ImageStack good = TuningStack(Fault::kNone, 0, 1000);
  EXPECT_FALSE(DiagnoseStack(ImageStack{}, {}, {}));
  ImageStack stack = good;
  stack.frames.clear();
  EXPECT_FALSE(DiagnoseStack(stack, {}, {}));
  stack = good;
  stack.frames.push_back(stack.frames.back());
  EXPECT_FALSE(DiagnoseStack(stack, {}, {}));
  DiagnosisConfig config;
  config.min_signal_sigma = std::nan("");
  EXPECT_FALSE(DiagnoseStack(good, {}, config));
}

}  // namespace
}  // namespace fringe_fusion
