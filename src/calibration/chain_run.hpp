#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "cell_problem.hpp"
#include "device_chain.hpp"
#include "fringe_fusion/calibration/hand_eye.hpp"

/// What the calibrations of a hand-eye and of a turntable have in common: target poses or points of
/// a target, a device, ends to solve for, and poses that do not fit.
namespace fringe_fusion::chain {

/// Points of a target in all sightings, with a pose of its own for each.
struct PointModel {
  bundle::CellProblem problem;
  bundle::State state;
  bundle::Options options;
};

/// Target poses as the camera measured them, each alone.
struct Measured {
  std::vector<Transform> T_camera_target;
  std::vector<Matrix6d> covariance;
  std::vector<Matrix6d> information;
  std::vector<std::string> reasons;  ///< why a pose is out; "": it is in
  std::vector<int> num_rejected_points;
  Eigen::Vector3d middle_target = Eigen::Vector3d::Zero();  ///< of what was seen
  double sigma_scale = 1.0;                                 ///< found from the points
  std::optional<PointModel> points;
};

/// @return error naming the pose whose numbers are not finite or no covariance.
[[nodiscard]] Result<Measured> MeasureTargets(const std::vector<DevicePose>& names,
                                              const std::vector<TargetPose>& poses);

struct PointLimits {
  double huber_sigma = 3.0;
  double reject_sigma = 6.0;
};
/// Fits every sighting alone: single bad points are left out, the noise of the points is found.
/// @return error for sightings that share a fault, or whose orientation is assumed.
[[nodiscard]] Result<Measured> MeasureTargets(const std::vector<TargetSighting>& sightings,
                                              const TargetView& view, const PointLimits& limits);

/// Target poses count as they were measured. @param measured must outlive the cost.
[[nodiscard]] TargetCost PoseCostOf(const Measured& measured);
/// The points themselves count. @param points must outlive the cost, which moves its poses and its
/// lens. @param stated the lens from which changes count.
[[nodiscard]] TargetCost PointCostOf(PointModel& points, const CameraModel& stated);

/// The stated lens with a change.
void SetLens(const CameraModel& stated, const LensVector& change, CameraModel& model);

/// Which corrections share a factor on their stated sigmas.
using CorrectionGroups = std::array<int, 6>;

struct ChainLimits {
  int min_poses = 3;
  double max_pose_ratio = 3.0;
  double max_condition = 1e12;
  CorrectionGroups groups{0, 0, 0, 1, 1, 1};
};

/// A calibration on its way.
struct ChainRun {
  std::vector<std::string> names;
  Measured measured;
  Chain chain;  ///< with the information of the corrections as stated
  ChainLimits limits;
  ChainState state;
  std::vector<double> held_out_ratio;
  std::array<double, 2> sigma_scale{1.0, 1.0};  ///< of the groups
  ChainCovariance covariance;                   ///< with these factors
};

[[nodiscard]] int NumUsed(const ChainRun& run);
/// Numbers of the poses that take part.
[[nodiscard]] std::vector<std::size_t> UsedPoses(const ChainRun& run);
/// "; NAME: reason" of all that are out.
[[nodiscard]] std::string ReasonsOf(const ChainRun& run);
/// @return error when fewer than min_poses take part.
[[nodiscard]] Status CheckNumUsed(const ChainRun& run);

/// Squared distance of a measured target pose from its prediction, in the covariance of both.
/// @param ends covariance of the ends.
[[nodiscard]] double SquaredMiss(const ChainRun& run, const ChainState& state, std::size_t pose,
                                 const EndMatrix& ends);

/// Starts from the candidate that most poses agree with (least median), takes out poses that do
/// not fit, refines on the points where there are any and finds the factors on the device's sigmas.
/// @param candidates values of T_camera_carrier, tried in order until one is good.
[[nodiscard]] Status RunChain(const std::vector<Transform>& candidates, ChainRun& run);

/// Outcomes of all poses, with the corrections found.
[[nodiscard]] std::vector<DevicePoseOutcome> OutcomesOf(ChainRun& run);

/// rms of all points that take part [px]; 0 without points.
[[nodiscard]] double RmsOfPoints(const std::vector<DevicePoseOutcome>& outcomes);

/// Covariance of what the ends do to a point [m^2]: that moved by a right perturbation T Exp(xi),
/// turned by T.
[[nodiscard]] Eigen::Matrix3d CovarianceOfPoint(const Matrix6d& covariance,
                                                const Eigen::Vector3d& point);

}  // namespace fringe_fusion::chain
