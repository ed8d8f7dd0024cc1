#include "fringe_fusion/surface/fill_holes.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/fusion/implicit_model.hpp"
#include "fringe_fusion/io/config_yaml.hpp"
#include "src/surface/harmonic_fill.hpp"
#include "src/surface/space_grid.hpp"
#include "test/fusion/synthetic_views.hpp"
#include "test/surface/mesh_checks.hpp"

namespace fringe_fusion {
namespace {

constexpr double kRadius = 0.01;

ImplicitModel FuseOpen(const std::vector<View>& views, double voxel_m) {
  FusionConfig config;
  config.voxel_m = voxel_m;
  config.normal_radius_px = 0;
  Result<ImplicitModel> model = ImplicitModel::Create(config);
  EXPECT_TRUE(model && model->AddViews(views));
  return std::move(*model);
}

ImplicitModel FuseOpen(const std::vector<View>& views) { return FuseOpen(views, 0.0005); }

// No camera looks from below.
std::vector<View> ViewsFromAbove(const testing::Scene& scene = testing::SphereScene(kRadius)) {
  std::vector<View> views;
  for (const View& view : testing::CastAround(scene, 0.12, {})) {
    if (view.pose.T_object_camera.translation().z() > -0.01) views.push_back(view);
  }
  return views;
}

std::size_t CountFilled(const Mesh& mesh) {
  std::size_t count = 0;
  for (const std::uint8_t flag : mesh.filled_faces) count += flag;
  return count;
}

TEST(FillHoles, ClosesAndFlagsWhatNobodySaw) {
  const std::vector<View> views = ViewsFromAbove();
  const ImplicitModel model = FuseOpen(views);
  const Result<Mesh> open = ExtractMesh(model, SurfaceConfig{});
  ASSERT_TRUE(open);
  ASSERT_GT(testing::CountEdges(open->faces).num_boundary, 0);
  FillConfig config;
  config.watertight = true;
  const Result<FilledSurface> filled = FillHoles(model, views, config, SurfaceConfig{});
  ASSERT_TRUE(filled) << filled.error().message;
  const Mesh& mesh = filled->mesh;
  const testing::EdgeCounts edges = testing::CountEdges(mesh.faces);
  EXPECT_EQ(edges.num_boundary, 0);
  EXPECT_EQ(edges.num_non_manifold, 0);
  EXPECT_EQ(filled->figures.num_open_edges, 0U);
  ASSERT_EQ(mesh.filled_faces.size(), mesh.faces.size());
  EXPECT_EQ(CountFilled(mesh), filled->figures.num_filled_faces);
  // The measured part is the one of the open mesh.
  EXPECT_EQ(mesh.faces.size() - CountFilled(mesh), open->faces.size());
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    for (const int v : mesh.faces[i]) {
      const Eigen::Vector3f& vertex = mesh.vertices[static_cast<std::size_t>(v)];
      if (mesh.filled_faces[i] == 0) {
        EXPECT_NEAR(vertex.norm(), kRadius, 1e-4);
      } else {
        EXPECT_LT(vertex.z(), -0.3F * static_cast<float>(kRadius));
        EXPECT_NEAR(vertex.norm(), kRadius, 0.4 * kRadius);
      }
    }
  }
}

// Below a box the field steps from the least to the largest value between two voxels: whatever the
// rounding of the voxel, the extraction must see one surface there.
TEST(FillHoles, ClosesAFlatBottomAtAnyVoxel) {
  const std::vector<View> views =
      ViewsFromAbove(testing::BoxScene(Eigen::Vector3d(0.008, 0.007, 0.006)));
  FillConfig config;
  config.watertight = true;
  for (const double voxel_m : {0.0005, 0.0006, 0.00073}) {
    const auto filled = FillHoles(FuseOpen(views, voxel_m), views, config, SurfaceConfig{});
    ASSERT_TRUE(filled) << filled.error().message;
    EXPECT_EQ(filled->figures.num_open_edges, 0U) << voxel_m;
    EXPECT_EQ(testing::CountEdges(filled->mesh.faces).num_boundary, 0) << voxel_m;
    EXPECT_GT(CountFilled(filled->mesh), 0U);
    for (const Eigen::Vector3f& vertex : filled->mesh.vertices) {
      EXPECT_GT(vertex.z(), -0.006F - 2.0F * static_cast<float>(voxel_m));
    }
  }
}

// The nodes of the grid on which space is judged lie at any height about a surface; the post shifts
// them. Below the plate they must learn that they are inside.
TEST(FillHoles, FillsToTheBottomHoweverTheGridLies) {
  constexpr double kMiddle = -0.003;
  for (const double post : {0.0030, 0.0032, 0.0034, 0.0036, 0.0038}) {
    const testing::Scene plate = testing::BoxScene(Eigen::Vector3d(0.012, 0.012, -kMiddle));
    const testing::Scene block = testing::BoxScene(Eigen::Vector3d(0.002, 0.002, post - kMiddle));
    const testing::Scene scene = [&](const Eigen::Vector3d& origin,
                                     const Eigen::Vector3d& direction) {
      const Eigen::Vector3d shifted = origin - Eigen::Vector3d(0.0, 0.0, kMiddle);
      const auto on_plate = plate(shifted, direction);
      const auto on_block = block(shifted, direction);
      if (!on_block || (on_plate && on_plate->range_m < on_block->range_m)) return on_plate;
      return on_block;
    };
    const std::vector<View> views = ViewsFromAbove(scene);
    FillConfig config;
    config.watertight = true;
    const auto filled = FillHoles(FuseOpen(views), views, config, SurfaceConfig{});
    ASSERT_TRUE(filled) << filled.error().message;
    EXPECT_EQ(filled->figures.num_open_edges, 0U);
    for (std::size_t i = 0; i < filled->mesh.faces.size(); ++i) {
      if (filled->mesh.filled_faces[i] == 0) continue;
      for (const int v : filled->mesh.faces[i]) {
        const Eigen::Vector3f& vertex = filled->mesh.vertices[static_cast<std::size_t>(v)];
        if (vertex.head<2>().cwiseAbs().maxCoeff() > 0.010F) continue;
        EXPECT_LT(vertex.z(), static_cast<float>(2.0 * kMiddle + 0.003)) << post;
      }
    }
  }
}

TEST(FillHoles, LeavesLargeHolesOpen) {
  const std::vector<View> views = ViewsFromAbove();
  const ImplicitModel model = FuseOpen(views);
  FillConfig config;
  config.max_hole_m = 0.002;
  const Result<FilledSurface> filled = FillHoles(model, views, config, SurfaceConfig{});
  ASSERT_TRUE(filled);
  EXPECT_GE(filled->figures.num_left, 1);
  EXPECT_GT(filled->figures.num_open_edges, 0U);
}

// A plate with a hole through it that the camera sees: no face may close it.
TEST(FillHoles, KeepsEmptySpaceEmpty) {
  constexpr double kHole = 0.004;
  const testing::Scene scene = [](const Eigen::Vector3d& origin,
                                  const Eigen::Vector3d& direction) -> std::optional<testing::Hit> {
    const double t = -origin.z() / direction.z();
    const Eigen::Vector3d at = origin + t * direction;
    const bool on_plate = at.cwiseAbs().maxCoeff() < 0.012 && at.head<2>().norm() > kHole;
    if (t > 0.0 && on_plate) {
      return testing::Hit{t, Eigen::Vector3d(0.0, 0.0, origin.z() > 0.0 ? 1.0 : -1.0)};
    }
    // A table below shows through.
    const double table = (-0.01 - origin.z()) / direction.z();
    if (!(table > 0.0)) return std::nullopt;
    return testing::Hit{table, Eigen::Vector3d::UnitZ()};
  };
  std::vector<View> views{testing::CastView(0, scene, {0.0, 0.001, 0.12}, {})};
  ImplicitModel model = FuseOpen(views);
  FillConfig config;
  config.watertight = true;
  const Result<FilledSurface> filled = FillHoles(model, views, config, SurfaceConfig{});
  ASSERT_TRUE(filled) << filled.error().message;
  EXPECT_GT(filled->figures.num_empty, 0U);
  for (std::size_t i = 0; i < filled->mesh.faces.size(); ++i) {
    Eigen::Vector3f middle = Eigen::Vector3f::Zero();
    for (const int v : filled->mesh.faces[i]) {
      middle += filled->mesh.vertices[static_cast<std::size_t>(v)] / 3.0F;
    }
    const bool in_the_hole = middle.head<2>().norm() < 0.6F * static_cast<float>(kHole) &&
                             middle.z() > -0.007F && middle.z() < 0.01F;
    EXPECT_FALSE(in_the_hole) << middle.transpose();
  }
}

TEST(FillHoles, SameBytesOnAnyNumberOfThreads) {
  const std::vector<View> views = ViewsFromAbove();
  const ImplicitModel model = FuseOpen(views);
  FillConfig config;
  config.watertight = true;
  std::vector<Eigen::Vector3f> expected;
  for (const int threads : {1, 2, 3}) {
    const ThreadLimit limit(threads);
    const Result<FilledSurface> filled = FillHoles(model, views, config, SurfaceConfig{});
    ASSERT_TRUE(filled);
    if (expected.empty()) expected = filled->mesh.vertices;
    EXPECT_EQ(filled->mesh.vertices, expected);
  }
}

TEST(FillHoles, SaysWhatIsWrong) {
  const std::vector<View> views = ViewsFromAbove();
  const ImplicitModel model = FuseOpen(views);
  FillConfig config;
  config.max_cells = 2;
  const auto refused = FillHoles(model, views, config, SurfaceConfig{});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("max_cells = 2"), std::string::npos);
  const auto file = LoadConfigFile<FillConfig>(SOURCE_DIR "/config/fill.yaml");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->max_cells, FillConfig{}.max_cells);
}

