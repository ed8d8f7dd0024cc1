#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cell_data.hpp"

namespace fringe_fusion::bundle {

constexpr int kSolveIterations = 50;

/// A calibration on its way: what the steps of CalibrateCell hand on to each other.
struct CellRun {
  CalibrationConfig config;
  DeviceSizes sizes;
  std::vector<std::string> names;    ///< of the sightings
  std::vector<std::string> reasons;  ///< why a sighting is out; "": it is in
  CellProblem problem;
  State state;
  Options options;
  DistortionLevel camera = DistortionLevel::kK1K2;
  DistortionLevel projector = DistortionLevel::kK1K2;
  std::vector<RejectedPoint> rejected;
  std::vector<double> held_out_ratio;  ///< per sighting; 0: none
  std::vector<ModelTrial> trials;
};

/// What a pose leaves when it took no part in the solution.
struct HeldOutPose {
  std::array<DeviceSums, 2> devices;
  double cost = 0.0;
  double ratio = 0.0;  ///< rms of the whitened residual over its expectation
};

/// Predicts every pose from the others: devices from the normal equations without it, then its own
/// six numbers from its own points. Nothing where a block hangs on a stage, or is out, or without
/// which the others determine nothing.
[[nodiscard]] std::vector<std::optional<HeldOutPose>> HoldOut(const CellProblem& problem,
                                                              const State& state,
                                                              const Options& options);

/// Factors on the stated standard deviations, from medians: bad points do not count yet.
void SetRobustScale(CellRun& run);
/// The same from all points that are in, with their degrees of freedom.
void SetScale(CellRun& run);

/// Takes out poses that do not fit the others, the worst first.
void RejectPoses(CellRun& run);
/// Takes out points that do not fit, and poses of which too many do not.
/// @return whether any was.
[[nodiscard]] bool RejectPoints(CellRun& run);

/// Sets free parameters and zeroes what is held.
void SetLevels(CellRun& run, DistortionLevel camera, DistortionLevel projector);
/// Chooses the distortion model by held-out error, unless the config states it.
void ChooseLevels(CellRun& run);

/// Numbers of poses and points that are in.
[[nodiscard]] int NumPoses(const CellRun& run);
[[nodiscard]] std::array<int, 2> NumPoints(const CellRun& run);
/// Largest angle between the planes of two poses [deg].
[[nodiscard]] double MaxTiltDeg(const CellRun& run);

/// Fills images, angles, depth and their gaps.
[[nodiscard]] Coverage AssessCoverage(const CellRun& run);
/// The candidate pose that lowers the predicted error most.
[[nodiscard]] NextPose SuggestNextPose(const CellRun& run, const CellCovariance& covariance,
                                       const Coverage& coverage);
/// Holds a result against the limits.
[[nodiscard]] Verdict Judge(const CellRun& run, const CellCalibrationResult& result,
                            double error_before_m);

}  // namespace fringe_fusion::bundle
