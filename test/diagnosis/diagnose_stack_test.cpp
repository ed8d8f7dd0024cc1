#include "fringe_fusion/diagnosis/diagnose_stack.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

#include "bench/diagnosis_scenes.hpp"
#include "test/support/draws.hpp"

// Scenes of the tuning set alone: bench/diagnosis_eval judges on others.
namespace fringe_fusion {
namespace {

using bench::Fault;

constexpr int kCleanScene = 1000;

ImageStack TuningStack(Fault fault, int strength, int scene) {
  return bench::CaptureWithFault(bench::MakeDiagnosisScene(bench::TuningSeed(scene), fault), fault,
                                 strength);
}

ImageStack StackOf(const PatternConfig& pattern, Fault fault = Fault::kNone, int strength = 0) {
  bench::DiagnosisScene scene =
      bench::MakeDiagnosisScene(bench::TuningSeed(kCleanScene), Fault::kNone);
  scene.pattern = pattern;
  return bench::CaptureWithFault(scene, fault, strength);
}

Diagnosis Diagnose(const ImageStack& stack) {
  Result<Diagnosis> diagnosis = DiagnoseStack(stack, {}, {}, bench::DiagnosisCalibration());
  if (!diagnosis) throw std::runtime_error(diagnosis.error().message);
  return std::move(*diagnosis);
}

std::string FirstName(const Diagnosis& diagnosis) {
  return diagnosis.findings.empty() ? "none" : FindingName(diagnosis.findings.front().kind);
}

CheckState StateOf(const Diagnosis& diagnosis, FindingKind kind) {
  return diagnosis.checks.at(static_cast<std::size_t>(kind)).state;
}

struct FaultCase {
  Fault fault;
  const char* name;
};

class DiagnoseFault : public testing::TestWithParam<FaultCase> {};

TEST_P(DiagnoseFault, IsNamedFirst) {
  const FaultCase c = GetParam();
  for (const int strength : test_support::Cases({0, 2})) {
    const Diagnosis diagnosis = Diagnose(TuningStack(c.fault, strength, 3 + strength));
    EXPECT_EQ(FirstName(diagnosis), c.name) << "strength " << strength;
    if (diagnosis.findings.empty()) continue;
    const Finding& first = diagnosis.findings.front();
    EXPECT_FALSE(first.evidence.empty());
    EXPECT_FALSE(first.advice.empty());
    EXPECT_EQ(StateOf(diagnosis, first.kind), CheckState::kFailed);
  }
}

INSTANTIATE_TEST_SUITE_P(Faults, DiagnoseFault,
                         testing::Values(FaultCase{Fault::kResponse, "response"},
                                         FaultCase{Fault::kShifted, "frames_shifted"},
                                         FaultCase{Fault::kDropped, "frames_dropped"},
                                         FaultCase{Fault::kDuplicated, "frames_duplicated"},
                                         FaultCase{Fault::kSwapped, "frames_swapped"},
                                         FaultCase{Fault::kExposure, "exposure"},
                                         FaultCase{Fault::kSaturation, "saturation"},
                                         FaultCase{Fault::kTooDark, "too_little_light"},
                                         FaultCase{Fault::kMotion, "motion"},
                                         FaultCase{Fault::kProjectorDefocus, "projector_defocus"},
                                         FaultCase{Fault::kCameraDefocus, "camera_defocus"},
                                         FaultCase{Fault::kFlicker, "flicker"},
                                         FaultCase{Fault::kInterreflection, "interreflection"},
                                         FaultCase{Fault::kResolution, "resolution"}),
                         [](const auto& param) { return std::string(param.param.name); });

TEST(DiagnoseStack, NamesAreStableAndDistinct) {
  std::set<std::string> names;
  for (int k = 0; k < kNumFindingKinds; ++k) names.insert(FindingName(static_cast<FindingKind>(k)));
  EXPECT_EQ(names.size(), static_cast<std::size_t>(kNumFindingKinds));
  EXPECT_EQ(names.count("unknown"), 0U);
  EXPECT_STREQ(FindingName(static_cast<FindingKind>(99)), "unknown");
}

TEST(DiagnoseStack, FindsNothingInCleanStacksAndSaysWhatItMeasured) {
  for (int scene = kCleanScene; scene < kCleanScene + test_support::Draws(4, 1); ++scene) {
    const Diagnosis diagnosis = Diagnose(TuningStack(Fault::kNone, 0, scene));
    EXPECT_EQ(FirstName(diagnosis), "none") << scene;
    ASSERT_EQ(diagnosis.checks.size(), static_cast<std::size_t>(kNumFindingKinds));
    for (int k = 0; k < kNumFindingKinds; ++k) {
      const Check& check = diagnosis.checks[static_cast<std::size_t>(k)];
      EXPECT_EQ(check.kind, static_cast<FindingKind>(k));
      EXPECT_EQ(check.state, CheckState::kPassed) << FindingName(check.kind) << check.note;
    }
  }
}

TEST(DiagnoseStack, SameStackSameAnswer) {
  const Fault fault = test_support::Sanitized() ? Fault::kShifted : Fault::kMotion;
  const ImageStack stack = TuningStack(fault, 1, 2);
  const Diagnosis first = Diagnose(stack);
  const Diagnosis second = Diagnose(stack);
  for (std::size_t k = 0; k < first.checks.size(); ++k) {
    if (first.checks[k].state == CheckState::kSkipped) continue;
    EXPECT_EQ(first.checks[k].value, second.checks[k].value);
  }
}

TEST(DiagnoseStack, NamesMissingFramesWhereverTheyAre) {
  const ImageStack good = TuningStack(Fault::kNone, 0, kCleanScene);
  for (const std::size_t lost : {std::size_t{0}, std::size_t{7}, good.frames.size() - 1}) {
    ImageStack stack = good;
    stack.frames.erase(stack.frames.begin() + static_cast<std::ptrdiff_t>(lost));
    EXPECT_EQ(FirstName(Diagnose(stack)), "frames_dropped") << lost;
  }
  ImageStack stack = good;
  stack.frames.resize(1);
  EXPECT_EQ(FirstName(Diagnose(stack)), "frames_dropped");
}

TEST(DiagnoseStack, SkipsTheResolutionWithoutCalibration) {
  const auto diagnosis = DiagnoseStack(TuningStack(Fault::kResolution, 1, 0), {}, {});
  ASSERT_TRUE(diagnosis) << diagnosis.error().message;
  EXPECT_EQ(FirstName(*diagnosis), "none");
  EXPECT_EQ(StateOf(*diagnosis, FindingKind::kResolution), CheckState::kSkipped);
}

PatternConfig GrayPattern() {
  PatternConfig gray;
  gray.gray = true;
  gray.fringes = "";
  return gray;
}

TEST(DiagnoseStack, GrayCodeAloneIsComparedFrameByFrame) {
  const PatternConfig gray = GrayPattern();
  const Diagnosis clean = Diagnose(StackOf(gray));
  EXPECT_EQ(FirstName(clean), "none");
  EXPECT_EQ(StateOf(clean, FindingKind::kFramesSwapped), CheckState::kPassed);
  EXPECT_EQ(StateOf(clean, FindingKind::kResponse), CheckState::kSkipped);
  EXPECT_EQ(FirstName(Diagnose(StackOf(gray, Fault::kShifted, 0))), "frames_shifted");
}

TEST(DiagnoseStack, GrayCodeAloneTellsTheResolution) {
  EXPECT_EQ(FirstName(Diagnose(StackOf(GrayPattern(), Fault::kResolution, 1))), "resolution");
}

TEST(DiagnoseStack, BlurredGrayCodeIsNoWrongResolution) {
  EXPECT_EQ(FirstName(Diagnose(StackOf(GrayPattern(), Fault::kCameraDefocus, 1))),
            "camera_defocus");
}

TEST(DiagnoseStack, OneFrequencyIsJudgedWithoutUnwrapping) {
  PatternConfig single;
  single.fringes = "20";
  single.steps = 5;
  const Diagnosis clean = Diagnose(StackOf(single));
  EXPECT_EQ(FirstName(clean), "none");
  EXPECT_EQ(StateOf(clean, FindingKind::kResolution), CheckState::kSkipped);
  EXPECT_EQ(StateOf(clean, FindingKind::kInterreflection), CheckState::kSkipped);
  EXPECT_EQ(FirstName(Diagnose(StackOf(single, Fault::kResponse, 1))), "response");
}

TEST(DiagnoseStack, ThreeStepsTellTheResponseByWhiteAndBlack) {
  PatternConfig three;
  three.fringes = "1,6,32";
  three.steps = 3;
  const Diagnosis clean = Diagnose(StackOf(three));
  EXPECT_EQ(FirstName(clean), "none");
  EXPECT_EQ(StateOf(clean, FindingKind::kResponse), CheckState::kPassed);
  for (const int strength : test_support::Cases({0, 2})) {
    EXPECT_EQ(FirstName(Diagnose(StackOf(three, Fault::kResponse, strength))), "response");
  }
  if (test_support::Sanitized()) return;
  EXPECT_EQ(FirstName(Diagnose(StackOf(three, Fault::kMotion, 2))), "motion");
  EXPECT_EQ(FirstName(Diagnose(StackOf(three, Fault::kExposure, 2))), "exposure");
}

TEST(DiagnoseStack, MicroPhaseShiftIsComparedFrameByFrame) {
  PatternConfig micro;
  micro.fringes = "35,36,37,38,39";
  micro.micro = true;
  const Diagnosis clean = Diagnose(StackOf(micro));
  EXPECT_EQ(FirstName(clean), "none");
  EXPECT_EQ(StateOf(clean, FindingKind::kFramesDropped), CheckState::kPassed);
  EXPECT_EQ(StateOf(clean, FindingKind::kMotion), CheckState::kSkipped);
  EXPECT_EQ(FirstName(Diagnose(StackOf(micro, Fault::kShifted, 0))), "frames_shifted");
}

TEST(DiagnoseStack, FramesWithACarrierAreLeftOut) {
  PatternConfig modulated;
  modulated.fringes = "1,8";
  modulated.steps = 3;
  modulated.carrier_period_px = 16.0;
  const Diagnosis clean = Diagnose(StackOf(modulated));
  EXPECT_EQ(FirstName(clean), "none");
  EXPECT_EQ(StateOf(clean, FindingKind::kFramesShifted), CheckState::kSkipped);
  EXPECT_EQ(StateOf(clean, FindingKind::kResponse), CheckState::kSkipped);
  EXPECT_EQ(FirstName(Diagnose(StackOf(modulated, Fault::kTooDark, 1))), "too_little_light");
  // Without white and black nothing is left to compare, which is no fault.
  ImageStack carriers = StackOf(modulated);
  carriers.frames.erase(carriers.frames.begin(), carriers.frames.begin() + 2);
  carriers.sequence.frames.erase(carriers.sequence.frames.begin(),
                                 carriers.sequence.frames.begin() + 2);
  const Diagnosis bare = Diagnose(carriers);
  EXPECT_EQ(FirstName(bare), "none");
  EXPECT_EQ(StateOf(bare, FindingKind::kMotion), CheckState::kSkipped);
}

TEST(DiagnoseStack, SeveralExposuresMaySaturateInTheLongOnesAlone) {
  PatternConfig exposures;
  exposures.fringes = "1,6,32";
  exposures.exposures = "1,3";
  EXPECT_EQ(FirstName(Diagnose(StackOf(exposures))), "none");
  EXPECT_EQ(FirstName(Diagnose(StackOf(exposures, Fault::kSaturation, 2))), "saturation");
}

TEST(DiagnoseStack, RefusesWhatIsNoStack) {
  const ImageStack good = TuningStack(Fault::kNone, 0, kCleanScene);
  EXPECT_FALSE(DiagnoseStack(ImageStack{}, {}, {}));
  ImageStack stack = good;
  stack.frames.clear();
  EXPECT_FALSE(DiagnoseStack(stack, {}, {}));
  stack = good;
  stack.frames.push_back(stack.frames.back());
  EXPECT_FALSE(DiagnoseStack(stack, {}, {}));
  DiagnosisConfig config;
  config.max_motion_px = std::nan("");
  EXPECT_FALSE(DiagnoseStack(good, {}, config));
}

}  // namespace
}  // namespace fringe_fusion
