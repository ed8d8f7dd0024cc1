#include "src/inspection/surface_samples.hpp"

#include <gtest/gtest.h>

#include "test/inspection/shapes.hpp"

namespace fringe_fusion::internal {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

TEST(SurfaceSamples, AreEvenOverTheAreaWhateverTheTriangles) {
  // Two plates of equal area, one of 2 triangles and one of 1800.
  Mesh mesh = Plate(1.0F, 1, 0.0F);
  const Mesh fine = Plate(1.0F, 30, 5.0F);
  const int offset = static_cast<int>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), fine.vertices.begin(), fine.vertices.end());
  for (const Eigen::Vector3i& face : fine.faces) mesh.faces.push_back(face.array() + offset);
  const auto samples = SurfaceSamples::Create(mesh, {}, 0.01);
  ASSERT_TRUE(samples) << samples.error().message;
  EXPECT_EQ(samples->count(), 20000);
  int lower = 0;
  std::array<int, 16> cells{};
  for (int i = 0; i < samples->count(); ++i) {
    const Eigen::Vector3d p = samples->At(i);
    lower += p.z() < 1.0 ? 1 : 0;
    const int x = std::min(3, static_cast<int>(4 * p.x()));
    const int y = std::min(3, static_cast<int>(4 * p.y()));
    ++cells[static_cast<std::size_t>(4 * y + x)];
    EXPECT_TRUE(p.z() == 0.0 || p.z() == 5.0);
  }
  EXPECT_NEAR(lower, 10000, 1);
  // 1250 expected in each cell; random samples would scatter by 35.
  for (const int count : cells) EXPECT_NEAR(count, 1250, 20);
}

TEST(SurfaceSamples, StayOnTheFacesInUse) {
  const Mesh mesh = Plate(1.0F, 1, 0.0F);
  const auto samples = SurfaceSamples::Create(mesh, {0, 1}, 0.05);
  ASSERT_TRUE(samples);
  EXPECT_EQ(samples->count(), 200);
  for (int i = 0; i < samples->count(); ++i) {
    EXPECT_GE(samples->At(i).x() + samples->At(i).y(), 1.0 - 1e-12);
  }
}

TEST(SurfaceSamples, SaysWhenThereIsNothingOrTooMuch) {
  const Mesh mesh = Plate(1.0F, 1, 0.0F);
  EXPECT_EQ(SurfaceSamples::Create(mesh, {0, 0}, 0.1).error().message,
            "no face to be sampled has an area");
  EXPECT_EQ(SurfaceSamples::Create(mesh, {}, 1e-6).error().message,
            "1 m2 at sample_spacing_m = 1e-06 need 1e+12 samples, limit 2e+08");
  EXPECT_EQ(SurfaceSamples::Create(mesh, {}, 50.0)->count(), 1);
}

}  // namespace
}  // namespace fringe_fusion::internal
