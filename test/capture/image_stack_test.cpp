#include "fringe_fusion/capture/image_stack.hpp"

#include <gtest/gtest.h>

namespace fringe_fusion {
namespace {

ImageStack GoodStack() {
  ImageStack stack;
  stack.sequence.width = 64;
  stack.sequence.height = 32;
  stack.sequence.frames.resize(3);
  for (int i = 0; i < 3; ++i) {
    CapturedFrame frame;
    frame.pixels = Image<std::uint8_t>(4, 3);
    frame.stamp_ns = 100 * i;
    stack.frames.push_back(frame);
  }
  return stack;
}

std::string MessageOf(const ImageStack& stack) {
  const Status status = Validate(stack, "views/003");
  return status ? "" : status.error().message;
}

TEST(ImageStack, SizesOfBothPixelTypes) {
  CapturedFrame frame;
  frame.pixels = Image<std::uint16_t>(5, 2);
  EXPECT_EQ(Width(frame), 5);
  EXPECT_EQ(Height(frame), 2);
  frame.pixels = Image<std::uint8_t>(7, 6);
  EXPECT_EQ(Width(frame), 7);
  EXPECT_EQ(Height(frame), 6);
}

TEST(ImageStack, AcceptsAGoodStack) { EXPECT_EQ(MessageOf(GoodStack()), ""); }

TEST(ImageStack, RefusesAWrongFrameCount) {
  ImageStack stack = GoodStack();
  stack.frames.pop_back();
  EXPECT_EQ(MessageOf(stack), "views/003: 2 frames, but the pattern sequence has 3");
  stack.frames.clear();
  stack.sequence.frames.clear();
  EXPECT_EQ(MessageOf(stack), "views/003: no frames");
}

TEST(ImageStack, RefusesUnequalFrames) {
  ImageStack stack = GoodStack();
  stack.frames[2].pixels = Image<std::uint8_t>(3, 4);
  EXPECT_EQ(MessageOf(stack), "views/003: frame 2 is 3 x 4, but frame 0 is 4 x 3");
  stack = GoodStack();
  stack.frames[1].pixels = Image<std::uint16_t>(4, 3);
  EXPECT_NE(MessageOf(stack), "");
  stack = GoodStack();
  for (CapturedFrame& frame : stack.frames) frame.bit_depth = 12;
  EXPECT_NE(MessageOf(stack).find("12 bit"), std::string::npos);
  stack = GoodStack();
  stack.frames[0].pixels = Image<std::uint8_t>();
  EXPECT_EQ(MessageOf(stack), "views/003: frame 0 is empty");
}

TEST(ImageStack, RefusesStampsThatFall) {
  ImageStack stack = GoodStack();
  stack.frames[2].stamp_ns = 99;
  EXPECT_EQ(MessageOf(stack), "views/003: frame 2 is stamped 1 ns before frame 1");
}

TEST(ImageStack, RefusesAColourImageOfAnotherSize) {
  ImageStack stack = GoodStack();
  stack.color = Image<Rgb8>(4, 3);
  EXPECT_EQ(MessageOf(stack), "");
  stack.color = Image<Rgb8>(8, 6);
  EXPECT_NE(MessageOf(stack), "");
}

}  // namespace
}  // namespace fringe_fusion
