#include "src/phase/decode_plan.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "synthetic_stack.hpp"

namespace fringe_fusion::decode {
namespace {

std::string MessageOf(const PatternSequence& sequence) {
  const auto plan = MakeDecodePlan(sequence);
  return plan ? "no error" : plan.error().message;
}

TEST(DecodePlan, SortsFramesByPurpose) {
  PatternSequence sequence = test::MakeTestSequence(true, "1,8", 3);
  std::reverse(sequence.frames.begin(), sequence.frames.end());
  const auto plan = MakeDecodePlan(sequence);
  ASSERT_TRUE(plan.has_value()) << plan.error().message;
  const auto at = [&](int i) { return sequence.frames[static_cast<std::size_t>(i)]; };
  ASSERT_EQ(plan->groups.size(), 1U);
  ASSERT_EQ(plan->groups[0].white_frames.size(), 1U);
  EXPECT_EQ(at(plan->groups[0].white_frames[0]).kind, PatternKind::kWhite);
  EXPECT_EQ(at(plan->groups[0].black_frames.at(0)).kind, PatternKind::kBlack);
  ASSERT_EQ(plan->u.sets.size(), 2U);
  EXPECT_EQ(plan->u.sets[0].fringes, 1.0);
  EXPECT_EQ(plan->u.sets[1].fringes, 8.0);
  for (int step = 0; step < 3; ++step) {
    const Pattern pattern = at(plan->v.sets[1].samples[static_cast<std::size_t>(step)].frame);
    EXPECT_EQ(pattern.step, step);
    EXPECT_EQ(pattern.axis, Axis::kV);
    EXPECT_EQ(pattern.fringes, 8.0);
  }
  ASSERT_TRUE(plan->u.gray.has_value());
  ASSERT_EQ(plan->u.gray->bits.size(), 7U);  // 128 columns
  EXPECT_EQ(at(plan->u.gray->bits[3].reads.at(0).frame).bit, 3);
  EXPECT_TRUE(at(plan->u.gray->bits[3].reads[0].inverse_frame).inverse);
}

TEST(DecodePlan, NamesWhatDoesNotFit) {
  PatternSequence sequence = test::MakeTestSequence(true, "", 3);
  sequence.frames.back().cell_px = 2;
  EXPECT_NE(MessageOf(sequence).find("cell_px 2"), std::string::npos);
  sequence = test::MakeTestSequence(true, "", 3);
  sequence.frames.push_back(sequence.frames.back());
  EXPECT_NE(MessageOf(sequence).find("are both gray_v_b0_inv"), std::string::npos);
  sequence = test::MakeTestSequence(false, "1,8", 3);
  sequence.frames.back().phase_sign = -1.0;
  EXPECT_NE(MessageOf(sequence).find("phase_sign -1"), std::string::npos);
  EXPECT_EQ(MessageOf(test::MakeTestSequence(true, "2,8", 3)), "no error");
  EXPECT_NE(MessageOf({}), "no error");
}

TEST(DecodePlan, ChoosesTheUnwrapping) {
  const auto unwrapping = [](const std::string& fringes) {
    return MakeDecodePlan(test::MakeTestSequence(false, fringes, 3))->u.unwrapping;
  };
  EXPECT_EQ(unwrapping("1,8"), Unwrapping::kNested);
  EXPECT_EQ(unwrapping("15,16"), Unwrapping::kJoint);
  EXPECT_EQ(unwrapping("16"), Unwrapping::kRelative);
  EXPECT_EQ(MakeDecodePlan(test::MakeTestSequence(true, "15,16", 3))->u.unwrapping,
            Unwrapping::kNested);
}

TEST(DecodePlan, SortsExposuresAndTakesUnevenSteps) {
  PatternConfig config;
  config.fringes = "1,8";
  config.exposures = "4,1";
  PatternSequence sequence = MakeSequence(config, 128, 96).value();
  const auto plan = MakeDecodePlan(sequence);
  ASSERT_TRUE(plan.has_value()) << plan.error().message;
  ASSERT_EQ(plan->groups.size(), 2U);
  EXPECT_DOUBLE_EQ(plan->groups[1].ratio, 4.0);
  EXPECT_EQ(plan->reference_group, 0);
  ASSERT_EQ(plan->u.sets[1].samples.size(), 8U);
  EXPECT_FALSE(plan->u.sets[1].even);

  sequence = test::MakeTestSequence(false, "1,8", 4);
  for (Pattern& pattern : sequence.frames) pattern.phase_offset_rad = 0.7;
  EXPECT_TRUE(MakeDecodePlan(sequence)->u.sets[0].even);
  EXPECT_NEAR(MakeDecodePlan(sequence)->u.sets[0].offset_rad, 0.7, 1e-12);
  sequence.frames[3].phase_offset_rad = 0.8;
  const auto uneven = MakeDecodePlan(sequence);
  EXPECT_FALSE(uneven->u.sets[0].even);
  EXPECT_NEAR(uneven->u.sets[0].samples[1].delta_rad, 0.5 * M_PI - 0.1, 1e-12);
}

TEST(TakenExposures, AreRelativeToTheScan) {
  PatternConfig config;
  config.fringes = "1";
  config.exposures = "1,4";
  ImageStack stack =
      test::Synthesize(MakeSequence(config, 128, 96).value(), test::SyntheticScene{});
  EXPECT_TRUE(TakenExposures(stack).empty());
  for (std::size_t i = 0; i < stack.frames.size(); ++i) {
    stack.frames[i].exposure_s = i < stack.frames.size() / 2 ? 0.01 : 0.05;
  }
  EXPECT_DOUBLE_EQ(TakenExposures(stack).front(), 1.0);
  EXPECT_DOUBLE_EQ(TakenExposures(stack).back(), 5.0);
}

}  // namespace
}  // namespace fringe_fusion::decode
