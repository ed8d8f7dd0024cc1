#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <unordered_map>

#include "common/constants.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/sim/gauges.hpp"

namespace fringe_fusion::sim {
namespace {

using Eigen::Vector3d;

// The part as an implicit function in millimetres, negative inside, with a slope of about 1.

// Minimum of two functions, rounded where they differ by less than `blend`.
double SmoothMin(double a, double b, double blend) {
  const double overlap = std::max(0.0, blend - std::abs(a - b));
  return std::min(a, b) - overlap * overlap / (4.0 * blend);
}
double SmoothMax(double a, double b, double blend) { return -SmoothMin(-a, -b, blend); }

// First-order distance of the ellipsoid |p / radii| = 1: the value over the length of its gradient.
double Ellipsoid(const Vector3d& p, const Vector3d& radii) {
  const Vector3d scaled = p.cwiseQuotient(radii);
  const double norm = scaled.norm();
  const double slope = scaled.cwiseQuotient(radii).norm();
  if (!(slope > 1e-9)) return -radii.minCoeff();
  return (norm - 1.0) * norm / slope;
}

// Torus about the y axis.
double Torus(const Vector3d& p, double major, double minor) {
  return std::hypot(std::hypot(p.x(), p.z()) - major, p.y()) - minor;
}

// Gusset of 1.8 mm between foot and body, both sides: |y| / 24 + z / 46 < 1.
double Rib(const Vector3d& p, double x) {
  constexpr double kHalfThickness = 0.9;
  const Vector3d slope = Vector3d(0.0, 1.0 / 24.0, 1.0 / 46.0);
  const double ramp = (std::abs(p.y()) * slope.y() + p.z() * slope.z() - 1.0) / slope.norm();
  return SmoothMax(std::abs(p.x() - x) - kHalfThickness, ramp, 0.5);
}

double FreeformMm(const Vector3d& p) {
  // Body, ring and handle sway along a wave so that no wall is flat.
  const Vector3d swayed(p.x(), p.y() - 4.0 * std::sin(2.0 * kPi * p.z() / 90.0), p.z());
  const double body = Ellipsoid(swayed - Vector3d(0.0, 0.0, 36.0), {24.0, 9.0, 34.0});
  const double window = std::hypot(swayed.x() - 3.0, swayed.z() - 42.0) - 8.5;
  const double ring = Torus(swayed - Vector3d(-3.0, 0.0, 64.0), 12.0, 4.0);
  const double handle = Torus(swayed - Vector3d(27.0, 0.0, 33.0), 12.0, 3.5);
  double solid = SmoothMin(body, Ellipsoid(p, {32.0, 26.0, 14.0}), 6.0);
  solid = SmoothMin(solid, ring, 4.0);
  solid = SmoothMin(solid, handle, 4.0);
  for (const double x : {-15.0, 0.0, 15.0}) solid = SmoothMin(solid, Rib(p, x), 1.5);
  // The openings are cut last: blends and ribs must not close them.
  solid = SmoothMax(solid, -window, 3.0);
  solid = SmoothMax(solid, 7.5 - std::hypot(swayed.x() + 3.0, swayed.z() - 65.0), 2.0);
  solid = SmoothMax(solid, 7.5 - std::hypot(swayed.x() - 28.5, swayed.z() - 33.0), 2.0);
  return std::max(solid, -p.z());
}

// Zero surface of FreeformMm by marching tetrahedra. Every cube is split in the six tetrahedra
// around its main diagonal, which fits from cube to cube, so the surface is closed and manifold.
// Ref: Doi and Koide, "An efficient method of triangulating equi-valued surfaces by using
// tetrahedral cells", IEICE Trans. E74(1), 1991.
class TetrahedralMesher {
 public:
  explicit TetrahedralMesher(double step_mm) : step_mm_(step_mm) {
    const Vector3d size = Vector3d(84.0, 68.0, 85.0);
    // The odd start keeps nodes off the planes of symmetry and off z = 0.
    origin_ = Vector3d(-37.0, -34.0, -2.0) - Vector3d(0.37, 0.41, 0.43) * step_mm;
    for (int axis = 0; axis < 3; ++axis) {
      count_[static_cast<std::size_t>(axis)] = static_cast<int>(size[axis] / step_mm) + 2;
    }
    values_.resize(static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]) *
                   static_cast<std::size_t>(count_[2]));
    ParallelFor(count_[2], 1, [&](int begin, int end) {
      for (int k = begin; k < end; ++k) FillLayer(k);
    });
  }

  Mesh Run() {
    for (int k = 0; k + 1 < count_[2]; ++k) {
      for (int j = 0; j + 1 < count_[1]; ++j) {
        for (int i = 0; i + 1 < count_[0]; ++i) AddCube({i, j, k});
      }
    }
    mesh_.normals = ComputeNormals(mesh_);
    return std::move(mesh_);
  }

 private:
  using Node = std::array<int, 3>;

