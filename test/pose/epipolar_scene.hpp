#pragma once

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "fringe_fusion/pose/relative_pose.hpp"

namespace fringe_fusion::testing {

/// A scanner of 12 degrees convergence before a relief; lens distortion on both devices.
struct EpipolarScene {
  DevicePair devices;
  Transform T_projector_camera = Transform::Identity();
  /// Depth along z of the surface on the camera ray (x, y, 1) [m].
  std::function<double(const Eigen::Vector2d&)> depth;
};

/// Projector at `centre_camera` whose axis passes the point `target_camera`, then turned about its
/// own axes by `turn_rad`.
inline Transform LookFrom(const Eigen::Vector3d& centre_camera,
                          const Eigen::Vector3d& target_camera, const Eigen::Vector3d& turn_rad) {
  const Eigen::Vector3d z = (target_camera - centre_camera).normalized();
  const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(z).normalized();
  Transform T_camera_projector = Transform::Identity();
  T_camera_projector.linear() << x, z.cross(x), z;
  T_camera_projector.linear() *= ExpRotation(turn_rad);
  T_camera_projector.translation() = centre_camera;
  return T_camera_projector.inverse();
}

/// Bumps of `relief_m` peak to peak on a plane 0.7 m away; 0: the plane itself.
inline std::function<double(const Eigen::Vector2d&)> Relief(double relief_m) {
  return [relief_m](const Eigen::Vector2d& ray) {
    const double wave = std::sin(41.0 * ray.x() + 0.3) * std::cos(37.0 * ray.y() - 0.4) +
                        0.5 * std::sin(23.0 * (ray.x() + ray.y()));
    return 0.7 / (1.0 - 0.1 * ray.x() + 0.05 * ray.y()) + relief_m / 3.0 * wave;
  };
}

inline EpipolarScene MakeEpipolarScene(double relief_m = 0.035) {
  EpipolarScene scene;
  scene.devices.anchor = {
      2448, 2048, 5600.0, 5600.0, 1223.5, 1023.5, {-0.1, 0.1, 5e-4, -3e-4, 0.0}};
  scene.devices.observed = {
      1280, 800, 2400.0, 2400.0, 639.5, 399.5, {-0.05, 0.05, -3e-4, 2e-4, 0.0}};
  scene.T_projector_camera = LookFrom({0.22, 0.01, 0.02}, {0.0, 0.0, 0.7}, {0.05, 0.01, 0.03});
  scene.depth = Relief(relief_m);
  return scene;
}

/// The projector looks up by `pitch_deg` out of the plane of the camera's axis and the baseline.
inline EpipolarScene PitchedScene(double pitch_deg, double relief_m = 0.035) {
  EpipolarScene scene = MakeEpipolarScene(relief_m);
  scene.T_projector_camera =
      LookFrom({0.22, 0.0, 0.0}, {0.0, 0.0, 0.7}, {pitch_deg * M_PI / 180.0, 0.0, 0.0});
  return scene;
}

/// Standard deviations (sigma_u, sigma_v) of match number i [px].
using SigmaOf = std::function<Eigen::Vector2d(int i)>;
inline SigmaOf SameSigma(double sigma_px) {
  return [sigma_px](int /*i*/) { return Eigen::Vector2d::Constant(sigma_px); };
}

/// Matches on a grid of `columns` x `rows` camera pixels with Gaussian noise on the projector side;
/// pixels whose point the projector does not cover are left out.
inline std::vector<Match> MakeMatches(const EpipolarScene& scene, int columns, int rows,
                                      const SigmaOf& sigma_px, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> unit;
  const CameraModel& camera = scene.devices.anchor;
  const CameraModel& projector = scene.devices.observed;
  std::vector<Match> matches;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      Match match;
      match.anchor_px = {std::round((column + 0.5) * camera.width / columns),
                         std::round((row + 0.5) * camera.height / rows)};
      const Eigen::Vector2d ray = Undistort(camera, match.anchor_px);
      const Eigen::Vector3d point = scene.depth(ray) * ray.homogeneous();
      const Eigen::Vector2d pixel = Project(projector, scene.T_projector_camera * point);
      if (!(pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() <= projector.width - 1.0 &&
            pixel.y() <= projector.height - 1.0)) {
        continue;
      }
      const Eigen::Vector2d sigma = sigma_px(static_cast<int>(matches.size()));
      match.observed_px =
          pixel + Eigen::Vector2d(sigma.x() * unit(engine), sigma.y() * unit(engine));
      match.covariance_px2 = sigma.cwiseAbs2().asDiagonal();
      matches.push_back(match);
    }
  }
  return matches;
}

