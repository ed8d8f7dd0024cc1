#include "fringe_fusion/surface/fuse_views.hpp"

#include <gtest/gtest.h>

#include "fringe_fusion/io/config_yaml.hpp"
#include "test/fusion/synthetic_views.hpp"

namespace fringe_fusion {
namespace {

std::vector<View> WholeSphereViews() {
  return testing::CastAround(testing::SphereScene(0.01), 0.12, testing::ViewSettings{});
}

TEST(FuseViews, CropsFusesAndCounts) {
  const std::vector<View> views = WholeSphereViews();
  int num_points = 0;
  for (const View& view : views) num_points += CountValid(view.range);
  CropConfig crop;
  crop.remove_plane = true;  // z = 1 mm and below
  const Result<FusedSurface> fused = FuseViews(views, FusionConfig{}, crop, SurfaceConfig{});
  ASSERT_TRUE(fused) << fused.error().message;
  const FusionFigures& figures = fused->figures;
  EXPECT_EQ(figures.num_points + figures.num_on_plane, num_points);
  EXPECT_GT(figures.num_on_plane, num_points / 4);
  EXPECT_EQ(figures.num_empty_views, 1);  // the one from below
  EXPECT_EQ(figures.num_views, static_cast<int>(views.size()) - 1);
  EXPECT_EQ(figures.num_blocks, fused->model.NumBlocks());
  EXPECT_GT(figures.integrate_s, 0.0);
  for (const Eigen::Vector3f& vertex : fused->mesh.vertices) EXPECT_GT(vertex.z(), -1e-3F);
}

TEST(FuseViews, SaysWhyThereIsNoSurface) {
  const auto message = [](const std::vector<View>& views, const CropConfig& crop) {
    const Result<FusedSurface> fused = FuseViews(views, FusionConfig{}, crop, SurfaceConfig{});
    return fused ? std::string() : fused.error().message;
  };
  EXPECT_EQ(message({}, CropConfig{}), "fusion: no views");
  CropConfig crop;
  crop.remove_plane = true;
  crop.plane_offset_m = 1.0;
  EXPECT_NE(message(WholeSphereViews(), crop).find("remains after cropping"), std::string::npos);
  std::vector<View> views = WholeSphereViews();
  views[3].id = views[2].id;
  EXPECT_NE(message(views, CropConfig{}).find("already"), std::string::npos);
  views = WholeSphereViews();
  views[1].range = MakeRangeImage(30, 30);
  EXPECT_NE(message(views, CropConfig{}).find("no valid point"), std::string::npos);
}

TEST(FuseViews, ShippedSettingsAreTheDefaults) {
  const auto fusion = LoadConfigFile<FusionConfig>(SOURCE_DIR "/config/fusion.yaml");
  ASSERT_TRUE(fusion) << fusion.error().message;
  EXPECT_EQ(fusion->voxel_m, FusionConfig{}.voxel_m);
  EXPECT_EQ(fusion->order, FusionConfig{}.order);
  EXPECT_EQ(fusion->kernel_radius_voxels, FusionConfig{}.kernel_radius_voxels);
  EXPECT_EQ(fusion->num_levels, FusionConfig{}.num_levels);
  EXPECT_EQ(fusion->normal_radius_px, FusionConfig{}.normal_radius_px);
  EXPECT_EQ(fusion->border_taper_px, FusionConfig{}.border_taper_px);
  EXPECT_EQ(fusion->min_sigma_m, FusionConfig{}.min_sigma_m);
  EXPECT_EQ(fusion->min_weight_ratio, FusionConfig{}.min_weight_ratio);
  EXPECT_EQ(fusion->max_centroid_offset_voxels, FusionConfig{}.max_centroid_offset_voxels);
  EXPECT_EQ(fusion->max_memory_gb, FusionConfig{}.max_memory_gb);
  const auto surface = LoadConfigFile<SurfaceConfig>(SOURCE_DIR "/config/surface.yaml");
  ASSERT_TRUE(surface) << surface.error().message;
  EXPECT_EQ(surface->min_component_faces, SurfaceConfig{}.min_component_faces);
  const auto crop = LoadConfigFile<CropConfig>(SOURCE_DIR "/config/crop.yaml");
  ASSERT_TRUE(crop) << crop.error().message;
  EXPECT_FALSE(crop->crop_box || crop->remove_plane || crop->remove_fixture);
  EXPECT_EQ(crop->box_max_m, CropConfig{}.box_max_m);
  EXPECT_EQ(crop->plane_margin_m, CropConfig{}.plane_margin_m);
}

}  // namespace
}  // namespace fringe_fusion
