// Bookkeeping of the flow without a master: stacks from frames, views through the stages.
#include <gtest/gtest.h>

#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "nodes/stack_assembler.hpp"
#include "nodes/view_tracker.hpp"

namespace fringe_fusion::nodes {
namespace {

ImageStack SomeStack(const std::string& scan_id, int view_id) {
  ImageStack stack;
  stack.scan_id = scan_id;
  stack.view_id = view_id;
  PatternConfig config;
  config.fringes = "1";
  config.axis_v = false;
  stack.sequence = MakeSequence(config, 64, 32).value();
  for (std::size_t i = 0; i < stack.sequence.frames.size(); ++i) {
    CapturedFrame frame;
    frame.pixels = Image<std::uint8_t>(8, 6, static_cast<std::uint8_t>(10 * view_id + 1));
    frame.stamp_ns = static_cast<std::int64_t>(1000 + i);
    stack.frames.push_back(frame);
  }
  return stack;
}

Frame FrameOf(const ImageStack& stack, std::size_t index) {
  return ros_io::ToMessage(stack, index, "camera");
}

std::optional<ImageStack> AddAll(StackAssembler& assembler, const ImageStack& stack,
                                 std::size_t first) {
  std::optional<ImageStack> done;
  for (std::size_t i = first; i < stack.frames.size(); ++i) {
    auto outcome = assembler.Add(FrameOf(stack, i));
    EXPECT_TRUE(outcome);
    if (outcome && outcome->stack) done = std::move(outcome->stack);
  }
  return done;
}

TEST(StackAssembler, GivesTheStackWithTheLastMissingFrame) {
  StackAssembler assembler;
  const ImageStack stack = SomeStack("a", 3);
  const auto done = AddAll(assembler, stack, 0);
  ASSERT_TRUE(done);
  EXPECT_EQ(done->view_id, 3);
  EXPECT_EQ(done->frames.size(), stack.frames.size());
  EXPECT_EQ(done->frames.back().stamp_ns, stack.frames.back().stamp_ns);
  EXPECT_TRUE(Validate(*done, "done"));
}

TEST(StackAssembler, KeepsTwoViewsApart) {
  StackAssembler assembler;
  const ImageStack one = SomeStack("a", 1);
  const ImageStack two = SomeStack("a", 2);
  ASSERT_TRUE(assembler.Add(FrameOf(one, 0)));
  ASSERT_TRUE(assembler.Add(FrameOf(two, 0)));
  EXPECT_TRUE(AddAll(assembler, one, 1));
  EXPECT_TRUE(AddAll(assembler, two, 1));
}

TEST(StackAssembler, StartsAnewWhenTheViewIsRepeatedAndSaysWhatIsLost) {
  StackAssembler assembler;
  const ImageStack stack = SomeStack("a", 1);
  ASSERT_TRUE(assembler.Add(FrameOf(stack, 0)));
  ASSERT_TRUE(assembler.Add(FrameOf(stack, 1)));
  const auto again = assembler.Add(FrameOf(stack, 0));
  ASSERT_TRUE(again);
  EXPECT_NE(again->discarded.find("view 1 of scan 'a' given up"), std::string::npos);
  EXPECT_FALSE(AddAll(assembler, stack, 2)) << "frame 1 of the first try must not count";
}

TEST(StackAssembler, RefusesMalformedFrames) {
  StackAssembler assembler;
  Frame frame = FrameOf(SomeStack("a", 1), 0);
  frame.index = frame.num_frames;
  EXPECT_FALSE(assembler.Add(frame));
  frame = FrameOf(SomeStack("a", 1), 0);
  frame.image.data.pop_back();
  EXPECT_FALSE(assembler.Add(frame));
  frame = FrameOf(SomeStack("a", 1), 0);
  frame.pattern.kind = "moire";
  EXPECT_FALSE(assembler.Add(frame));
}

StageState Held(const std::string& stage, const std::vector<std::uint32_t>& ids) {
  StageState state;
  state.stage = stage;
  state.scan_id = "a";
  state.view_ids = ids;
  return state;
}

TEST(ViewTracker, KnowsWhatIsInFlight) {
  ViewTracker tracker;
  tracker.Begin("a");
  tracker.Sent(0);
  tracker.Sent(1);
  EXPECT_EQ(tracker.InFlight(), (std::vector<int>{0, 1}));
  tracker.OnState(Held("pose", {0, 1}));
  tracker.OnState(Held("fusion", {0}));
  EXPECT_EQ(tracker.InFlight(), (std::vector<int>{1}));
  EXPECT_TRUE(tracker.Lost().empty());
}

TEST(ViewTracker, NoticesARestartedNode) {
  ViewTracker tracker;
  tracker.Begin("a");
  for (const int id : {0, 1, 2}) tracker.Sent(id);
  tracker.OnState(Held("pose", {0, 1}));
  tracker.OnState(Held("fusion", {0, 1}));
  StageState empty = Held("fusion", {});
  empty.scan_id = "";
  tracker.OnState(empty);
  // View 2 was on its way to the node that died.
  EXPECT_EQ(tracker.Lost(), (std::vector<int>{0, 1, 2}));
  tracker.Sent(0);
  EXPECT_EQ(tracker.Lost(), (std::vector<int>{1, 2}));
  tracker.OnState(Held("fusion", {0, 1}));
  EXPECT_EQ(tracker.Lost(), (std::vector<int>{2}));
}

TEST(ViewTracker, PassesOnARefusalInWords) {
  ViewTracker tracker;
  tracker.Begin("a");
  ViewStatus status;
  status.scan_id = "b";
  status.stage = "pose";
  status.message = "no tf";
  tracker.OnStatus(status);
  EXPECT_FALSE(tracker.Refusal()) << "of another scan";
  status.scan_id = "a";
  tracker.OnStatus(status);
  ASSERT_TRUE(tracker.Refusal());
  EXPECT_EQ(*tracker.Refusal(), "view 0 was refused by pose: no tf");
}

}  // namespace
}  // namespace fringe_fusion::nodes