  [[nodiscard]] std::size_t Index(const Node& n) const {
    return (static_cast<std::size_t>(n[2]) * static_cast<std::size_t>(count_[1]) +
            static_cast<std::size_t>(n[1])) *
               static_cast<std::size_t>(count_[0]) +
           static_cast<std::size_t>(n[0]);
  }
  [[nodiscard]] Vector3d Position(const Node& n) const {
    return origin_ + step_mm_ * Vector3d(n[0], n[1], n[2]);
  }
  void FillLayer(int k) {
    for (int j = 0; j < count_[1]; ++j) {
      for (int i = 0; i < count_[0]; ++i)
        values_[Index({i, j, k})] = FreeformMm(Position({i, j, k}));
    }
  }

  static Node Corner(const Node& base, unsigned mask) {
    return {base[0] + static_cast<int>(mask & 1U), base[1] + static_cast<int>((mask >> 1U) & 1U),
            base[2] + static_cast<int>((mask >> 2U) & 1U)};
  }

  void AddCube(const Node& base) {
    std::array<bool, 8> inside{};
    int num_inside = 0;
    for (unsigned mask = 0; mask < 8; ++mask) {
      inside[mask] = values_[Index(Corner(base, mask))] < 0.0;
      num_inside += inside[mask] ? 1 : 0;
    }
    if (num_inside == 0 || num_inside == 8) return;
    // Paths from corner 0 to corner 7 along the axes; odd orders are turned to positive volume.
    constexpr std::array<std::array<unsigned, 4>, 6> kTetrahedra = {
        {{0, 1, 3, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 3, 2, 7}, {0, 6, 4, 7}, {0, 5, 1, 7}}};
    for (const auto& tetrahedron : kTetrahedra) AddTetrahedron(base, tetrahedron, inside);
  }

  void AddTetrahedron(const Node& base, const std::array<unsigned, 4>& corner,
                      const std::array<bool, 8>& inside) {
    // Even permutations that bring one corner, or a pair of corners, to the front.
    constexpr std::array<std::array<std::size_t, 4>, 4> kSingle = {
        {{0, 1, 2, 3}, {1, 0, 3, 2}, {2, 3, 0, 1}, {3, 2, 1, 0}}};
    constexpr std::array<std::array<std::size_t, 4>, 6> kPair = {
        {{0, 1, 2, 3}, {0, 2, 3, 1}, {0, 3, 1, 2}, {1, 2, 0, 3}, {1, 3, 2, 0}, {2, 3, 0, 1}}};
    const auto cut = [&](std::size_t a, std::size_t b) {
      return EdgeVertex(base, corner[a], corner[b]);
    };
    const auto is_in = [&](std::size_t i) { return inside[corner[i]]; };
    int count = 0;
    for (std::size_t i = 0; i < 4; ++i) count += is_in(i) ? 1 : 0;
    if (count == 1 || count == 3) {
      for (const auto& [a, b, c, d] : kSingle) {
        if (is_in(a) != (count == 1)) continue;
        if (count == 1) {
          mesh_.faces.emplace_back(cut(a, b), cut(a, c), cut(a, d));
        } else {
          mesh_.faces.emplace_back(cut(a, b), cut(a, d), cut(a, c));
        }
      }
    } else if (count == 2) {
      for (const auto& [a, b, c, d] : kPair) {
        if (!is_in(a) || !is_in(b)) continue;
        const int ac = cut(a, c);
        const int bd = cut(b, d);
        mesh_.faces.emplace_back(ac, cut(a, d), bd);
        mesh_.faces.emplace_back(ac, bd, cut(b, c));
      }
    }
  }

  int EdgeVertex(const Node& base, unsigned a, unsigned b) {
    const unsigned low = std::min(a, b);
    const unsigned high = std::max(a, b);
    const Node first = Corner(base, low);
    // Along every edge the upper corner has all axis bits of the lower one: 7 directions.
    const std::uint64_t key = static_cast<std::uint64_t>(Index(first)) * 8U + (high - low);
    const auto [entry, is_new] = edges_.try_emplace(key, 0);
    if (is_new) {
      entry->second = static_cast<int>(mesh_.vertices.size());
      const Vector3d point = Crossing(Position(first), Position(Corner(base, high)));
      mesh_.vertices.push_back((1e-3 * point).cast<float>());
    }
    return entry->second;
  }

  // Zero of the function between two nodes by bisection, kept off the nodes against slivers.
  static Vector3d Crossing(const Vector3d& a, const Vector3d& b) {
    const bool a_inside = FreeformMm(a) < 0.0;
    double low = 0.0;
    double high = 1.0;
    for (int i = 0; i < 10; ++i) {
      const double middle = 0.5 * (low + high);
      ((FreeformMm(a + middle * (b - a)) < 0.0) == a_inside ? low : high) = middle;
    }
    constexpr double kMargin = 0.02;
    const double t = std::clamp(0.5 * (low + high), kMargin, 1.0 - kMargin);
    return a + t * (b - a);
  }

  double step_mm_;
  Vector3d origin_;
  Node count_{};
  std::vector<double> values_;
  std::unordered_map<std::uint64_t, int> edges_;
  Mesh mesh_;
};

}  // namespace

Mesh MakeFreeform(double resolution_m) {
  if (!(resolution_m >= 1e-4 && resolution_m <= 5e-3)) {
    throw std::invalid_argument("MakeFreeform: resolution must be within [1e-4, 5e-3] m");
  }
  return TetrahedralMesher(1e3 * resolution_m).Run();
}

}  // namespace fringe_fusion::sim
