#include "zhang.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "common/dense.hpp"
#include "common/median.hpp"

namespace fringe_fusion::bundle {
namespace {

constexpr int kRobustPasses = 8;

/// Moves points to their centre and to mean distance sqrt(2).
Eigen::Matrix3d Normalization(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  double distance = 0.0;
  for (const Eigen::Vector2d& p : points) distance += (p - mean).norm();
  const double scale =
      std::sqrt(2.0) * static_cast<double>(points.size()) / std::max(distance, 1e-300);
  Eigen::Matrix3d N = Eigen::Matrix3d::Zero();
  N.diagonal() << scale, scale, 1.0;
  N.topRightCorner<2, 1>() = -scale * mean;
  return N;
}

/// Smallest eigenvector of the weighted DLT equations; nothing when it is not unique.
std::optional<Eigen::Matrix3d> Dlt(const PlanarView& view, const Eigen::Matrix3d& from,
                                   const Eigen::Matrix3d& to, const std::vector<double>& weights) {
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  for (std::size_t i = 0; i < view.pixel.size(); ++i) {
    const Eigen::Vector3d p = from * view.plane_m[i].homogeneous();
    const Eigen::Vector3d q = to * view.pixel[i].homogeneous();
    Eigen::Matrix<double, 2, 9> rows;
    rows << p.transpose(), Eigen::RowVector3d::Zero(), -q.x() * p.transpose(),
        Eigen::RowVector3d::Zero(), p.transpose(), -q.y() * p.transpose();
    normal += weights[i] * rows.transpose() * rows;
  }
  const dense::SymmetricEigen eigen = dense::DecomposeSymmetric(normal);
  if (!(eigen.values[1] > 1e-9 * eigen.values[8])) return std::nullopt;
  const Eigen::Matrix<double, 9, 1> h = eigen.vectors.col(0);
  Eigen::Matrix3d H;
  H << h.head<3>().transpose(), h.segment<3>(3).transpose(), h.tail<3>().transpose();
  return Eigen::Matrix3d(to.inverse() * H * from);
}

std::vector<double> Residuals(const PlanarView& view, const Eigen::Matrix3d& H) {
  std::vector<double> residuals;
  residuals.reserve(view.pixel.size());
  for (std::size_t i = 0; i < view.pixel.size(); ++i) {
    const Eigen::Vector3d q = H * view.plane_m[i].homogeneous();
    residuals.push_back((q.hnormalized() - view.pixel[i]).norm());
  }
  return residuals;
}

/// Zhang's v_ij without skew: coefficients of b = (B11, B22, B13, B23, B33).
Eigen::Matrix<double, 1, 5> Constraint(const Eigen::Matrix3d& H, int i, int j) {
  Eigen::Matrix<double, 1, 5> v;
  v << H(0, i) * H(0, j), H(1, i) * H(1, j), H(2, i) * H(0, j) + H(0, i) * H(2, j),
      H(2, i) * H(1, j) + H(1, i) * H(2, j), H(2, i) * H(2, j);
  return v;
}

CameraModel MakeModel(int width, int height, const Eigen::Vector2d& focal,
                      const Eigen::Vector2d& principal) {
  CameraModel model;
  model.width = width;
  model.height = height;
  model.fx = focal.x();
  model.fy = focal.y();
  model.cx = principal.x();
  model.cy = principal.y();
  return model;
}

/// The image of the absolute conic with a free principal point, in scaled pixels.
std::optional<CameraModel> FreePrincipal(const Eigen::MatrixXd& constraints, double scale,
                                         const Eigen::Vector2d& centre, int width, int height) {
  const Eigen::VectorXd b = dense::DecomposeSingular(constraints).V.col(4);
  const double x0 = -b[2] / b[0];
  const double y0 = -b[3] / b[1];
  const double lambda = b[4] - b[2] * b[2] / b[0] - b[3] * b[3] / b[1];
  const double fx2 = lambda / b[0];
  const double fy2 = lambda / b[1];
  if (!(fx2 > 0.0) || !(fy2 > 0.0) || !std::isfinite(x0 + y0 + fx2 + fy2)) return std::nullopt;
  return MakeModel(width, height, Eigen::Vector2d(std::sqrt(fx2), std::sqrt(fy2)) / scale,
                   Eigen::Vector2d(x0, y0) / scale + centre);
}

}  // namespace

std::optional<PlanarHomography> FitHomography(const PlanarView& view) {
  if (view.pixel.size() < 4) return std::nullopt;
  const Eigen::Matrix3d from = Normalization(view.plane_m);
  const Eigen::Matrix3d to = Normalization(view.pixel);
  std::vector<double> weights(view.pixel.size(), 1.0);
  PlanarHomography best;
  for (int pass = 0; pass < kRobustPasses; ++pass) {
    const auto H = Dlt(view, from, to, weights);
    if (!H || !H->allFinite()) return std::nullopt;
    best.H = *H / H->norm();
    const std::vector<double> residuals = Residuals(view, best.H);
    best.median_residual_px = Median(residuals);
    const double scale = 3.0 * best.median_residual_px + 1e-9;
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      weights[i] = 1.0 / (1.0 + std::pow(residuals[i] / scale, 2));
    }
  }
  // Sign by the points before the device: the third coordinate is proportional to their depth.
  double depth = 0.0;
  for (const Eigen::Vector2d& p : view.plane_m) depth += (best.H * p.homogeneous()).z();
  if (depth < 0.0) best.H = -best.H;
  best.mirrored = best.H.determinant() < 0.0;
  return best;
}

