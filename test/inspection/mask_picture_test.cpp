#include "fringe_fusion/inspection/mask_picture.hpp"

#include <gtest/gtest.h>

#include <set>
#include <tuple>

namespace fringe_fusion {
namespace {

std::tuple<int, int, int> Key(const Rgb8& color) { return {color.r, color.g, color.b}; }

TEST(MaskPicture, GivesEveryReasonAColorOfItsOwn) {
  std::set<std::tuple<int, int, int>> colors;
  for (int i = 0; i < kNumMaskReasons; ++i) {
    colors.insert(Key(MaskColor(static_cast<MaskReason>(i))));
  }
  EXPECT_EQ(colors.size(), static_cast<std::size_t>(kNumMaskReasons));
  EXPECT_EQ(colors.count(Key(MaskColor(static_cast<MaskReason>(200)))), 0U);
}

TEST(MaskPicture, PaintsPixelByPixel) {
  Image<std::uint8_t> mask(3, 1);
  mask[1] = static_cast<std::uint8_t>(MaskReason::kSaturated);
  mask[2] = 255;
  const Image<Rgb8> picture = RenderMask(mask);
  ASSERT_EQ(picture.width(), 3);
  EXPECT_EQ(Key(picture[0]), Key(MaskColor(MaskReason::kValid)));
  EXPECT_EQ(Key(picture[1]), Key(MaskColor(MaskReason::kSaturated)));
  EXPECT_EQ(Key(picture[2]), std::make_tuple(255, 0, 255));
  EXPECT_TRUE(RenderMask({}).empty());
}

TEST(MaskPicture, LegendShowsTheColorOfEveryReason) {
  const Image<Rgb8> legend = MaskLegend();
  const int row = legend.height() / kNumMaskReasons;
  for (int i = 0; i < kNumMaskReasons; ++i) {
    EXPECT_EQ(Key(legend(15, i * row + row / 2)), Key(MaskColor(static_cast<MaskReason>(i)))) << i;
  }
}

}  // namespace
}  // namespace fringe_fusion
