#include "fringe_fusion/surface/extract_mesh.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "fringe_fusion/common/parallel.hpp"
#include "test/fusion/synthetic_views.hpp"
#include "test/surface/mesh_checks.hpp"

namespace fringe_fusion {
namespace {

using testing::CastView;

constexpr double kSphereRadius = 0.01;

ImplicitModel Fuse(const std::vector<View>& views, double voxel_m, int order = 0) {
  FusionConfig config;
  config.voxel_m = voxel_m;
  config.order = order;
  config.normal_radius_px = 0;  // CastView gives the true ones
  Result<ImplicitModel> model = ImplicitModel::Create(config);
  EXPECT_TRUE(model && model->AddViews(views));
  return std::move(*model);
}

Mesh Extract(const ImplicitModel& model) {
  Result<Mesh> mesh = ExtractMesh(model, SurfaceConfig{});
  EXPECT_TRUE(mesh) << mesh.error().message;
  return std::move(*mesh);
}

std::vector<View> SphereViews(double sigma_m) {
  testing::ViewSettings settings;
  settings.sigma_range_m = sigma_m;
  return testing::CastAround(testing::SphereScene(kSphereRadius), 0.12, settings);
}

TEST(ExtractMesh, SphereIsClosedAndTrue) {
  const Mesh mesh = Extract(Fuse(SphereViews(0.0), 7e-4, 2));
  const testing::EdgeCounts counts = testing::CountEdges(mesh.faces);
  EXPECT_EQ(counts.num_boundary, 0);
  EXPECT_EQ(counts.num_non_manifold, 0);
  const auto euler = static_cast<int>(mesh.vertices.size()) - counts.num_edges +
                     static_cast<int>(mesh.faces.size());
  EXPECT_EQ(euler, 2);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    EXPECT_NEAR(mesh.vertices[i].norm(), kSphereRadius, 1e-6);
    EXPECT_GT(mesh.normals[i].dot(mesh.vertices[i].normalized()), 0.9995F);
  }
  // Facets lie inside the sphere by about h^2 / (8 R) at most.
  const double area = 4.0 * M_PI * kSphereRadius * kSphereRadius;
  EXPECT_LT(Area(mesh), area);
  EXPECT_GT(Area(mesh), 0.998 * area);
}

TEST(ExtractMesh, NoisySphereIsClosedAndWithinItsSigma) {
  constexpr double kSigma = 1e-4;
  const Mesh mesh = Extract(Fuse(SphereViews(kSigma), 7e-4, 2));
  const testing::EdgeCounts counts = testing::CountEdges(mesh.faces);
  EXPECT_EQ(counts.num_boundary, 0);
  EXPECT_EQ(counts.num_non_manifold, 0);
  double sum = 0.0;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    sum += std::pow((mesh.vertices[i].cast<double>().norm() - kSphereRadius) / mesh.sigma[i], 2);
  }
  const double ratio = std::sqrt(sum / static_cast<double>(mesh.vertices.size()));
  EXPECT_GT(ratio, 0.8);
  EXPECT_LT(ratio, 1.25);
}

TEST(ExtractMesh, FacesTurnOutwards) {
  const Mesh mesh = Extract(Fuse(SphereViews(0.0), 1e-3));
  const std::vector<Eigen::Vector3f> normals = ComputeNormals(mesh);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    ASSERT_GT(normals[i].dot(mesh.vertices[i]), 0.0F);
  }
}

TEST(ExtractMesh, StaysOpenWhereNothingWasMeasured) {
  // One view sees the cap of the sphere above z = R^2 / distance only.
  const View view = CastView(0, testing::SphereScene(kSphereRadius), {0.0, 0.0, 0.12}, {});
  const Mesh mesh = Extract(Fuse({view}, 7e-4));
  const testing::EdgeCounts counts = testing::CountEdges(mesh.faces);
  EXPECT_GT(counts.num_boundary, 50);
  EXPECT_EQ(counts.num_non_manifold, 0);
  const double horizon = kSphereRadius * kSphereRadius / 0.12;
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    EXPECT_GT(vertex.z(), horizon - 2.0 * 7e-4);
  }
  for (const std::uint8_t num_views : mesh.num_views) EXPECT_EQ(num_views, 1);
}

TEST(ExtractMesh, ThinRibKeepsBothSides) {
  const testing::Scene rib = testing::BoxScene({0.011, 0.011, 0.00075});
  std::vector<View> views;
  for (const double side : {1.0, -1.0}) {
    for (const double x : {0.0, 0.06, -0.06}) {
      views.push_back(CastView(static_cast<int>(views.size()), rib, {x, 0.01, 0.09 * side}, {}));
    }
  }
  const Mesh mesh = Extract(Fuse(views, 8e-4));
  double top = 0.0;
  double bottom = 0.0;
  for (const Eigen::Vector3i& face : mesh.faces) {
    const auto vertex = [&](int i) { return mesh.vertices[static_cast<std::size_t>(face[i])]; };
    const Eigen::Vector3f center = (vertex(0) + vertex(1) + vertex(2)) / 3.0F;
    if (std::max(std::abs(center.x()), std::abs(center.y())) > 0.007F) continue;
    EXPECT_NEAR(std::abs(center.z()), 0.00075, 1e-5);
    const double area =
        0.5 * static_cast<double>((vertex(1) - vertex(0)).cross(vertex(2) - vertex(0)).norm());
    (center.z() > 0.0F ? top : bottom) += area;
  }
  EXPECT_NEAR(top, 1.96e-4, 1.5e-5);
  EXPECT_NEAR(bottom, 1.96e-4, 1.5e-5);
}

TEST(ExtractMesh, SameBytesOnAnyNumberOfThreads) {
  const ImplicitModel model = Fuse(SphereViews(1e-4), 1e-3);
  std::vector<Mesh> meshes;
  for (const int threads : {1, 2, 3}) {
    const ThreadLimit limit(threads);
    meshes.push_back(Extract(model));
  }
  for (const Mesh& mesh : meshes) {
    EXPECT_EQ(mesh.vertices, meshes[0].vertices);
    EXPECT_EQ(mesh.faces, meshes[0].faces);
    EXPECT_EQ(mesh.normals, meshes[0].normals);
    EXPECT_EQ(mesh.sigma, meshes[0].sigma);
    EXPECT_EQ(mesh.num_views, meshes[0].num_views);
  }
}

TEST(ExtractMesh, SaysWhyThereIsNoMesh) {
  const Result<ImplicitModel> empty = ImplicitModel::Create(FusionConfig{});
  ASSERT_TRUE(empty);
  const Result<Mesh> none = ExtractMesh(*empty, SurfaceConfig{});
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message.find("empty"), std::string::npos);

  const ImplicitModel model = Fuse(SphereViews(0.0), 1e-3);
  SurfaceConfig config;
  config.min_component_faces = 1000000;
  const Result<Mesh> small = ExtractMesh(model, config);
  ASSERT_FALSE(small);
  EXPECT_NE(small.error().message.find("min_component_faces = 1000000"), std::string::npos);

  const Result<Mesh> cancelled =
      ExtractMesh(model, SurfaceConfig{}, [](const std::string&, double) { return false; });
  ASSERT_FALSE(cancelled);
  EXPECT_EQ(cancelled.error().message, kCancelled);
}

}  // namespace
}  // namespace fringe_fusion
