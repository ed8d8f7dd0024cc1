#include "fringe_fusion/inspection/picture.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "fringe_fusion/common/parallel.hpp"
#include "test/inspection/shapes.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

bool IsWhite(const Rgb8& c) { return c.r == 255 && c.g == 255 && c.b == 255; }

TEST(RenderMesh, FitsASphereAsACentredDisc) {
  const auto picture = RenderMesh(Sphere(0.05F, 4), {1, 1, 0.5F}, 120, 100, false);
  ASSERT_TRUE(picture) << picture.error().message;
  EXPECT_FALSE(IsWhite((*picture)(60, 50)));
  EXPECT_TRUE(IsWhite((*picture)(0, 0)));
  int covered = 0;
  for (const Rgb8& pixel : *picture) covered += IsWhite(pixel) ? 0 : 1;
  // The disc fills the lower side but for the margin of 8 %: radius 100 / 1.08 / 2 px.
  const double radius = 50.0 / 1.08;
  EXPECT_NEAR(covered, 3.14159 * radius * radius, 0.05 * covered);
  // Brighter towards the lamp than at the rim.
  EXPECT_GT((*picture)(60, 45).r, (*picture)(60, 92).r + 20);
}

TEST(RenderMesh, ShowsFrontGreyAndBackBluish) {
  const Mesh plate = Plate(0.1F, 2, 0.0F);
  const auto front = RenderMesh(plate, {0, 0, 1}, 40, 40, false);
  const auto back = RenderMesh(plate, {0, 0, -1}, 40, 40, false);
  ASSERT_TRUE(front && back);
  EXPECT_EQ((*front)(20, 20).r, (*front)(20, 20).b);
  EXPECT_GT((*back)(20, 20).b, (*back)(20, 20).r + 40);
}

TEST(RenderMesh, PutsUpAtTheTopAndRightToTheRight) {
  // A red blob at high z, a green one at +y, seen from +x: y is to the right.
  Mesh mesh;
  const auto add = [&](const Eigen::Vector3f& center, const Rgb8& color) {
    const int offset = static_cast<int>(mesh.vertices.size());
    const Mesh box = Box(center.array() - 0.1F, center.array() + 0.1F);
    for (const Eigen::Vector3f& vertex : box.vertices) {
      mesh.vertices.push_back(vertex);
      mesh.colors.push_back(color);
    }
    for (const Eigen::Vector3i& face : box.faces) mesh.faces.push_back(face.array() + offset);
  };
  add({0, 0, 1}, {255, 0, 0});
  add({0, 0, -1}, {0, 0, 255});
  add({0, 1, 0}, {0, 255, 0});
  add({0, -1, 0}, {255, 255, 0});
  const auto picture = RenderMesh(mesh, {1, 0, 0}, 109, 109, true);
  ASSERT_TRUE(picture) << picture.error().message;
  const auto find = [&](auto is_color) {
    Eigen::Vector2d sum(0, 0);
    int count = 0;
    for (int y = 0; y < 109; ++y) {
      for (int x = 0; x < 109; ++x) {
        if (!is_color((*picture)(x, y))) continue;
        sum += Eigen::Vector2d(x, y);
        ++count;
      }
    }
    EXPECT_GT(count, 20);
    return Eigen::Vector2d(sum / std::max(1, count));
  };
  const auto red = find([](const Rgb8& c) { return c.r > 100 && c.g < 30; });
  const auto green = find([](const Rgb8& c) { return c.g > 100 && c.r < 30; });
  EXPECT_NEAR(red.x(), 54, 1);
  EXPECT_LT(red.y(), 20);
  EXPECT_GT(green.x(), 90);
  EXPECT_NEAR(green.y(), 54, 1);
}

TEST(RenderMesh, IsTheSameOnAnyNumberOfThreads) {
  std::vector<Image<Rgb8>> pictures;
  for (const int threads : {1, 3}) {
    const ThreadLimit limit(threads);
    pictures.push_back(*RenderMesh(Sphere(1.0F, 3), {1, 2, 3}, 64, 48, false));
  }
  EXPECT_TRUE(std::equal(
      pictures[0].begin(), pictures[0].end(), pictures[1].begin(),
      [](const Rgb8& a, const Rgb8& b) { return a.r == b.r && a.g == b.g && a.b == b.b; }));
}

