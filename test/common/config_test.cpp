#include "fringe_fusion/common/config.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "fringe_fusion/common/image.hpp"

namespace fringe_fusion {
namespace {

struct ExampleConfig {
  int steps = 4;
  double limit_px = 0.5;
  std::array<double, 2> box{0.0, 1.0};
  bool align = true;
  std::string name = "x";

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("steps", steps, 3, 64);
    field("limit_px", limit_px, 0.0, 2.0);
    field("box", box, -1.0, 1.0);
    field("align", align);
    field("name", name);
  }
};

TEST(CheckBounds, AcceptsTheBounds) {
  ExampleConfig config;
  config.steps = 3;
  config.limit_px = 2.0;
  EXPECT_TRUE(CheckBounds(config, "example"));
}

TEST(CheckBounds, NamesOwnerFieldValueAndBounds) {
  ExampleConfig config;
  config.steps = 65;
  config.limit_px = -1.0;  // the first violation is the one reported
  const Status status = CheckBounds(config, "example");
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().message, "example: steps = 65 is outside [3, 64]");
}

TEST(CheckBounds, RefusesNan) {
  ExampleConfig config;
  config.limit_px = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(CheckBounds(config, "example"));
  config = ExampleConfig{};
  config.box[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(CheckBounds(config, "example"));
}

TEST(Image, IsRowMajorAndCopiesItsPixels) {
  Image<int> image(3, 2, 5);
  image(2, 1) = 7;
  EXPECT_EQ(image[5], 7);
  EXPECT_EQ(image.row(1)[2], 7);
  Image<int> copy = image;
  copy(0, 0) = 1;
  EXPECT_EQ(image(0, 0), 5);
  EXPECT_TRUE(image.Contains(2, 1));
  EXPECT_FALSE(image.Contains(3, 1));
  EXPECT_FALSE(image.Contains(-1, 0));
  EXPECT_THROW(Image<int>(-1, 2), std::invalid_argument);
}

}  // namespace
}  // namespace fringe_fusion
