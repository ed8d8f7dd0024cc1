#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "fringe_fusion/pose/stations.hpp"

namespace fringe_fusion::epipolar {

using Vector8d = Eigen::Matrix<double, 8, 1>;

/// Everything that bundle adjustment moves.
struct BundleState {
  DevicePair devices;
  std::vector<Transform> T_station_anchor;
  std::vector<double> depth_m;  ///< per track; NaN: the track takes no part
};

/// Reduced normal equations: intrinsics (8: log f, cx, cy, k1 of anchor and moving device), then
/// six per station. Depths are eliminated.
struct ReducedSystem {
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
  double cost = 0.0;
  double chi2 = 0.0;     ///< of the inliers
  double sum_px2 = 0.0;  ///< of the inliers
  int num_inliers = 0;   ///< sightings
  int num_tracks = 0;    ///< with a depth and a sighting

  void Resize(Eigen::Index size);
  void Add(const ReducedSystem& other);
};

struct AnchorPoint;
struct Sighting;

/// Joint least squares over poses, depths and intrinsics.
class Bundle {
 public:
  /// @param anchor, moving priors about `nominal`; all zero: held there.
  Bundle(const TrackSet& tracks, const IntrinsicsPrior& anchor, const IntrinsicsPrior& moving,
         const DevicePair& nominal, double huber_sigma);

  /// Levenberg-Marquardt. @return number of iterations; -1 when no step is finite.
  [[nodiscard]] int Solve(BundleState& state, int max_iterations) const;

  /// The reduced system at a state.
  [[nodiscard]] ReducedSystem Reduce(const BundleState& state, double damping) const;

  /// Columns of the reduced system that are free, with the gauge of station 0 taken out:
  /// x_full = P x_free.
  [[nodiscard]] Eigen::MatrixXd FreeBasis(const BundleState& state) const;

  /// Factor on all standard deviations.
  void SetScale(double scale) { scale_ = scale; }
  /// Sightings beyond so many deviations have no weight.
  void SetRejection(double reject_sigma) { reject_sigma_ = reject_sigma; }
  /// max(1, 1.4826 median |e|) over all residual components.
  [[nodiscard]] double RobustScale(const BundleState& state) const;

 private:
  struct TrackSums;
  [[nodiscard]] Sighting Linearize(const BundleState& state, const AnchorPoint& at,
                                   const TrackObservation& seen) const;
  /// Eliminates the depth of one track. Fills the upper half only.
  static void AddTrack(const TrackSums& sums, double damping, ReducedSystem& system);
  /// Linearises a track; false when it lies behind a device.
  [[nodiscard]] bool SumTrack(const BundleState& state, std::size_t track, TrackSums& sums) const;
  [[nodiscard]] double Cost(const BundleState& state) const;
  [[nodiscard]] BundleState Moved(const BundleState& state, const Eigen::VectorXd& step,
                                  double damping) const;
  void AddPriors(const BundleState& state, ReducedSystem& system) const;

  const TrackSet& tracks_;
  DevicePair nominal_;
  Vector8d prior_sigma_;
  double huber_sigma_;
  double scale_ = 1.0;
  double reject_sigma_ = std::numeric_limits<double>::infinity();
  std::vector<std::size_t> first_;  ///< first observation of each track, and the end
};

}  // namespace fringe_fusion::epipolar