std::optional<CameraModel> ZhangIntrinsics(const std::vector<Eigen::Matrix3d>& homographies,
                                           int width, int height,
                                           const std::optional<Eigen::Vector2d>& principal) {
  // Pixels of order one, about the principal point or the middle.
  const double scale = 1.0 / std::max(width, height);
  const Eigen::Vector2d origin =
      principal ? *principal : Eigen::Vector2d(0.5 * (width - 1), 0.5 * (height - 1));
  Eigen::Matrix3d N = Eigen::Matrix3d::Identity();
  N.diagonal() << scale, scale, 1.0;
  N.topRightCorner<2, 1>() = -scale * origin;
  Eigen::MatrixXd constraints(2 * static_cast<Eigen::Index>(homographies.size()), 5);
  for (std::size_t k = 0; k < homographies.size(); ++k) {
    Eigen::Matrix3d H = N * homographies[k];
    // Columns r1 and r2 have the same length: what is left is the scale of the view.
    H /= std::sqrt(0.5 * (H.col(0).squaredNorm() + H.col(1).squaredNorm()));
    const Eigen::Index row = 2 * static_cast<Eigen::Index>(k);
    constraints.row(row) = Constraint(H, 0, 1);
    constraints.row(row + 1) = Constraint(H, 0, 0) - Constraint(H, 1, 1);
  }
  if (!principal) return FreePrincipal(constraints, scale, origin, width, height);
  // B13 = B23 = 0; with B33 = 1: 1/fx^2, 1/fy^2 by least squares.
  Eigen::MatrixXd A = constraints.leftCols<2>();
  const Eigen::VectorXd right = -constraints.col(4);
  Eigen::Vector2d b = dense::LeastSquares(A, right);
  if (!(b.minCoeff() > 0.0)) {
    // One focal length for both axes is better determined.
    const Eigen::VectorXd sum = A.rowwise().sum();
    b.setConstant(sum.dot(right) / sum.squaredNorm());
  }
  if (!(b.minCoeff() > 0.0) || !b.allFinite()) return std::nullopt;
  return MakeModel(width, height, b.cwiseSqrt().cwiseInverse() / scale, origin);
}

Transform PlanePose(const Eigen::Matrix3d& H, const CameraModel& model) {
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  K << model.fx, 0.0, model.cx, 0.0, model.fy, model.cy, 0.0, 0.0, 1.0;
  Eigen::Matrix3d M = K.inverse() * H;
  M /= 0.5 * (M.col(0).norm() + M.col(1).norm());
  if (M(2, 2) < 0.0) M = -M;
  Eigen::Matrix3d R;
  R << M.col(0), M.col(1), M.col(0).cross(M.col(1));
  const dense::SingularValues svd = dense::DecomposeSingular(R);
  const Eigen::Matrix3d U = svd.U;
  const Eigen::Matrix3d V = svd.V;
  Eigen::Matrix3d sign = Eigen::Matrix3d::Identity();
  sign(2, 2) = (U * V.transpose()).determinant();
  Transform T = Transform::Identity();
  T.linear() = U * sign * V.transpose();
  T.translation() = M.col(2);
  return T;
}

}  // namespace fringe_fusion::bundle
