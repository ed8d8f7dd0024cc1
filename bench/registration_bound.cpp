#include "bench/registration_bound.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <mutex>
#include <random>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/registration/overlap_check.hpp"

namespace fringe_fusion::bench {
namespace {

using Row = Eigen::Matrix<double, 1, 6>;

constexpr double kMinCosine = 0.9;    // between the normals of a patch and of the pixel it falls on
constexpr double kMaxOffsetPx = 0.3;  // of a patch from that pixel's tangent plane

/// What one view measures of a patch.
struct Sight {
  int view = 0;
  double density = 0.0;  // pixels per area [1/m^2]
  double weight = 0.0;   // over the variance along the normal [1/m^4]
  Row row;               // motion of the patch along its normal by a right perturbation
};

// Nothing where the view does not measure the patch.
bool Look(const View& view, const PinholeGrid& grid, double sigma_m, const Eigen::Vector3d& point,
          const Eigen::Vector3d& normal, Sight& sight) {
  const Transform T_camera_object = view.pose.T_object_camera.inverse();
  const Eigen::Vector3d x = T_camera_object * point;
  const Eigen::Vector3d n = T_camera_object.linear() * normal;
  if (!(x.z() > 0.0)) return false;
  const Eigen::Vector2d pixel = grid.focal_px * x.head<2>() / x.z() + grid.middle_px;
  const auto col = static_cast<int>(std::lround(pixel.x()));
  const auto row = static_cast<int>(std::lround(pixel.y()));
  if (!view.range.points.Contains(col, row)) return false;
  const Eigen::Vector3d seen = view.range.points(col, row).cast<double>();
  const Eigen::Vector3d seen_normal = view.range.normals(col, row).cast<double>();
  const double footprint_m = x.z() / grid.focal_px;
  // NaN fails.
  if (!(seen_normal.dot(n) > kMinCosine)) return false;
  if (!(std::abs(seen_normal.dot(x - seen)) < kMaxOffsetPx * footprint_m)) return false;
  const double cosine = -n.dot(x.normalized());
  if (!(cosine > 0.05)) return false;
  const double axis = x.z() / x.norm();
  sight.density = cosine * std::pow(grid.focal_px / x.norm(), 2) / std::pow(axis, 3);
  sight.weight = sight.density / std::pow(sigma_m * cosine, 2);
  sight.row << x.cross(n).transpose(), n.transpose();
  return true;
}

void AddPatch(const std::vector<Sight>& sights, Eigen::MatrixXd& information) {
  double density = 0.0;
  double weight = 0.0;
  for (const Sight& sight : sights) {
    density += sight.density;
    weight += sight.weight;
  }
  // Every pixel of every view is a patch: together they count each area `density` times.
  for (const Sight& a : sights) {
    information.block<6, 6>(6 * a.view, 6 * a.view) +=
        a.weight / density * a.row.transpose() * a.row;
    for (const Sight& b : sights) {
      information.block<6, 6>(6 * a.view, 6 * b.view) -=
          a.weight * b.weight / (weight * density) * a.row.transpose() * b.row;
    }
  }
}

}  // namespace

Eigen::MatrixXd RegistrationInformation(const std::vector<View>& exact, const PinholeGrid& grid,
                                        double sigma_m) {
  const auto size = static_cast<Eigen::Index>(6 * exact.size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  std::mutex mutex;
  for (const View& view : exact) {
    const Transform& T = view.pose.T_object_camera;
    ParallelFor(view.range.height, 8, [&](int begin, int end) {
      Eigen::MatrixXd part = Eigen::MatrixXd::Zero(size, size);
      std::vector<Sight> sights;
      for (int y = begin; y < end; ++y) {
        for (int x = 0; x < view.range.width; ++x) {
          if (!IsValid(view.range, x, y)) continue;
          const Eigen::Vector3d point = T * view.range.points(x, y).cast<double>();
          const Eigen::Vector3d normal = T.linear() * view.range.normals(x, y).cast<double>();
          sights.clear();
          for (std::size_t k = 0; k < exact.size(); ++k) {
            Sight sight;
            sight.view = static_cast<int>(k);
            if (Look(exact[k], grid, sigma_m, point, normal, sight)) sights.push_back(sight);
          }
          if (sights.size() > 1) AddPatch(sights, part);
        }
      }
      const std::lock_guard<std::mutex> lock(mutex);
      information += part;
    });
  }
  return information;
}

double ExpectedMaxRms(const std::vector<View>& exact, const Eigen::MatrixXd& information,
                      int num_draws) {
  const Eigen::Index size = information.rows() - 6;  // the first view is held
  const Eigen::LLT<Eigen::MatrixXd> factor(information.bottomRightCorner(size, size));
  ViewGraph graph;
  std::vector<Transform> truth;
  for (const View& view : exact) {
    graph.views.push_back(view);
    truth.push_back(view.pose.T_object_camera);
  }
  std::mt19937 random(4711);
  std::normal_distribution<double> gauss;
  std::vector<double> values;
  for (int draw = 0; draw < num_draws; ++draw) {
    Eigen::VectorXd white(size);
    for (Eigen::Index k = 0; k < size; ++k) white[k] = gauss(random);
    const Eigen::VectorXd xi = factor.matrixU().solve(white);
    std::vector<Transform> poses = truth;
    for (std::size_t i = 1; i < poses.size(); ++i) {
      poses[i] = poses[i] * Exp(xi.segment<6>(static_cast<Eigen::Index>(6 * (i - 1))));
    }
    const auto compared = RigidAlign(graph, poses, truth);
    values.push_back(compared ? compared->max_rms_m : std::nan(""));
  }
  std::sort(values.begin(), values.end());
  return values.empty() ? std::nan("") : values[values.size() / 2];
}

}  // namespace fringe_fusion::bench