TEST(CarveEmpty, MarksWhatTheRayPassed) {
  internal::SpaceGrid grid{Eigen::Vector3d(-1.0, -1.0, -1.0), 0.5, {5, 5, 5}};
  View view;
  view.range = MakeRangeImage(1, 1);
  view.range.points(0, 0) = Eigen::Vector3f(0.0F, 0.0F, 2.0F);
  view.range.sigma_range(0, 0) = 0.0F;
  view.range.normals(0, 0) = -Eigen::Vector3f::UnitZ();
  view.pose.T_object_camera.translation() = Eigen::Vector3d(0.0, 0.0, -2.0);
  std::vector<internal::Space> states(grid.count(), internal::Space::kUnknown);
  states[grid.Index(2, 2, 0)] = internal::Space::kSeen;
  internal::CarveEmpty(grid, {&view}, 0.6, states);
  // The point is the origin; 0.6 before it the carving ends, in the cell about z = -0.5.
  EXPECT_EQ(states[grid.Index(2, 2, 0)], internal::Space::kSeen);
  EXPECT_EQ(states[grid.Index(2, 2, 1)], internal::Space::kEmpty);
  EXPECT_EQ(states[grid.Index(2, 2, 2)], internal::Space::kUnknown);
  EXPECT_EQ(states[grid.Index(3, 2, 1)], internal::Space::kUnknown);
}

