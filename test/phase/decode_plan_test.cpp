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
  ASSERT_EQ(plan->white_frames.size(), 1U);
  EXPECT_EQ(at(plan->white_frames[0]).kind, PatternKind::kWhite);
  EXPECT_EQ(at(plan->black_frames.at(0)).kind, PatternKind::kBlack);
  ASSERT_EQ(plan->u.sets.size(), 2U);
  EXPECT_EQ(plan->u.sets[0].fringes, 1.0);
  EXPECT_EQ(plan->u.sets[1].fringes, 8.0);
  for (int step = 0; step < 3; ++step) {
    const Pattern pattern = at(plan->v.sets[1].frame_of_step[static_cast<std::size_t>(step)]);
    EXPECT_EQ(pattern.step, step);
    EXPECT_EQ(pattern.axis, Axis::kV);
    EXPECT_EQ(pattern.fringes, 8.0);
  }
  ASSERT_TRUE(plan->u.gray.has_value());
  ASSERT_EQ(plan->u.gray->bits.size(), 7U);  // 128 columns
  EXPECT_EQ(at(plan->u.gray->bits[3].frame).bit, 3);
  EXPECT_TRUE(at(plan->u.gray->bits[3].inverse_frame).inverse);
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
  EXPECT_NE(MessageOf(test::MakeTestSequence(false, "2,8", 3)).find("at most 1 fringe"),
            std::string::npos);
  EXPECT_EQ(MessageOf(test::MakeTestSequence(true, "2,8", 3)), "no error");
  EXPECT_NE(MessageOf({}), "no error");
}

}  // namespace
}  // namespace fringe_fusion::decode