TEST(RenderMesh, NamesWhatIsWrong) {
  const Mesh plate = Plate(1.0F, 1, 0.0F);
  const auto message = [](const Mesh& mesh, const Eigen::Vector3f& direction, int width) {
    const auto picture = RenderMesh(mesh, direction, width, 10, false);
    return picture ? std::string() : picture.error().message;
  };
  EXPECT_EQ(message(Mesh(), {0, 0, 1}, 10), "picture: the mesh has no faces");
  EXPECT_EQ(message(plate, {0, 0, 0}, 10), "picture: the direction must be finite and not zero");
  EXPECT_EQ(message(plate, {0, 0, 1}, 0), "picture: size 0 x 10 must be positive");
  Mesh nan = plate;
  nan.vertices[1].y() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(message(nan, {0, 0, 1}, 10), "picture: vertex 1 is not finite");
  Mesh wild = plate;
  wild.faces[1][0] = -1;
  EXPECT_EQ(message(wild, {0, 0, 1}, 10), "picture: face 1 names a vertex outside [0, 4)");
}

TEST(DeviationColors, RunFromBlueOverGreenToRed) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto colors =
      DeviationColors({-2e-3F, -1e-3F, -0.5e-3F, 0.0F, 0.5e-3F, 1e-3F, 9.0F, nan}, 1e-3);
  ASSERT_EQ(colors.size(), 8U);
  const auto is = [&](std::size_t i, int r, int g, int b) {
    return colors[i].r == r && colors[i].g == g && colors[i].b == b;
  };
  EXPECT_TRUE(is(0, 0, 0, 255));
  EXPECT_TRUE(is(1, 0, 0, 255));
  EXPECT_TRUE(is(2, 0, 255, 255));
  EXPECT_TRUE(is(3, 0, 255, 0));
  EXPECT_TRUE(is(4, 255, 255, 0));
  EXPECT_TRUE(is(5, 255, 0, 0));
  EXPECT_TRUE(is(6, 255, 0, 0));
  EXPECT_TRUE(is(7, 128, 128, 128));
  EXPECT_THROW((void)DeviationColors({1.0F}, 0.0), std::invalid_argument);
}

TEST(RenderScalar, StretchesBetweenQuantilesAndLeavesNanBlack) {
  Image<float> image(100, 10);
  for (std::size_t i = 0; i < image.size(); ++i) image[i] = static_cast<float>(i % 100);
  image(0, 0) = std::numeric_limits<float>::quiet_NaN();
  image(1, 0) = 1e30F;  // an outlier must not flatten the rest
  const Image<Rgb8> picture = RenderScalar(image);
  EXPECT_EQ(picture(0, 0).r + picture(0, 0).g + picture(0, 0).b, 0);
  EXPECT_GT(picture(10, 5).b, picture(10, 5).r);
  EXPECT_GT(picture(90, 5).r, picture(90, 5).b);
  EXPECT_TRUE(RenderScalar(Image<float>()).empty());
  const Image<Rgb8> constant = RenderScalar(Image<float>(3, 3, 7.0F));
  EXPECT_GT(constant(1, 1).g, 100);
  const Image<Rgb8> scaled = RenderScalar(Image<float>(50, 200, 7.0F), "px");
  ASSERT_GT(scaled.width(), 50);
  EXPECT_GT(scaled(50 + 20, 30).r, scaled(50 + 20, 30).b);  // the largest value on top
  EXPECT_GT(scaled(50 + 20, 165).b, scaled(50 + 20, 165).r);
}

TEST(WithColorBar, AddsTheScaleAtTheRight) {
  const Image<Rgb8> picture(50, 200, Rgb8{1, 2, 3});
  const Image<Rgb8> result = WithColorBar(picture, 0.5);
  ASSERT_GT(result.width(), 50);
  EXPECT_EQ(result.height(), 200);
  EXPECT_EQ(result(49, 199).b, 3);
  const int x = 50 + 20;
  EXPECT_GT(result(x, 22).r, 240);   // top: red
  EXPECT_GT(result(x, 100).g, 240);  // middle: green
  EXPECT_GT(result(x, 177).b, 240);  // bottom: blue
  int dark = 0;
  for (int y = 0; y < 200; ++y) {
    for (int column = 50 + 12 + 24; column < result.width(); ++column) {
      dark += result(column, y).g < 100 ? 1 : 0;
    }
  }
  EXPECT_GT(dark, 100) << "the labels";
  EXPECT_THROW((void)WithColorBar(picture, 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace fringe_fusion
