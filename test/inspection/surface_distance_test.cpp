#include "fringe_fusion/inspection/surface_distance.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "test/inspection/shapes.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

// Nearest point of a triangle by a fine search over its barycentric coordinates: slow and sure.
double SearchedDistance(const Eigen::Vector3d& q, const Eigen::Vector3d& a,
                        const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  double best = std::numeric_limits<double>::infinity();
  constexpr int kSteps = 100;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const Eigen::Vector3d p = a + (b - a) * i / kSteps + (c - a) * j / kSteps;
      best = std::min(best, (q - p).norm());
    }
  }
  return best;
}

Eigen::Vector3d RandomPoint(std::mt19937& random, double scale) {
  std::uniform_real_distribution<double> uniform(-scale, scale);
  const double x = uniform(random);
  const double y = uniform(random);
  return {x, y, uniform(random)};
}

// Exact signed distance to an axis-aligned box, positive outside.
double BoxDistance(const Eigen::Vector3d& q, const Eigen::Vector3d& low,
                   const Eigen::Vector3d& high) {
  const Eigen::Vector3d outside = (low - q).cwiseMax(q - high);
  if (outside.maxCoeff() > 0.0) return outside.cwiseMax(0.0).norm();
  return outside.maxCoeff();
}

TEST(ClosestOnTriangle, AgreesWithASearch) {
  std::mt19937 random(1);
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d a = RandomPoint(random, 1.0);
    const Eigen::Vector3d b = RandomPoint(random, 1.0);
    const Eigen::Vector3d c = RandomPoint(random, 1.0);
    const Eigen::Vector3d q = RandomPoint(random, 2.0);
    const double exact = (q - ClosestOnTriangle(q, a, b, c).point).norm();
    const double searched = SearchedDistance(q, a, b, c);
    EXPECT_LE(exact, searched + 1e-12);
    EXPECT_NEAR(exact, searched, 0.04);
  }
}

TEST(ClosestOnTriangle, TellsCornersEdgesAndInside) {
  const Eigen::Vector3d a(0, 0, 0);
  const Eigen::Vector3d b(1, 0, 0);
  const Eigen::Vector3d c(0, 1, 0);
  const auto feature = [&](double x, double y) {
    return ClosestOnTriangle({x, y, 0.5}, a, b, c).feature;
  };
  EXPECT_EQ(feature(0.2, 0.2), 0);
  EXPECT_EQ(feature(-1, -1), 1);
  EXPECT_EQ(feature(2, -0.5), 2);
  EXPECT_EQ(feature(-0.5, 2), 3);
  EXPECT_EQ(feature(0.5, -1), 4);
  EXPECT_EQ(feature(1, 1), 5);
  EXPECT_EQ(feature(-1, 0.5), 6);
  // A triangle that collapsed to a line or to a point still has a nearest point.
  EXPECT_NEAR((ClosestOnTriangle({1, 1, 0}, a, b, 2 * b).point - b).norm(), 0.0, 1e-15);
  EXPECT_EQ(ClosestOnTriangle({1, 1, 0}, b, b, b).point, b);
}

TEST(SurfaceDistance, AgreesWithBruteForceOverAllTriangles) {
  const Mesh mesh = Sphere(1.0F, 3);
  const auto surface = SurfaceDistance::Create(mesh);
  ASSERT_TRUE(surface) << surface.error().message;
  std::mt19937 random(2);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d q = RandomPoint(random, 2.0);
    double best = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3i& face : mesh.faces) {
      const auto corner = [&](int k) -> Eigen::Vector3d {
        return mesh.vertices[static_cast<std::size_t>(face[k])].cast<double>();
      };
      best =
          std::min(best, (q - ClosestOnTriangle(q, corner(0), corner(1), corner(2)).point).norm());
    }
    const auto nearest = surface->Nearest(q, 100.0);
    ASSERT_TRUE(nearest);
    EXPECT_DOUBLE_EQ(std::abs(nearest->distance_m), best);
    EXPECT_NEAR((q - nearest->point).norm(), best, 1e-12);
    // Facets lie up to 0.05 below the sphere.
    if (q.norm() > 1.0 || q.norm() < 0.95) {
      EXPECT_EQ(nearest->distance_m > 0.0, q.norm() > 1.0) << q.transpose();
    }
  }
}

// Beyond a sharp edge or tip the normal of one of its faces may point either way: only the
// pseudo-normal is right.
TEST(SurfaceDistance, HasTheRightSignBeyondSharpEdgesAndTips) {
  // A long thin tetrahedron.
  Mesh spike;
  spike.vertices = {{0, 0, 0}, {1, 0, 0}, {0.5F, 0.1F, 0}, {0.5F, 0.03F, 2}};
  spike.faces = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  Mesh hole = spike;  // the same surface seen from inside a block
  for (Eigen::Vector3i& face : hole.faces) std::swap(face[0], face[1]);
  const auto solid = SurfaceDistance::Create(spike);
  const auto inverse = SurfaceDistance::Create(hole);
  ASSERT_TRUE(solid && inverse);
  std::mt19937 random(6);
  int num_inside = 0;
  for (int i = 0; i < 5000; ++i) {
    Eigen::Vector3d q = RandomPoint(random, 1.5) + Eigen::Vector3d(0.5, 0.0, 1.0);
    if (i % 2 == 0) q = Eigen::Vector3d(0.5, 0.03, 0.2) + RandomPoint(random, 0.2);
    bool inside = true;  // behind all four planes
    for (const Eigen::Vector3i& face : spike.faces) {
      const auto corner = [&](int k) -> Eigen::Vector3d {
        return spike.vertices[static_cast<std::size_t>(face[k])].cast<double>();
      };
      const Eigen::Vector3d normal = (corner(1) - corner(0)).cross(corner(2) - corner(0));
      inside = inside && normal.dot(q - corner(0)) < 0.0;
    }
    num_inside += inside ? 1 : 0;
    EXPECT_EQ(solid->Nearest(q, 10.0)->distance_m < 0.0, inside) << q.transpose();
    EXPECT_EQ(inverse->Nearest(q, 10.0)->distance_m > 0.0, inside) << q.transpose();
  }
  EXPECT_GT(num_inside, 100);
}

