#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/pose/relative_pose.hpp"

namespace fringe_fusion {

/// When a calibration no longer fits its scans. File: config/health.yaml.
struct HealthConfig {
  double warn_px = 0.3;         ///< systematic distance to the epipolar lines [projector px]
  double error_px = 1.0;        ///< the same, beyond which points are false
  double alarm_sigma = 3.0;     ///< a change counts from here on [standard deviations]
  int block_px = 64;            ///< blocks whose medians part systematic error from noise
  double min_turn_deg = 0.002;  ///< smaller turns are not told, however significant

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("warn_px", warn_px, 0.0, 1000.0);
    field("error_px", error_px, 0.0, 1000.0);
    field("alarm_sigma", alarm_sigma, 1.0, 100.0);
    field("block_px", block_px, 4, 4096);
    field("min_turn_deg", min_turn_deg, 0.0, 180.0);
  }
};

enum class HealthLevel { kOk = 0, kWarn = 1, kError = 2 };
[[nodiscard]] const char* HealthLevelName(HealthLevel level);

/// Which device turned on its mount, as far as one view can tell.
enum class MovedDevice {
  kNone,       ///< nothing moved significantly
  kCamera,     ///< a turn of the camera explains the scan, one of the projector does not
  kProjector,  ///< the reverse
  kEither,     ///< both explain it, e.g. a turn about the baseline
  kBoth,       ///< neither does: both moved, or one was shifted
};
[[nodiscard]] const char* MovedDeviceName(MovedDevice device);

/// Motion of the rig since a reference pose, as far as matches can tell (5 of 6 directions).
struct RigMotion {
  MovedDevice moved = MovedDevice::kNone;
  double turn_deg = 0.0;        ///< of the projector against the camera
  double direction_deg = 0.0;   ///< change of the baseline's direction
  double significance = 0.0;    ///< sqrt of chi2 (5 dof)
  double camera_chi2 = 0.0;     ///< 2 dof: against "the camera turned about its centre"
  double projector_chi2 = 0.0;  ///< 2 dof: against "the projector turned about its centre"
};

/// Compares an estimated pose with a reference.
///
/// A camera that turns about its centre leaves the direction of the baseline in the projector's
/// frame, a projector that turns leaves it in the camera's frame: two hypotheses of two conditions
/// each. A turn about the baseline satisfies both.
/// @param T_projector_camera_reference any length of translation.
[[nodiscard]] RigMotion CompareWithReference(const RelativePose& pose,
                                             const Transform& T_projector_camera_reference,
                                             const HealthConfig& config);

/// How well a calibration explains one scan: for free, because codes on both axes measure one
/// coordinate more than a point needs.
struct HealthReport {
  Image<float> residual_px;  ///< signed distance to the epipolar line; NaN where invalid
  int num_pixels = 0;
  double median_px = 0.0;  ///< signed
  double median_abs_px = 0.0;
  double systematic_px = 0.0;        ///< rms of the medians of the blocks
  double reduced_chi2 = 0.0;         ///< median based: 1 if the stated sigmas explain the residuals
  std::optional<RelativePose> pose;  ///< estimated from this scan; none: see pose_error
  std::string pose_error;
  double refit_systematic_px = 0.0;  ///< systematic_px after the pose of this scan is taken
  RigMotion motion;                  ///< against the calibration
  HealthLevel level = HealthLevel::kOk;
  std::string message;  ///< what is wrong and what to do, or that all is well
};

/// Judges the calibration by one phase map.
/// @return error when the map codes one axis only, has no valid pixel, or sizes differ.
/// Ref: Braeuer-Burchardt et al. 2011 (epipolar residual of phase as monitor).
[[nodiscard]] Result<HealthReport> CheckHealth(const PhaseMap& phase,
                                               const CellCalibration& calibration,
                                               const EpipolarConfig& epipolar,
                                               const HealthConfig& config);

/// Trend of the health over time.
struct Drift {
  int num_scans = 0;
  double span_h = 0.0;
  double rate_px_h = 0.0;  ///< of the signed median residual
  double sigma_px_h = 0.0;
  Eigen::Vector3d turn_rate_deg_h = Eigen::Vector3d::Zero();  ///< camera axes
  double sigma_turn_deg_h = 0.0;
  bool significant = false;  ///< beyond HealthConfig::alarm_sigma
  std::string message;
};

/// Collects reports and fits straight lines over time.
class HealthHistory {
 public:
  /// Scans without a finite median are ignored.
  void Add(std::int64_t stamp_ns, const HealthReport& report, const CellCalibration& calibration);
  /// Needs at least three scans at different times; before, nothing is significant.
  [[nodiscard]] Drift Fit(const HealthConfig& config) const;

 private:
  struct Sample {
    std::int64_t stamp_ns = 0;
    double median_px = 0.0;
    std::optional<Eigen::Vector3d> turn_rad;
  };
  std::vector<Sample> samples_;
};

}  // namespace fringe_fusion
