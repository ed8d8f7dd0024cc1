#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/constants.hpp"
#include "depth_step.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion {
namespace {

using triangulation::DepthStep;

constexpr int kNormalRowsPerChunk = 16;
constexpr int kMaxGrowth = 4;  // of the window of a sparse cloud

/// Coordinates about one pixel in which a plane is linear: height = a p + b q + c.
/// Camera: p, q = X / Z, Y / Z and height = 1 / Z in a frame whose z axis is the pixel's own ray.
/// Directional: p, q, height = X, Y, Z with z towards the sensor.
class LocalChart {
 public:
  LocalChart(const LineOfSight& line_of_sight, const Eigen::Vector3f& point)
      : directional_(line_of_sight.directional) {
    to_camera_ = DirectionToCamera(line_of_sight, point);
    axis_p_ = to_camera_.unitOrthogonal();
    axis_q_ = to_camera_.cross(axis_p_);
    origin_ = directional_ ? point : line_of_sight.camera;
    distance_ = directional_ ? 1.0F : (line_of_sight.camera - point).norm();
  }

  /// (p, q, height - height of the pixel itself), all scaled to the pixel's own distance.
  [[nodiscard]] Eigen::Vector3f Coordinates(const Eigen::Vector3f& point) const {
    const Eigen::Vector3f offset = point - origin_;
    const float p = offset.dot(axis_p_);
    const float q = offset.dot(axis_q_);
    const float along = offset.dot(to_camera_);
    if (directional_) return {p, q, along};
    // `along` is minus the depth; distance / depth is 1 at the pixel itself.
    const float inverse = -distance_ / along;
    return {p * inverse, q * inverse, distance_ * (inverse - 1.0F)};
  }

  /// Unit normal towards the camera of the plane height = slope_p p + slope_q q + height.
  /// Camera: n . X = 1 has n = (slope_p, slope_q, 1 + height / distance) / distance in the frame
  /// (p, q, ray), so the normal towards the camera is -n.
  [[nodiscard]] Eigen::Vector3f Normal(const Eigen::Vector3f& plane) const {
    const float towards = directional_ ? 1.0F : 1.0F + plane[2] / distance_;
    return (towards * to_camera_ - plane[0] * axis_p_ - plane[1] * axis_q_).normalized();
  }

  [[nodiscard]] const Eigen::Vector3f& to_camera() const { return to_camera_; }

 private:
  bool directional_ = false;
  float distance_ = 1.0F;
  Eigen::Vector3f to_camera_;
  Eigen::Vector3f axis_p_;
  Eigen::Vector3f axis_q_;
  Eigen::Vector3f origin_;
};

class NormalFit {
 public:
  NormalFit(const RangeImage& range, const TriangulationConfig& config)
      : range_(range),
        radius_(config.normal_radius_px),
        min_neighbors_(config.min_neighbors),
        min_cosine_(static_cast<float>(std::cos(config.max_normal_angle_deg * M_PI / 180.0))),
        step_(range, config) {}

  /// NaN where the neighbourhood is too thin or the plane too oblique.
  [[nodiscard]] Eigen::Vector3f Fit(int x, int y) const {
    const Eigen::Vector3f nothing = Eigen::Vector3f::Constant(kNan);
    const Eigen::Vector3f point = range_.points(x, y);
    if (!point.allFinite()) return nothing;
    const LocalChart chart(range_.line_of_sight, point);
    Sums sums = SumWindow(chart, x, y, radius_);
    // A sparse cloud (one point per projector cell) has few points in a window that is wide enough
    // for a dense one. The border of a dense one is thin for another reason and stays so.
    for (int growth = 2; growth <= kMaxGrowth && sums.num_valid < 2 * min_neighbors_; growth *= 2) {
      sums = SumWindow(chart, x, y, growth * radius_);
    }
    if (sums.num_connected - 1 < min_neighbors_) return nothing;
    const Eigen::Vector3f plane = Solve(sums);
    const Eigen::Vector3f normal = chart.Normal(plane);
    if (!(normal.dot(chart.to_camera()) >= min_cosine_)) return nothing;
    return normal;
  }

 private:
  struct Sums {
    Eigen::Matrix3f normal_matrix = Eigen::Matrix3f::Zero();
    Eigen::Vector3f right = Eigen::Vector3f::Zero();
    float scale = 0.0F;  // largest squared distance (p, q) of a point
    int num_valid = 0;
    int num_connected = 0;
  };

  [[nodiscard]] Sums SumWindow(const LocalChart& chart, int x, int y, int radius) const {
    Sums sums;
    for (int j = std::max(0, y - radius); j <= std::min(range_.height - 1, y + radius); ++j) {
      for (int i = std::max(0, x - radius); i <= std::min(range_.width - 1, x + radius); ++i) {
        if (!IsValid(range_, i, j)) continue;
        ++sums.num_valid;
        if (!step_.Connects(x, y, i, j, chart.to_camera())) continue;
        ++sums.num_connected;
        const Eigen::Vector3f at = chart.Coordinates(range_.points(i, j));
        const Eigen::Vector3f row(at.x(), at.y(), 1.0F);
        const float weight = Weight(x, y, i, j);
        sums.normal_matrix += weight * row * row.transpose();
        sums.right += weight * at.z() * row;
        sums.scale = std::max(sums.scale, at.head<2>().squaredNorm());
      }
    }
    return sums;
  }

  // Inverse variance relative to the pixel itself, so that float sums stay near 1.
  [[nodiscard]] float Weight(int x, int y, int i, int j) const {
    const float ratio = range_.sigma_range(x, y) / range_.sigma_range(i, j);
    return std::isfinite(ratio) ? ratio * ratio : 1.0F;
  }

  // Solves in units of the window size; NaN when the points lie on a line.
  [[nodiscard]] static Eigen::Vector3f Solve(const Sums& sums) {
    const double unit = std::sqrt(static_cast<double>(sums.scale));
    const Eigen::Vector3d units(1.0 / unit, 1.0 / unit, 1.0);
    const Eigen::Matrix3d scaled =
        units.asDiagonal() * sums.normal_matrix.cast<double>() * units.asDiagonal();
    Eigen::Matrix3d inverse;
    bool invertible = false;
    const double size = scaled(2, 2);
    (scaled / size).eval().computeInverseWithCheck(inverse, invertible, 1e-3);
    if (!invertible) return Eigen::Vector3f::Constant(kNan);
    const Eigen::Vector3d plane =
        units.asDiagonal() * (inverse * (units.asDiagonal() * sums.right.cast<double>())) / size;
    return plane.cast<float>();
  }

  const RangeImage& range_;
  int radius_;
  int min_neighbors_;
  float min_cosine_;
  DepthStep step_;
};

}  // namespace

RangeImage EstimateNormals(const RangeImage& range, const TriangulationConfig& config) {
  RangeImage out = range;
  const NormalFit fit(range, config);
  ParallelFor(range.height, kNormalRowsPerChunk, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < range.width; ++x) {
        out.normals(x, y) = fit.Fit(x, y);
        if (out.normals(x, y).allFinite()) continue;
        out.points(x, y).setConstant(kNan);
        out.sigma_range(x, y) = kNan;
        out.sigma_lateral(x, y) = kNan;
      }
    }
  });
  return out;
}

}  // namespace fringe_fusion