TEST(SurfaceDistance, HasTheSignOfABoxAlsoBeyondEdgesAndCorners) {
  const Eigen::Vector3d low(-1, -0.5, 0);
  const Eigen::Vector3d high(0.5, 1, 2);
  Mesh box = Box(low.cast<float>(), high.cast<float>());
  Mesh soup;  // the same triangles without shared vertices, as from an STL file
  for (const Eigen::Vector3i& face : box.faces) {
    const int first = static_cast<int>(soup.vertices.size());
    for (int k = 0; k < 3; ++k) {
      soup.vertices.push_back(box.vertices[static_cast<std::size_t>(face[k])]);
    }
    soup.faces.emplace_back(first, first + 1, first + 2);
  }
  soup.faces.emplace_back(0, 0, 1);  // no area
  for (const Mesh* mesh : {&box, &soup}) {
    const auto surface = SurfaceDistance::Create(*mesh);
    ASSERT_TRUE(surface) << surface.error().message;
    std::mt19937 random(3);
    for (int i = 0; i < 2000; ++i) {
      const Eigen::Vector3d q = RandomPoint(random, 3.0);
      const auto nearest = surface->Nearest(q, 10.0);
      ASSERT_TRUE(nearest);
      EXPECT_NEAR(nearest->distance_m, BoxDistance(q, low, high), 1e-12) << q.transpose();
    }
  }
}

TEST(SurfaceDistance, AnswersFarFromTheOriginOfCoordinates) {
  // Embree prunes in single precision; its candidates must hold for small parts far away.
  const Eigen::Vector3d low(10, 20, 30);
  const Eigen::Vector3d high(10.01, 20.02, 30.01);
  const Mesh box = Box(low.cast<float>(), high.cast<float>());
  const Eigen::Vector3d low_float = box.vertices[0].cast<double>();
  const Eigen::Vector3d high_float = box.vertices[7].cast<double>();
  const auto surface = SurfaceDistance::Create(box);
  ASSERT_TRUE(surface);
  std::mt19937 random(4);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d q = low + RandomPoint(random, 0.02);
    const auto nearest = surface->Nearest(q, 1.0);
    ASSERT_TRUE(nearest);
    EXPECT_NEAR(nearest->distance_m, BoxDistance(q, low_float, high_float), 1e-9);
  }
}

TEST(SurfaceDistance, FindsNothingBeyondTheLimitOrForNan) {
  const auto surface = SurfaceDistance::Create(Plate(1.0F, 2, 0.0F));
  ASSERT_TRUE(surface);
  EXPECT_FALSE(surface->Nearest({0.5, 0.5, 0.11}, 0.1));
  EXPECT_TRUE(surface->Nearest({0.5, 0.5, 0.09}, 0.1));
  EXPECT_FALSE(surface->Nearest({std::numeric_limits<double>::quiet_NaN(), 0, 0}, 10.0));
  EXPECT_FALSE(surface->Nearest({0, 0, 0}, std::numeric_limits<double>::quiet_NaN()));
}

TEST(SurfaceDistance, ReportsTheFaceOfTheMeshGiven) {
  Mesh plate = Plate(1.0F, 1, 0.0F);
  plate.faces.insert(plate.faces.begin(), {0, 0, 1});  // left out inside
  const auto surface = SurfaceDistance::Create(plate);
  ASSERT_TRUE(surface);
  EXPECT_EQ(surface->Nearest({0.1, 0.1, 1}, 10.0)->face, 1);
  EXPECT_EQ(surface->Nearest({0.9, 0.9, 1}, 10.0)->face, 2);
}

TEST(SurfaceDistance, RefusesMeshesWithoutASurface) {
  EXPECT_FALSE(SurfaceDistance::Create(Mesh()));
  Mesh mesh = Plate(1.0F, 1, 0.0F);
  mesh.faces[0][1] = 99;
  EXPECT_EQ(SurfaceDistance::Create(mesh).error().message,
            "face 0 names the vertex 99, outside [0, 4)");
  mesh = Plate(1.0F, 1, 0.0F);
  mesh.vertices[2].x() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(SurfaceDistance::Create(mesh).error().message, "vertex 2 is not finite");
  mesh = Plate(1.0F, 1, 0.0F);
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex.y() = 0.0F;
  EXPECT_EQ(SurfaceDistance::Create(mesh).error().message, "none of its 2 faces has an area");
}

}  // namespace
}  // namespace fringe_fusion
