#include <gtest/gtest.h>

#include <cmath>

#include "test/fusion/synthetic_views.hpp"

namespace fringe_fusion {
namespace {

// A view with one point each at known places of the object frame; the pose is not the identity.
View PointView(const std::vector<Eigen::Vector3d>& points_object) {
  View view;
  view.id = 4;
  view.pose.T_object_camera = testing::LookAtOrigin({0.3, -0.2, 0.4});
  view.pose.source = PoseSource::kFile;
  view.range = MakeRangeImage(static_cast<int>(points_object.size()) + 1, 1);  // one pixel invalid
  const Transform T_camera_object = view.pose.T_object_camera.inverse();
  for (std::size_t i = 0; i < points_object.size(); ++i) {
    view.range.points[i] = (T_camera_object * points_object[i]).cast<float>();
    view.range.normals[i] = Eigen::Vector3f(0.0F, 0.0F, -1.0F);
    view.range.sigma_range[i] = 1e-5F;
    view.range.sigma_lateral[i] = 1e-5F;
  }
  return view;
}

TEST(CropView, CountsEachReasonOnce) {
  CropConfig config;
  config.crop_box = true;
  config.box_min_m = {{-0.1, -0.1, -0.1}};
  config.box_max_m = {{0.1, 0.1, 0.1}};
  config.remove_plane = true;
  config.plane_margin_m = 0.001;
  config.remove_fixture = true;
  config.fixture_min_m = {{0.05, 0.05, 0.0}};
  config.fixture_max_m = {{0.07, 0.07, 0.05}};
  const View view = PointView({{0.0, 0.0, 0.05},     // kept
                               {0.0, 0.0, 0.0012},   // kept, just above the margin
                               {0.0, 0.0, 0.0008},   // plane
                               {0.06, 0.06, -0.01},  // plane
                               {0.06, 0.06, 0.02},   // fixture
                               {0.0, 0.2, 0.02},     // box
                               {0.0, 0.0, -0.2}});   // box before plane
  const Result<CropResult> result = CropView(view, config);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->num_kept, 2);
  EXPECT_EQ(result->num_on_plane, 2);
  EXPECT_EQ(result->num_on_fixture, 1);
  EXPECT_EQ(result->num_outside_box, 2);
  EXPECT_EQ(CountValid(result->view.range), 2);
  EXPECT_TRUE(IsValid(result->view.range, 0, 0));
  EXPECT_TRUE(std::isnan(result->view.range.sigma_range[2]));
  EXPECT_TRUE(std::isnan(result->view.range.normals[2].x()));
  EXPECT_EQ(result->view.id, 4);
}

TEST(CropView, KeepsAllWhenSwitchedOff) {
  const View view = PointView({{0.0, 0.0, -5.0}, {3.0, 0.0, 0.0}});
  const Result<CropResult> result = CropView(view, CropConfig{});
  ASSERT_TRUE(result);
  EXPECT_EQ(result->num_kept, 2);
}

TEST(CropView, RefusesBadSettings) {
  const View view = PointView({{0.0, 0.0, 0.05}});
  CropConfig config;
  config.crop_box = true;
  config.box_max_m = {{1.0, -2.0, 1.0}};
  EXPECT_FALSE(CropView(view, config));
  config = CropConfig{};
  config.remove_plane = true;
  config.plane_normal = {{0.0, 0.0, 0.5}};
  EXPECT_FALSE(CropView(view, config));
  config.plane_normal = {{0.0, 0.0, std::nan("")}};
  EXPECT_FALSE(CropView(view, config));
  config = CropConfig{};
  config.remove_fixture = true;  // without a size
  EXPECT_FALSE(CropView(view, config));
}

}  // namespace
}  // namespace fringe_fusion
