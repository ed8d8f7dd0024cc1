#include "fringe_fusion/calibration/error_field.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "cell_problem.hpp"
#include "common/constants.hpp"

namespace fringe_fusion {
namespace {

using Matrix43 = Eigen::Matrix<double, 4, 3>;
using Matrix4Parameters = Eigen::Matrix<double, 4, kNumCellParameters>;

/// An exact pixel, in numbers that can be inverted.
constexpr double kExactPx = 1e-5;

/// Four coordinates of a point, and what they depend on.
struct FourPixels {
  Eigen::Vector4d pixels = Eigen::Vector4d::Zero();
  Matrix43 by_point = Matrix43::Zero();
};

std::optional<FourPixels> Predict(const CellCalibration& cell,
                                  const Eigen::Vector3d& point_camera) {
  const Eigen::Vector3d point_projector = cell.T_projector_camera * point_camera;
  if (!(point_camera.z() > 0.0) || !(point_projector.z() > 0.0)) return std::nullopt;
  const Projection camera = ProjectWithJacobian(cell.camera, point_camera);
  const Projection projector = ProjectWithJacobian(cell.projector, point_projector);
  FourPixels out;
  out.pixels << camera.pixel, projector.pixel;
  out.by_point.topRows<2>() = camera.jacobian;
  out.by_point.bottomRows<2>() = projector.jacobian * cell.T_projector_camera.linear();
  return out;
}

Matrix4Parameters ByParameters(const CellCalibration& cell, const Eigen::Vector3d& point_camera,
                               const Matrix43& by_point) {
  const Eigen::Vector3d point_projector = cell.T_projector_camera * point_camera;
  constexpr int kModel = bundle::kNumModel;
  Matrix4Parameters J = Matrix4Parameters::Zero();
  J.block<2, kModel>(0, 0) =
      bundle::PixelByModel(cell.camera, point_camera.head<2>() / point_camera.z());
  J.block<2, kModel>(2, kModel) =
      bundle::PixelByModel(cell.projector, point_projector.head<2>() / point_projector.z());
  // T Exp(xi) moves the point of the camera frame before T.
  J.block<2, 3>(2, 2 * kModel) = -by_point.bottomRows<2>() * Hat(point_camera);
  J.block<2, 3>(2, 2 * kModel + 3) = by_point.bottomRows<2>();
  return J;
}

Eigen::Vector4d Weights(const MeasurementNoise& noise) {
  const double camera = std::max(noise.sigma_camera_px, kExactPx);
  const double projector = std::max(noise.sigma_projector_px, kExactPx);
  return Eigen::Vector4d(camera, camera, projector, projector).cwiseAbs2().cwiseInverse();
}

bool InImage(const CameraModel& model, const Eigen::Vector2d& pixel) {
  return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() <= model.width - 0.5 &&
         pixel.y() <= model.height - 0.5;
}

/// Least squares inverse: 3 x 4 that takes pixel steps to steps of the point.
std::optional<Eigen::Matrix<double, 3, 4>> PointByPixels(const Matrix43& by_point,
                                                         const Eigen::Vector4d& weights) {
  const Eigen::Matrix3d normal = by_point.transpose() * weights.asDiagonal() * by_point;
  const Eigen::LDLT<Eigen::Matrix3d> factor(normal);
  if (factor.info() != Eigen::Success) return std::nullopt;
  const Eigen::Matrix<double, 3, 4> right = by_point.transpose() * weights.asDiagonal();
  const Eigen::Matrix<double, 3, 4> inverse = factor.solve(right);
  if (!inverse.allFinite()) return std::nullopt;
  return inverse;
}

}  // namespace

std::optional<Eigen::Matrix<double, 3, kNumCellParameters>> PointByParameters(
    const CellCalibration& calibration, const Eigen::Vector3d& point_camera,
    const MeasurementNoise& noise) {
  const auto predicted = Predict(calibration, point_camera);
  if (!predicted) return std::nullopt;
  const auto inverse = PointByPixels(predicted->by_point, Weights(noise));
  if (!inverse) return std::nullopt;
  return Eigen::Matrix<double, 3, kNumCellParameters>(
      -*inverse * ByParameters(calibration, point_camera, predicted->by_point));
}

std::optional<PointError> PredictPointError(const CellCalibration& calibration,
                                            const CellCovariance& covariance,
                                            const Eigen::Vector3d& point_camera,
                                            const MeasurementNoise& noise) {
  const auto predicted = Predict(calibration, point_camera);
  if (!predicted || !InImage(calibration.camera, predicted->pixels.head<2>()) ||
      !InImage(calibration.projector, predicted->pixels.tail<2>())) {
    return std::nullopt;
  }
  const auto inverse = PointByPixels(predicted->by_point, Weights(noise));
  if (!inverse) return std::nullopt;
  const Eigen::Matrix<double, 3, kNumCellParameters> by_parameters =
      -*inverse * ByParameters(calibration, point_camera, predicted->by_point);
  const Eigen::Vector4d variances(noise.sigma_camera_px * noise.sigma_camera_px,
                                  noise.sigma_camera_px * noise.sigma_camera_px,
                                  noise.sigma_projector_px * noise.sigma_projector_px,
                                  noise.sigma_projector_px * noise.sigma_projector_px);
  PointError error;
  error.calibration = by_parameters * covariance * by_parameters.transpose();
  error.random = *inverse * variances.asDiagonal() * inverse->transpose();
  return error;
}

std::optional<Eigen::Vector3d> TriangulatePixels(const CellCalibration& calibration,
                                                 const Eigen::Vector2d& pixel_camera,
                                                 const Eigen::Vector2d& pixel_projector,
                                                 const MeasurementNoise& noise) {
  const Eigen::Vector2d camera = Undistort(calibration.camera, pixel_camera);
  const Eigen::Vector2d projector = Undistort(calibration.projector, pixel_projector);
  if (!camera.allFinite() || !projector.allFinite()) return std::nullopt;
  // Start: the point of the camera's ray that is nearest to the projector's.
  const Transform T_camera_projector = calibration.T_projector_camera.inverse();
  const Eigen::Vector3d a = camera.homogeneous();
  const Eigen::Vector3d b = T_camera_projector.linear() * projector.homogeneous();
  const Eigen::Vector3d n = b.cross(a.cross(b));
  const double depth = n.dot(T_camera_projector.translation()) / n.dot(a);
  if (!(depth > 0.0)) return std::nullopt;
  Eigen::Vector3d point = depth * a;
  Eigen::Vector4d measured;
  measured << pixel_camera, pixel_projector;
  for (int iteration = 0; iteration < 5; ++iteration) {
    const auto predicted = Predict(calibration, point);
    if (!predicted) return std::nullopt;
    const auto inverse = PointByPixels(predicted->by_point, Weights(noise));
    if (!inverse) return std::nullopt;
    point += *inverse * (measured - predicted->pixels);
  }
  if (!point.allFinite() || !(point.z() > 0.0)) return std::nullopt;
  return point;
}

Eigen::Vector3d ErrorField::Point(int x, int y, int z) const {
  const Eigen::Vector3d steps = (num - Eigen::Vector3i::Ones()).cwiseMax(1).cast<double>();
  Eigen::Vector3d at = Eigen::Vector3d(x, y, z).cwiseQuotient(steps);
  for (int axis = 0; axis < 3; ++axis) {
    if (num[axis] == 1) at[axis] = 0.5;
  }
  return volume.low + at.cwiseProduct(volume.high - volume.low);
}

const std::optional<PointError>& ErrorField::At(int x, int y, int z) const {
  return errors[static_cast<std::size_t>((z * num.y() + y) * num.x() + x)];
}

Eigen::Vector3d ErrorField::RmsCalibration() const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0.0;
  for (const auto& error : errors) {
    if (!error) continue;
    sum += error->calibration.diagonal();
    count += 1.0;
  }
  if (count == 0.0) return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  return (sum / count).cwiseSqrt();
}

