#include "fringe_fusion/registration/view_surface.hpp"

#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "test/registration/bumpy_views.hpp"
#include "test/registration/plane_views.hpp"

namespace fringe_fusion {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

View BumpyView() {
  testing::BumpyScene scene;
  scene.num_views = 1;
  return testing::MakeBumpyGraph(scene).graph.views.front();
}

TEST(ViewSurface, HalvesHaveEveryPointOnceAndShareNone) {
  const View view = BumpyView();
  const auto even = ViewSurface::Make(view, PixelSet::kRegistration, 1000);
  const auto odd = ViewSurface::Make(view, PixelSet::kHeldOut, 1000);
  ASSERT_TRUE(even && odd);
  EXPECT_EQ(even->points().size() + odd->points().size(),
            static_cast<std::size_t>(CountValid(view.range)));
  for (const SurfacePoint& point : odd->points()) {
    const int nearest = even->Nearest(point.point, 1.0F);
    ASSERT_GE(nearest, 0);
    EXPECT_GT((even->points()[static_cast<std::size_t>(nearest)].point - point.point).norm(), 0.0F);
  }
}

TEST(ViewSurface, SamplesAreBoundedEvenAndInside) {
  testing::PlaneScene scene;
  scene.side_px = 120;
  const auto surface =
      ViewSurface::Make(testing::MakePlaneView(scene, 0), PixelSet::kRegistration, 800);
  ASSERT_TRUE(surface);
  for (int level = 0; level < ViewSurface::kNumLevels; ++level) {
    const int limit = level == 2 ? 800 : level == 1 ? 200 : 50;
    const std::vector<int>& samples = surface->samples(level);
    EXPECT_LE(static_cast<int>(samples.size()), limit);
    EXPECT_GE(static_cast<int>(samples.size()), limit / 2);
    std::array<int, 4> quadrants = {};
    for (const int i : samples) {
      const SurfacePoint& point = surface->points()[static_cast<std::size_t>(i)];
      EXPECT_FALSE(point.border);
      ++quadrants[(point.point.x() > 0.0F ? 1U : 0U) + (point.point.y() > 0.0F ? 2U : 0U)];
    }
    for (const int count : quadrants) {
      EXPECT_NEAR(count, 0.25 * static_cast<double>(samples.size()),
                  0.12 * static_cast<double>(samples.size()) + 3.0);
    }
  }
}

TEST(ViewSurface, NearestAgreesWithExhaustiveSearch) {
  const auto surface = ViewSurface::Make(BumpyView(), PixelSet::kRegistration, 1000);
  ASSERT_TRUE(surface);
  constexpr float kRadius = 0.002F;
  int found = 0;
  for (std::size_t i = 0; i < surface->points().size(); i += 37) {
    const Eigen::Vector3f query =
        surface->points()[i].point +
        Eigen::Vector3f(5e-4F, -8e-4F, 0.1F * kRadius * static_cast<float>(i % 20));
    int best = -1;
    float best_distance = kRadius;
    for (std::size_t k = 0; k < surface->points().size(); ++k) {
      const float distance = (surface->points()[k].point - query).norm();
      if (distance < best_distance) {
        best_distance = distance;
        best = static_cast<int>(k);
      }
    }
    EXPECT_EQ(surface->Nearest(query, kRadius), best);
    found += best >= 0 ? 1 : 0;
  }
  EXPECT_GT(found, 10);
  EXPECT_EQ(surface->Nearest(Eigen::Vector3f::Zero(), kRadius), -1);
}

TEST(ViewSurface, MarksBordersOfHolesAndDepthSteps) {
  View view = testing::MakePlaneView({}, 0);
  view.range.points(20, 20).setConstant(kNan);
  for (int y = 0; y < 60; ++y) {
    for (int x = 40; x < 60; ++x) view.range.points(x, y).z() -= 0.01F;
  }
  const auto surface = ViewSurface::Make(view, PixelSet::kRegistration, 10000);
  ASSERT_TRUE(surface);
  for (const SurfacePoint& point : surface->points()) {
    const int x = static_cast<int>(std::lround(point.point.x() / 0.5e-3F)) + 30;
    const int y = static_cast<int>(std::lround(point.point.y() / 0.5e-3F)) + 30;
    const bool edge = x == 0 || y == 0 || x == 59 || y == 59;
    const bool hole = std::abs(x - 20) <= 1 && std::abs(y - 20) <= 1;
    const bool step = x == 39 || x == 40;
    EXPECT_EQ(point.border, edge || hole || step) << x << ", " << y;
  }
}

TEST(ViewSurface, VarianceIsThatAlongTheNormal) {
  View view = testing::MakePlaneView({}, 0);
  const Eigen::Vector3f tilted(0.6F, 0.0F, 0.8F);
  for (std::size_t i = 0; i < view.range.normals.size(); ++i) {
    view.range.normals[i] = tilted;
    view.range.sigma_range[i] = 3e-5F;
    view.range.sigma_lateral[i] = 1e-5F;
  }
  const auto surface = ViewSurface::Make(view, PixelSet::kRegistration, 1000);
  ASSERT_TRUE(surface);
  EXPECT_NEAR(surface->points().front().variance, 9e-10 * 0.64 + 1e-10 * 0.36, 1e-15);
}

TEST(ViewSurface, FacesSensorFollowsTheLineOfSight) {
  View view = testing::MakePlaneView({}, 0);
  const Eigen::Vector3f far_aside(10.0F, 0.0F, 1.0F);
  const Eigen::Vector3f normal = Eigen::Vector3f(0.5F, 0.0F, 0.1F).normalized();
  const auto parallel = ViewSurface::Make(view, PixelSet::kRegistration, 1000);
  EXPECT_TRUE(parallel->FacesSensor(far_aside, normal));
  view.range.line_of_sight = {};  // rays through the origin
  const auto central = ViewSurface::Make(view, PixelSet::kRegistration, 1000);
  EXPECT_FALSE(central->FacesSensor(far_aside, normal));
  EXPECT_TRUE(central->FacesSensor(far_aside, -normal));
}

TEST(ViewSurface, NamesTheViewWithoutNormals) {
  View view = testing::MakePlaneView({}, 7);
  for (Eigen::Vector3f& normal : view.range.normals) normal.setConstant(kNan);
  const auto surface = ViewSurface::Make(view, PixelSet::kRegistration, 1000);
  ASSERT_FALSE(surface);
  EXPECT_NE(surface.error().message.find("view 7 (plane7)"), std::string::npos);
}

TEST(MakeSurfaces, UnknownSigmaIsTheMedianOfTheKnownOrOne) {
  testing::PlaneScene noisy;
  noisy.sigma_range_m = 2e-5;
  std::vector<View> views = {testing::MakePlaneView(noisy, 0), testing::MakePlaneView({}, 1)};
  const auto mixed = MakeSurfaces(views, PixelSet::kRegistration, 1000);
  ASSERT_TRUE(mixed);
  EXPECT_TRUE(mixed->sigma_known);
  EXPECT_NEAR(mixed->surfaces[1].points().front().variance, 4e-10, 1e-15);
  views.erase(views.begin());
  const auto unknown = MakeSurfaces(views, PixelSet::kRegistration, 1000);
  ASSERT_TRUE(unknown);
  EXPECT_FALSE(unknown->sigma_known);
  EXPECT_EQ(unknown->surfaces[0].points().front().variance, 1.0);
}

}  // namespace
}  // namespace fringe_fusion
