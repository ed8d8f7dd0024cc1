#include "fringe_fusion/surface/fuse_slabs.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/surface/fuse_views.hpp"
#include "test/fusion/synthetic_views.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

constexpr double kSlabBall = 0.008;

// A ball, and beside it a small one that a plane between two slabs cuts.
std::vector<View> TwoBalls() {
  const testing::Scene ball = testing::SphereScene(kSlabBall);
  const testing::Scene small = testing::SphereScene(0.0012);
  const Eigen::Vector3d place(0.0, 0.0, 0.011);
  const testing::Scene both = [=](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
    const auto near = small(origin - place, direction);
    return near ? near : ball(origin, direction);
  };
  testing::ViewSettings settings;
  settings.sigma_range_m = 2e-5;
  std::vector<View> views = testing::CastAround(both, 0.12, settings);
  views.resize(8);
  return views;
}

SlabJob MakeJob(const test_support::TempFolder& folder) {
  SlabJob job;
  job.fusion.voxel_m = 5e-4;
  job.mesh_path = folder / "slabs.ply";
  job.scratch_folder = folder.path();
  return job;
}

// Bytes of the mesh of the whole model.
std::string WholeMesh(const std::vector<View>& views, const SlabJob& job,
                      const test_support::TempFolder& folder) {
  const Result<FusedSurface> fused = FuseViews(views, job.fusion, job.crop, job.surface);
  EXPECT_TRUE(fused) << fused.error().message;
  EXPECT_TRUE(fused && WriteMesh(fused->mesh, folder / "whole.ply"));
  return ReadFile(folder / "whole.ply").value_or("");
}

ViewReader ReaderOf(const std::vector<View>& views) {
  return [&views](int index) { return views[static_cast<std::size_t>(index)]; };
}

TEST(FuseSlabs, WritesTheBytesOfTheWholeMesh) {
  const test_support::TempFolder folder;
  const std::vector<View> views = TwoBalls();
  // The small ball has some 120 faces: once it stays, once it goes.
  for (const int min_faces : {0, 1000}) {
    SlabJob job = MakeJob(folder);
    job.surface.min_component_faces = min_faces;
    const std::string whole = WholeMesh(views, job, folder);
    ASSERT_GT(whole.size(), 10000U);
    for (const int columns : {1, 3, 0}) {
      job.max_columns = columns;
      const auto figures = FuseSlabs(job, static_cast<int>(views.size()), ReaderOf(views));
      ASSERT_TRUE(figures) << figures.error().message;
      EXPECT_EQ(figures->num_views, 8);
      EXPECT_GT(figures->num_slabs, columns == 1 ? 4 : 0);
      const auto slabs = ReadFile(job.mesh_path);
      ASSERT_TRUE(slabs) << slabs.error().message;
      EXPECT_TRUE(*slabs == whole)
          << columns << " columns: " << slabs->size() << " bytes, whole " << whole.size();
    }
  }
  // Nothing but the meshes stays behind.
  const auto begin = std::filesystem::directory_iterator(folder.path());
  EXPECT_EQ(std::distance(begin, std::filesystem::directory_iterator()), 2);
}

TEST(FuseSlabs, DividesByMemory) {
  const test_support::TempFolder folder;
  const std::vector<View> views = TwoBalls();
  SlabJob job = MakeJob(folder);
  job.fusion.voxel_m = 2.5e-4;
  job.fusion.max_memory_gb = 0.03;
  const auto figures = FuseSlabs(job, static_cast<int>(views.size()), ReaderOf(views));
  ASSERT_TRUE(figures) << figures.error().message;
  EXPECT_GT(figures->num_slabs, 1);
  job.fusion.max_memory_gb = 0.01;
  const auto refused = FuseSlabs(job, static_cast<int>(views.size()), ReaderOf(views));
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("use max_memory_gb >="), std::string::npos)
      << refused.error().message;
}

TEST(FuseSlabs, SaysWhatIsWrong) {
  const test_support::TempFolder folder;
  const std::vector<View> views = TwoBalls();
  SlabJob job = MakeJob(folder);
  EXPECT_FALSE(FuseSlabs(job, 0, ReaderOf(views)));
  const ViewReader twice = [&](int) { return views[0]; };
  const auto doubled = FuseSlabs(job, 2, twice);
  ASSERT_FALSE(doubled);
  EXPECT_NE(doubled.error().message.find("view 0"), std::string::npos) << doubled.error().message;
  const ViewReader failing = [](int) -> Result<View> { return Fail("no such file"); };
  EXPECT_EQ(FuseSlabs(job, 1, failing).error().message, "no such file");
  job.mesh_path = folder / "slabs.stl";
  EXPECT_FALSE(FuseSlabs(job, 1, ReaderOf(views)));
  job = MakeJob(folder);
  job.scratch_folder = folder / "absent";
  const auto scratch = FuseSlabs(job, 1, ReaderOf(views));
  ASSERT_FALSE(scratch);
  EXPECT_NE(scratch.error().message.find("absent"), std::string::npos);
  job = MakeJob(folder);
  job.crop.crop_box = true;
  job.crop.box_min_m = {1.0, 1.0, 1.0};
  job.crop.box_max_m = {2.0, 2.0, 2.0};
  EXPECT_FALSE(FuseSlabs(job, 1, ReaderOf(views)));
  job = MakeJob(folder);
  const Progress cancel = [](const std::string& stage, double) { return stage != "extract"; };
  EXPECT_EQ(FuseSlabs(job, 8, ReaderOf(views), cancel).error().message, kCancelled);
  EXPECT_FALSE(std::filesystem::exists(job.mesh_path));
}

}  // namespace
}  // namespace fringe_fusion