TEST(SolveHarmonic, IsLinearBetweenPlanesAndKeepsBounds) {
  internal::FillProblem problem;
  problem.grid = {Eigen::Vector3d::Zero(), 1.0, {21, 9, 9}};
  problem.value.assign(problem.grid.count(), 0.0F);
  problem.fixed.assign(problem.grid.count(), 0);
  problem.lower.assign(problem.grid.count(), -std::numeric_limits<float>::infinity());
  for (int z = 0; z < 9; ++z) {
    for (int y = 0; y < 9; ++y) {
      for (const int x : {0, 20}) {
        problem.fixed[problem.grid.Index(x, y, z)] = 1;
        problem.value[problem.grid.Index(x, y, z)] = x == 0 ? -1.0F : 1.0F;
      }
    }
  }
  const std::vector<float> free = internal::SolveHarmonic(problem, 200);
  EXPECT_NEAR(free[problem.grid.Index(5, 4, 4)], -0.5F, 0.01F);
  EXPECT_NEAR(free[problem.grid.Index(10, 0, 8)], 0.0F, 0.01F);
  problem.lower[problem.grid.Index(5, 4, 4)] = 0.25F;
  const std::vector<float> bounded = internal::SolveHarmonic(problem, 200);
  EXPECT_GE(bounded[problem.grid.Index(5, 4, 4)], 0.25F);
  EXPECT_GT(bounded[problem.grid.Index(5, 5, 4)], free[problem.grid.Index(5, 5, 4)]);
}

}  // namespace
}  // namespace fringe_fusion