ErrorField PredictErrorField(const CellCalibration& calibration, const CellCovariance& covariance,
                             const Volume& volume, const Eigen::Vector3i& num,
                             const MeasurementNoise& noise) {
  if (num.minCoeff() < 1) throw std::invalid_argument("PredictErrorField: no points on an axis");
  ErrorField field;
  field.volume = volume;
  field.num = num;
  for (int z = 0; z < num.z(); ++z) {
    for (int y = 0; y < num.y(); ++y) {
      for (int x = 0; x < num.x(); ++x) {
        field.errors.push_back(
            PredictPointError(calibration, covariance, field.Point(x, y, z), noise));
      }
    }
  }
  return field;
}

Volume CalibratedVolume(const CellCalibrationResult& result) {
  Volume volume{Eigen::Vector3d::Constant(kInfinity), Eigen::Vector3d::Constant(-kInfinity)};
  for (const CellResidual& residual : result.residuals) {
    if (residual.in_projector) continue;
    const auto i = static_cast<std::size_t>(residual.sighting);
    const Eigen::Vector3d point =
        result.poses[i].T_camera_target *
        (result.target_points[static_cast<std::size_t>(residual.point)] + result.stage_shifts_m[i]);
    volume.low = volume.low.cwiseMin(point);
    volume.high = volume.high.cwiseMax(point);
  }
  return volume;
}

}  // namespace fringe_fusion