/// Fisher information of (omega, d) at the truth by central differences of the whitened residual:
/// independent of the derivatives of the solver.
inline Matrix5d NumericInformation(const EpipolarScene& scene, const std::vector<Match>& matches) {
  const Eigen::Matrix3d R = scene.T_projector_camera.linear();
  const Eigen::Vector3d t = scene.T_projector_camera.translation().normalized();
  const Matrix32d basis = TangentBasis(t);
  const auto moved = [&](int k, double h) {
    Transform T = Transform::Identity();
    Eigen::Matrix<double, 5, 1> step = Eigen::Matrix<double, 5, 1>::Zero();
    step[k] = h;
    T.linear() = R * ExpRotation(step.head<3>());
    T.translation() = (t + basis * step.tail<2>()).normalized();
    return T;
  };
  constexpr double kStep = 1e-6;
  Matrix5d information = Matrix5d::Zero();
  for (const Match& match : matches) {
    Eigen::Matrix<double, 5, 1> jacobian;
    for (int k = 0; k < 5; ++k) {
      const EpipolarResidual high = ResidualOf(match, scene.devices, moved(k, kStep));
      const EpipolarResidual low = ResidualOf(match, scene.devices, moved(k, -kStep));
      jacobian[k] = (high.distance_px / high.sigma - low.distance_px / low.sigma) / (2.0 * kStep);
    }
    information += jacobian * jacobian.transpose();
  }
  return information;
}

/// Error of an estimate as the perturbation (omega, d) of the estimate that gives the truth.
inline Eigen::Matrix<double, 5, 1> PoseError(const Transform& T_estimate,
                                             const Transform& T_truth) {
  Eigen::Matrix<double, 5, 1> error;
  error.head<3>() = LogRotation(T_estimate.linear().transpose() * T_truth.linear());
  error.tail<2>() = TangentBasis(T_estimate.translation().normalized()).transpose() *
                    T_truth.translation().normalized();
  return error;
}

/// Result of many runs with fresh noise.
struct MonteCarlo {
  int runs = 0;
  int failures = 0;
  double error_ratio = 0.0;  ///< rms error over the Cramer-Rao bound, all components whitened alike
  double nees = 0.0;         ///< mean of error^T covariance^-1 error / 5
};

/// The ratio is sqrt(mean(error^T information error) / 5): every direction counts alike.
inline MonteCarlo RunMonteCarlo(const EpipolarScene& scene, int grid, const SigmaOf& sigma_px,
                                int runs, const EpipolarConfig& config) {
  const Matrix5d information = NumericInformation(scene, [&] {
    std::vector<Match> clean = MakeMatches(scene, grid, grid, SameSigma(1e-9), 0);
    for (std::size_t i = 0; i < clean.size(); ++i) {
      clean[i].covariance_px2 = sigma_px(static_cast<int>(i)).cwiseAbs2().asDiagonal();
    }
    return clean;
  }());
  MonteCarlo out;
  for (int run = 0; run < runs; ++run) {
    const auto matches =
        MakeMatches(scene, grid, grid, sigma_px, 1000U + static_cast<unsigned>(run));
    const auto pose = EstimateRelativePose(matches, scene.devices, config);
    if (!pose) {
      ++out.failures;
      continue;
    }
    ++out.runs;
    const auto error = PoseError(pose->T_observed_anchor, scene.T_projector_camera);
    out.error_ratio += error.dot(information * error) / 5.0;
    out.nees += error.dot(pose->covariance.ldlt().solve(error)) / 5.0;
  }
  out.error_ratio = std::sqrt(out.error_ratio / out.runs);
  out.nees /= out.runs;
  return out;
}

}  // namespace fringe_fusion::testing
