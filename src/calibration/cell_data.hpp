#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "cell_problem.hpp"
#include "fringe_fusion/calibration/calibrate_cell.hpp"
#include "zhang.hpp"

namespace fringe_fusion::bundle {

/// Sightings in the form that the solvers use; one station per sighting, empty where it was
/// refused.
struct CellData {
  std::vector<Station> stations;
  std::vector<std::string> reasons;  ///< why a station is empty; "": it is not
  std::array<std::vector<std::optional<PlanarHomography>>, 2> homographies;
  std::vector<std::vector<Eigen::Vector3d>> nominal_shifts;  ///< per block
  std::vector<std::size_t> first_station;                    ///< per block
  std::vector<Eigen::Vector3d> points;                       ///< nominal
};

/// Screens sightings: each must be a flat target with this layout, seen from its front.
/// @return error for bad numbers, and where all sightings show the same fault of the target.
[[nodiscard]] Result<CellData> ScreenSightings(const CalibrationTarget& target,
                                               const std::vector<TargetSighting>& sightings,
                                               const std::vector<StageStation>& stage,
                                               const CalibrationConfig& config);

/// A device with the poses of all blocks before it, from Zhang's closed form and several principal
/// points; the lower optimum wins.
/// @param has_lens_shift the principal point may lie outside the image.
struct DeviceStart {
  CameraModel model;
  std::vector<std::optional<Transform>> T_device_target;  ///< per station
  double rms_px = 0.0;
};
[[nodiscard]] Result<DeviceStart> StartDevice(const CellData& data, std::size_t device, int width,
                                              int height, bool has_lens_shift);

/// Both devices and all poses to start from.
[[nodiscard]] Result<State> StartCell(const CellData& data, const DeviceSizes& sizes);

/// Free parameters of two distortion levels, with the pose of the projector free.
[[nodiscard]] FreeMask MaskOf(DistortionLevel camera, DistortionLevel projector);

}  // namespace fringe_fusion::bundle
