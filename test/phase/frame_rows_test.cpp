#include "src/phase/frame_rows.hpp"

#include <gtest/gtest.h>

#include "row_fixture.hpp"

namespace fringe_fusion::decode {
namespace {

TEST(FrameRows, LoadsBytesAndWords) {
  for (const int bit_depth : {8, 12}) {
    test::SyntheticScene scene;
    scene.bit_depth = bit_depth;
    test::RowFixture fixture(test::Synthesize(test::MakeTestSequence(false, "1,8", 4), scene));
    FrameRows& rows = fixture.rows;
    rows.Load(7);
    const float expected =
        std::visit([](const auto& image) { return static_cast<float>(image(5, 7)); },
                   fixture.stack.frames[4].pixels);
    EXPECT_EQ(rows.frame(4)[5], expected);
    EXPECT_FLOAT_EQ(rows.bright(0)[5], 180.0F);
    EXPECT_FLOAT_EQ(rows.dark(0)[5], 20.0F);
  }
}

TEST(FrameRows, LoadsStretchesAndRepeatsTheLastPixel) {
  test::RowFixture fixture(
      test::Synthesize(test::MakeTestSequence(false, "1,8", 4), test::SyntheticScene{}));
  const auto& image = std::get<Image<std::uint8_t>>(fixture.stack.frames[4].pixels);
  fixture.rows.Load(7, 60);
  for (int x = 0; x < 4; ++x) {
    EXPECT_EQ(fixture.rows.frame(4)[x], static_cast<float>(image(60 + x, 7)));
  }
  EXPECT_EQ(fixture.rows.frame(4)[63], static_cast<float>(image(63, 7)));
}

TEST(FrameRows, TakesExtremesWithoutWhiteAndBlack) {
  ImageStack stack = test::Synthesize(test::MakeTestSequence(true, "", 4), test::SyntheticScene{});
  stack.sequence.frames.erase(stack.sequence.frames.begin(), stack.sequence.frames.begin() + 2);
  stack.frames.erase(stack.frames.begin(), stack.frames.begin() + 2);
  test::RowFixture fixture(stack);
  FrameRows& rows = fixture.rows;
  rows.Load(0);
  EXPECT_FLOAT_EQ(rows.bright(0)[3], 180.0F);
  EXPECT_FLOAT_EQ(rows.dark(0)[3], 20.0F);
}

TEST(NoiseVariance, AddsReadShotAndQuantisation) {
  PhaseConfig config;
  config.read_noise_dn = 2.0;
  config.gain_dn = 0.5;
  EXPECT_NEAR(NoiseVariance(config, 100.0F), 4.0F + 50.0F + 1.0F / 12.0F, 1e-4F);
}

}  // namespace
}  // namespace fringe_fusion::decode
