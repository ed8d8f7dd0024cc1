#include "fringe_fusion/pose/view_pose.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>

#include "common/constants.hpp"
#include "common/dense.hpp"
#include "epipolar_solver.hpp"

namespace fringe_fusion {
namespace {

Status CheckPoints(const std::vector<LitPoint>& points, const EpipolarConfig& config) {
  if (points.size() < static_cast<std::size_t>(config.min_matches)) {
    return Fail("view pose: {} points, at least {} are needed", points.size(), config.min_matches);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    const LitPoint& p = points[i];
    if (!p.point_rig.allFinite() || !p.projector_px.allFinite() || !p.covariance_m2.allFinite() ||
        !(p.covariance_px2(0, 0) > 0.0) || !(p.covariance_px2.determinant() > 0.0)) {
      return Fail(
          "view pose: point {} has the position ({}, {}, {}) m, code ({}, {}) px and "
          "variance {} px^2",
          i, p.point_rig.x(), p.point_rig.y(), p.point_rig.z(), p.projector_px.x(),
          p.projector_px.y(), p.covariance_px2(0, 0));
    }
  }
  return {};
}

/// EPnP on at most 500 points with undistorted codes.
Result<Transform> Start(const std::vector<LitPoint>& points, const CameraModel& projector) {
  constexpr std::size_t kMaxPoints = 500;
  constexpr double kThresholdPx = 3.0;
  const std::size_t step = std::max<std::size_t>(1, points.size() / kMaxPoints);
  std::vector<cv::Point3d> object;
  std::vector<cv::Point2d> image;
  for (std::size_t i = 0; i < points.size(); i += step) {
    const Eigen::Vector2d ray = Undistort(projector, points[i].projector_px);
    if (!ray.allFinite()) continue;
    object.emplace_back(points[i].point_rig.x(), points[i].point_rig.y(), points[i].point_rig.z());
    image.emplace_back(ray.x(), ray.y());
  }
  cv::Mat rotation;
  cv::Mat translation;
  bool found = false;
  try {
    found = cv::solvePnPRansac(
        object, image, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotation, translation, false, 200,
        static_cast<float>(kThresholdPx / projector.fx), 0.999, cv::noArray(), cv::SOLVEPNP_EPNP);
  } catch (const cv::Exception&) {
    found = false;
  }
  if (!found) {
    return Fail("view pose: no pose puts the {} points on their projector pixels within {} px",
                points.size(), kThresholdPx);
  }
  Transform T = Transform::Identity();
  T.linear() =
      ExpRotation({rotation.at<double>(0), rotation.at<double>(1), rotation.at<double>(2)});
  T.translation() = Eigen::Vector3d(translation.at<double>(0), translation.at<double>(1),
                                    translation.at<double>(2));
  return T;
}

struct ViewSums {
  Matrix6d hessian = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  double cost = 0.0;
  double chi2 = 0.0;
  double sum_px2 = 0.0;
  int num_inliers = 0;
  std::vector<double> magnitudes;
};

/// @param reject_sigma points beyond have no weight.
ViewSums SumUp(const std::vector<LitPoint>& points, const CameraModel& projector,
               const Transform& T, double huber_sigma, double reject_sigma) {
  ViewSums sums;
  for (const LitPoint& p : points) {
    const Projection at = ProjectWithJacobian(projector, T * p.point_rig);
    const Eigen::Matrix<double, 2, 3> by_rig = at.jacobian * T.linear();
    const Eigen::Matrix2d sigma = p.covariance_px2 + by_rig * p.covariance_m2 * by_rig.transpose();
    const Eigen::Matrix2d whitener = Eigen::Matrix2d(sigma.llt().matrixL()).inverse();
    const Eigen::Vector2d residual = at.pixel - p.projector_px;
    const Eigen::Vector2d e = whitener * residual;
    const double magnitude = e.norm();
    if (!std::isfinite(magnitude)) {
      sums.cost = kInfinity;  // a point behind the projector
      return sums;
    }
    sums.magnitudes.push_back(magnitude);
    const double counted = std::min(magnitude, reject_sigma);
    const bool inside = magnitude <= huber_sigma;
    sums.cost +=
        inside ? magnitude * magnitude : 2.0 * huber_sigma * counted - huber_sigma * huber_sigma;
    if (!(magnitude <= reject_sigma)) continue;
    const double weight = inside ? 1.0 : huber_sigma / magnitude;
    Eigen::Matrix<double, 2, 6> J;
    J << -by_rig * Hat(p.point_rig), by_rig;
    J = whitener * J;
    sums.hessian += weight * J.transpose() * J;
    sums.gradient += weight * J.transpose() * e;
    sums.chi2 += magnitude * magnitude;
    sums.sum_px2 += residual.squaredNorm();
    ++sums.num_inliers;
  }
  return sums;
}

/// max(1, robust scale) of chi magnitudes with two degrees of freedom: their median is 1.1774.
double ScaleOf(std::vector<double> magnitudes) {
  return std::max(1.0, epipolar::MedianInPlace(magnitudes) / 1.1774);
}

}  // namespace

std::vector<LitPoint> MakeLitPoints(const RangeImage& range, const std::vector<Match>& matches) {
  std::vector<LitPoint> lit;
  for (const Match& match : matches) {
    const int x = static_cast<int>(std::lround(match.anchor_px.x()));
    const int y = static_cast<int>(std::lround(match.anchor_px.y()));
    if (!range.points.Contains(x, y) || !IsValid(range, x, y)) continue;
    LitPoint point;
    point.point_rig = range.points(x, y).cast<double>();
    const Eigen::Vector3d ray =
        DirectionToCamera(range.line_of_sight, range.points(x, y)).cast<double>();
    const double along = std::pow(static_cast<double>(range.sigma_range(x, y)), 2);
    const double across = std::pow(static_cast<double>(range.sigma_lateral(x, y)), 2);
    point.covariance_m2 =
        across * Eigen::Matrix3d::Identity() + (along - across) * ray * ray.transpose();
    point.projector_px = match.observed_px;
    point.covariance_px2 = match.covariance_px2;
    lit.push_back(point);
  }
  return lit;
}

Result<RigPose> EstimateViewPose(const std::vector<LitPoint>& points, const CameraModel& projector,
                                 const EpipolarConfig& config) {
  constexpr int kMaxIterations = 50;
  constexpr double kRejectSigma = 4.0;
  if (Status status = Validate(config); !status) return Forward(status);
  if (Status status = Validate(projector, "view pose: projector"); !status) return Forward(status);
  if (Status status = CheckPoints(points, config); !status) return Forward(status);
  const Result<Transform> start = Start(points, projector);
  if (!start) return Forward(start);
  Transform T = *start;
  double scale = 1.0;
  double reject = kInfinity;
  ViewSums sums = SumUp(points, projector, T, config.huber_sigma, reject);
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    scale = ScaleOf(sums.magnitudes);
    const Vector6d step = -dense::SolveSymmetric(sums.hessian, sums.gradient);
    if (!step.allFinite())
      return Fail("view pose: the system of {} points is singular", points.size());
    T = T * Exp(step);
    const bool settled = step.dot(sums.hessian * step) < 1e-8;
    // The rejection starts once the pose is near.
    if (iteration >= 3) reject = kRejectSigma * scale;
    sums = SumUp(points, projector, T, config.huber_sigma * scale, reject);
    if (!std::isfinite(sums.cost)) return Fail("view pose: points lie behind the projector");
    if (settled && iteration > 4) break;
  }
  const double ratio = static_cast<double>(sums.num_inliers) / static_cast<double>(points.size());
  if (!(ratio >= config.min_inlier_ratio)) {
    return Fail("view pose: only {:.0f} % of {} points fit one pose, limit {:.0f} %", 100.0 * ratio,
                points.size(), 100.0 * config.min_inlier_ratio);
  }
  const Vector6d diagonal = sums.hessian.diagonal().cwiseSqrt().cwiseInverse();
  const Matrix6d scaled = diagonal.asDiagonal() * sums.hessian * diagonal.asDiagonal();
  const Vector6d values = dense::SymmetricEigenvalues(scaled);
  const double condition = values[5] / values[0];
  if (!(condition > 0.0) || !(condition <= config.max_condition)) {
    return Fail("view pose: the points do not determine a pose (condition {:.2g}, limit {:.2g})",
                condition, config.max_condition);
  }
  RigPose out;
  out.T_projector_rig = T;
  out.num_points = static_cast<int>(points.size());
  out.num_inliers = sums.num_inliers;
  out.rms_px = std::sqrt(sums.sum_px2 / (2.0 * sums.num_inliers));
  out.reduced_chi2 = sums.chi2 / std::max(1, 2 * sums.num_inliers - 6);
  out.covariance = std::max(1.0, out.reduced_chi2) * dense::Invert(sums.hessian);
  return out;
}

}  // namespace fringe_fusion
