#include "fringe_fusion/registration/weak_directions.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "common/dense.hpp"

namespace fringe_fusion {
namespace {

constexpr double kWeakInformation = 1e-4;  // of the strongest direction
// Smallest singular value of unit twists that is a turn, and largest that is none.
constexpr double kTurn = 0.3;

// Point p with v = w x (middle - p) for all columns, nearest to the middle.
Eigen::Vector3d CenterOf(const Eigen::MatrixXd& turns, const Eigen::MatrixXd& shifts,
                         const Eigen::Vector3d& middle) {
  // v = -w x q = q x w with q = p - middle.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Identity() * 1e-9;
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (Eigen::Index k = 0; k < turns.cols(); ++k) {
    const Eigen::Matrix3d H = Hat(turns.col(k));
    normal += H.transpose() * H;
    right += H.transpose() * -shifts.col(k);
  }
  return middle + Eigen::Vector3d(dense::SolveSymmetric(normal, right));
}

std::string Text(const Eigen::Vector3d& v, double scale, int digits) {
  return fmt::format("({:.{}f}, {:.{}f}, {:.{}f})", scale * v.x(), digits, scale * v.y(), digits,
                     scale * v.z(), digits);
}

}  // namespace

Matrix6d SurfaceInformation(const std::vector<PairInformation>& pairs, int view) {
  Matrix6d sum = Matrix6d::Zero();
  for (const PairInformation& pair : pairs) {
    if (pair.first == view || pair.second == view) {
      sum += pair.S.transpose() * pair.information * pair.S;
    }
  }
  return sum;
}

WeakDirections FindWeakDirections(const Matrix6d& information, const Eigen::Vector3d& middle,
                                  double radius_m) {
  WeakDirections weak;
  // y = (r w, v at the middle); twist (w, v0) = B y.
  const double radius = std::max(radius_m, 1e-9);
  Matrix6d B = Matrix6d::Zero();
  B.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() / radius;
  B.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity();
  B.bottomLeftCorner<3, 3>() = Hat(middle) / radius;
  const dense::SymmetricEigen eigen = dense::DecomposeSymmetric(B.transpose() * information * B);
  const Vector6d values = eigen.values;
  if (!(values[5] > 0.0)) return weak;
  while (weak.count < 6 && values[weak.count] < kWeakInformation * values[5]) ++weak.count;
  if (weak.count == 0) return weak;
  const Eigen::MatrixXd twists = eigen.vectors.leftCols(weak.count);
  const dense::SingularValues svd = dense::DecomposeSingular(twists.topRows(3));
  const int num_turns = static_cast<int>((svd.values.array() > kTurn).count());
  const Eigen::MatrixXd sorted = dense::Product(twists, svd.V);
  const Eigen::MatrixXd turns = sorted.topLeftCorner(3, num_turns) / radius;
  const Eigen::MatrixXd shifts = sorted.bottomLeftCorner(3, num_turns);
  const int num_slides = weak.count - num_turns;
  weak.shape = SlidingShape::kOther;
  if (num_turns > 0) {
    weak.direction = turns.col(0).normalized();
    weak.point = CenterOf(turns, shifts, middle);
  }
  const Eigen::Vector3d slide = num_slides > 0
                                    ? Eigen::Vector3d(sorted.col(num_turns).tail<3>().normalized())
                                    : Eigen::Vector3d::Zero();
  if (num_turns == 1 && num_slides == 2) weak.shape = SlidingShape::kPlane;
  if (num_turns == 3 && num_slides == 0) weak.shape = SlidingShape::kSphere;
  if (num_turns == 1 && num_slides == 1 && std::abs(slide.dot(weak.direction)) > 0.8) {
    weak.shape = SlidingShape::kCylinder;
  }
  if (num_turns == 1 && num_slides == 0) {
    // A turn without the advance of a screw.
    const double advance = std::abs(shifts.col(0).dot(weak.direction));
    if (advance < kTurn) weak.shape = SlidingShape::kRevolution;
  }
  if (num_turns == 0 && num_slides == 1) {
    weak.shape = SlidingShape::kExtrusion;
    weak.direction = slide;
  }
  int largest = 0;
  weak.direction.cwiseAbs().maxCoeff(&largest);
  if (weak.direction[largest] < 0.0) weak.direction = -weak.direction;
  return weak;
}

std::string Describe(const WeakDirections& weak) {
  const std::string direction = Text(weak.direction, 1.0, 2);
  const std::string point = Text(weak.point, 1e3, 1);
  switch (weak.shape) {
    case SlidingShape::kNone:
      return "";
    case SlidingShape::kPlane:
      return fmt::format("sliding and turning in the plane with normal {}", direction);
    case SlidingShape::kSphere:
      return fmt::format("turning about the centre {} mm of a sphere", point);
    case SlidingShape::kCylinder:
      return fmt::format("turning about and sliding along the cylinder axis {} through {} mm",
                         direction, point);
    case SlidingShape::kRevolution:
      return fmt::format("turning about the axis of revolution {} through {} mm", direction, point);
    case SlidingShape::kExtrusion:
      return fmt::format("sliding along {}", direction);
    case SlidingShape::kOther:
      break;
  }
  return fmt::format("{} of six directions", weak.count);
}

}  // namespace fringe_fusion
