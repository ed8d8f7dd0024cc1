#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "fringe_fusion/calibration/calibrate_cell.hpp"
#include "fringe_fusion/geometry/camera_model.hpp"
#include "fringe_fusion/geometry/transform.hpp"

namespace fringe_fusion::bundle {

constexpr int kNumModel = 9;  ///< fx fy cx cy k1 k2 p1 p2 k3
/// What one observation can depend on: the 24 shared parameters, its pose, and the place of its
/// point in the target, which a stage shift moves likewise.
constexpr int kNumLocal = kNumCellParameters + 6 + 3;
using LocalJacobian = Eigen::Matrix<double, 2, kNumLocal>;
using LocalHessian = Eigen::Matrix<double, kNumLocal, kNumLocal>;
using LocalVector = Eigen::Matrix<double, kNumLocal, 1>;

constexpr std::size_t kCamera = 0;
constexpr std::size_t kProjector = 1;

struct Observation {
  int point = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Matrix2d whitener = Eigen::Matrix2d::Identity();  ///< W Sigma W^T = 1
  double dot_radius_m = 0.0;  ///< > 0: the pixel is the centre of the imaged ellipse
};

/// What one sighting gave, and which pose it hangs on.
struct Station {
  std::array<std::vector<Observation>, 2> seen;  ///< by camera and projector
  std::size_t block = 0;
  int shift = -1;  ///< number of the stage shift in its block; -1: none
};

struct PoseBlock {
  Transform T_camera_target = Transform::Identity();
  std::vector<Eigen::Vector3d> shifts_m;
};

/// Everything that the adjustment moves.
struct State {
  std::array<CameraModel, 2> devices;
  Transform T_projector_camera = Transform::Identity();
  std::vector<PoseBlock> blocks;
  std::vector<Eigen::Vector3d> points_target;
};

using FreeMask = std::array<bool, kNumCellParameters>;

struct Options {
  FreeMask free{};
  bool free_points = false;
  double sigma_point_m = 1.0;
  double sigma_shift_m = 1.0;
  double huber_sigma = 3.0;
  std::array<double, 2> scale{1.0, 1.0};  ///< factors on all standard deviations of a device
};

/// Sums over the observations of one device.
struct DeviceSums {
  double chi2 = 0.0;  ///< Huber-weighted
  double sum_px2 = 0.0;
  int count = 0;

  void Add(const DeviceSums& other);
};

/// Normal equations of one station.
struct StationSums {
  LocalHessian hessian = LocalHessian::Zero();
  LocalVector gradient = LocalVector::Zero();
  Eigen::MatrixXd cross;           ///< local x 3 points, if points are free
  Eigen::MatrixXd point_hessian;   ///< 3 x 3 points
  Eigen::VectorXd point_gradient;  ///< 3 points
  double cost = 0.0;
  std::array<DeviceSums, 2> devices;
};

/// The reduced normal equations; poses and shifts are eliminated block by block.
struct Reduced {
  Eigen::MatrixXd hessian;  ///< shared, then 3 per free point
  Eigen::VectorXd gradient;
  std::vector<Eigen::MatrixXd> block_inverse;
  std::vector<Eigen::MatrixXd> block_coupling;  ///< block x shared
  std::vector<Eigen::VectorXd> block_gradient;
  std::vector<Eigen::MatrixXd> share_hessian;  ///< what each block adds to the reduced system
  std::vector<Eigen::VectorXd> share_gradient;
};

/// Predicted minus measured.
struct Residual {
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d e = Eigen::Vector2d::Zero();  ///< whitened
};

/// A residual with the derivatives of e.
struct Linearized : Residual {
  LocalJacobian jacobian = LocalJacobian::Zero();
};

/// Least squares over both devices, their pose, the poses of a target and its shape.
class CellProblem {
 public:
  CellProblem(std::vector<Station> stations, std::vector<Eigen::Vector3d> nominal_points,
              std::vector<std::vector<Eigen::Vector3d>> nominal_shifts);

  std::vector<Station>& stations() { return stations_; }
  [[nodiscard]] const std::vector<Station>& stations() const { return stations_; }

  /// Levenberg-Marquardt. @return false when the start has points behind a device or no step is
  /// finite.
  [[nodiscard]] bool Solve(State& state, const Options& options, int max_iterations) const;

  /// The reduced system at a state.
  [[nodiscard]] Reduced Reduce(const State& state, const Options& options, double damping) const;

  [[nodiscard]] StationSums Sum(const State& state, const Options& options,
                                std::size_t station) const;
  [[nodiscard]] static Linearized Linearize(const State& state, const Station& station,
                                            const Observation& seen, std::size_t device,
                                            const Options& options);
  /// The residual without derivatives; NaN behind a device.
  [[nodiscard]] static Residual Miss(const State& state, const Station& station,
                                     const Observation& seen, std::size_t device,
                                     const Options& options);
  /// Cost with priors; infinite behind a device.
  [[nodiscard]] double Cost(const State& state, const Options& options) const;
  /// Sums over all stations.
  [[nodiscard]] std::array<DeviceSums, 2> Sums(const State& state, const Options& options) const;

  /// Moves one pose alone to its optimum with everything else held. Stations without stage only.
  void FitPose(State& state, const Options& options, std::size_t station, int iterations) const;

 private:
  [[nodiscard]] std::vector<StationSums> SumAll(const State& state, const Options& options) const;
  [[nodiscard]] Reduced Eliminate(const State& state, const Options& options,
                                  const std::vector<StationSums>& sums, double damping) const;
  [[nodiscard]] double PriorCost(const State& state, const Options& options) const;
  [[nodiscard]] State Moved(const State& state, const Options& options, const Reduced& reduced,
                            const Eigen::VectorXd& step) const;

  std::vector<Station> stations_;
  std::vector<Eigen::Vector3d> nominal_points_;
  std::vector<std::vector<Eigen::Vector3d>> nominal_shifts_;  ///< per block
};

/// Indices of the reduced system that are free.
[[nodiscard]] std::vector<Eigen::Index> FreeIndices(const Options& options, Eigen::Index size);

/// Solves hessian x = -gradient on the free indices; zero elsewhere. Empty when not positive
/// definite.
[[nodiscard]] std::optional<Eigen::VectorXd> SolveFree(const Eigen::MatrixXd& hessian,
                                                       const Eigen::VectorXd& gradient,
                                                       const std::vector<Eigen::Index>& free);

/// Devices and their pose moved by the 24 shared parameters.
void MoveShared(State& state, const Eigen::Ref<const Eigen::VectorXd>& step);

/// Derivative of a pixel by the nine parameters of its device.
[[nodiscard]] Eigen::Matrix<double, 2, kNumModel> PixelByModel(const CameraModel& model,
                                                               const Eigen::Vector2d& normalized);

}  // namespace fringe_fusion::bundle
