#include "panel_scale.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace fringe_fusion::diagnosis {
namespace {

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& t) {
  Eigen::Matrix3d cross;
  cross << 0.0, -t.z(), t.y(), t.z(), 0.0, -t.x(), -t.y(), t.x(), 0.0;
  return cross;
}

double MedianAbs(std::vector<double> values) {
  if (values.empty()) return 0.0;
  for (double& value : values) value = std::abs(value);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Signed distances to the epipolar lines in the undistorted picture [px] at one scale.
std::vector<double> EpipolarDistances(const std::vector<CodedPixel>& pixels,
                                      const CellCalibration& calibration, double scale) {
  const Eigen::Matrix3d essential = CrossMatrix(calibration.T_projector_camera.translation()) *
                                    calibration.T_projector_camera.linear();
  std::vector<double> distances;
  for (const CodedPixel& p : pixels) {
    const Eigen::Vector3d line =
        essential * Undistort(calibration.camera, Eigen::Vector2d(p.x, p.y)).homogeneous();
    const Eigen::Vector2d panel(scale * (p.u + 0.5) - 0.5, scale * (p.v + 0.5) - 0.5);
    const Eigen::Vector2d ray = Undistort(calibration.projector, panel);
    const double distance =
        calibration.projector.fx * line.dot(ray.homogeneous()) / line.head<2>().norm();
    if (std::isfinite(distance)) distances.push_back(distance);
  }
  return distances;
}

}  // namespace

PanelScale FitPanelScale(const std::vector<CodedPixel>& pixels,
                         const CellCalibration& calibration) {
  const auto cost = [&](double scale) {
    return MedianAbs(EpipolarDistances(pixels, calibration, scale));
  };
  PanelScale best;
  best.distance_px = cost(1.0);
  best.scaled_px = best.distance_px;
  // The cost has one valley per epipolar geometry, but medians are rough: scan, then refine.
  double step = 0.02;
  double middle = 1.0;
  for (int round = 0; round < 4; ++round) {
    const int reach = round == 0 ? 25 : 10;
    for (int k = -reach; k <= reach; ++k) {
      const double scale = middle + k * step;
      const double value = cost(scale);
      if (value < best.scaled_px) {
        best.scaled_px = value;
        best.scale = scale;
      }
    }
    middle = best.scale;
    step /= 10.0;
  }
  return best;
}

}  // namespace fringe_fusion::diagnosis
