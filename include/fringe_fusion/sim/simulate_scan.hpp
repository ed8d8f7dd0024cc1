#pragma once

#include <optional>
#include <string>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/diagnosis/response.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"

namespace fringe_fusion::sim {

/// A turntable scan of the simulated cell. The nested parts have YAML files of their own.
struct SimulateScanConfig {
  int views = 12;                  ///< stops of one turn
  double distance_m = 0.5;         ///< from the camera to the target
  double elevation_deg = 25.0;     ///< of the camera above the turntable
  double target_height_m = 0.035;  ///< point on the axis that the camera looks at
  double exposure_s = 0.02;
  double plate_radius_m = 0.07;  ///< of the turntable plate; 0: no plate
  /// What the prior poses state beyond the configured pose errors; all zero: priors are exact.
  double prior_rotation_sigma_deg = 0.002;
  double prior_translation_sigma_mm = 0.01;
  bool write_truth_maps = false;  ///< exact u, v and lit mask per view

  SimConfig sim;
  PatternConfig pattern;
  std::optional<ResponseCurve> response;  ///< undone in the patterns instead of pattern.gamma
  CellCalibration calibration = DefaultCalibration();

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("views", views, 1, 10000);
    field("distance_m", distance_m, 0.01, 100.0);
    field("elevation_deg", elevation_deg, -89.0, 90.0);
    field("target_height_m", target_height_m, -10.0, 10.0);
    field("exposure_s", exposure_s, 1e-6, 100.0);
    field("plate_radius_m", plate_radius_m, 0.0, 10.0);
    field("prior_rotation_sigma_deg", prior_rotation_sigma_deg, 0.0, 180.0);
    field("prior_translation_sigma_mm", prior_translation_sigma_mm, 0.0, 1000.0);
    field("write_truth_maps", write_truth_maps);
  }
};

/// Scans an object and writes a scan folder: cell.yaml, patterns.yaml, the views with the commanded
/// poses as priors, and truth/ with poses.conf (true poses), object.ply and visible.ply (the faces
/// that some view sees with both devices), and on request truth/views/NNN/{u,v}.tiff, lit.png.
/// @return error of the configuration, a dropped frame, the disk, or cancellation.
[[nodiscard]] Status SimulateScan(const SimulateScanConfig& config, const Mesh& object,
                                  const std::string& folder, const Progress& progress = NoProgress);

/// Captures a whole sequence at the present pose with a correction in its pictures.
[[nodiscard]] Result<ImageStack> CaptureStack(SimCell& cell, const PatternSequence& sequence,
                                              const PatternCorrection& correction,
                                              double exposure_s, int view_id);

/// The faces of a mesh that are marked, with the vertices they use.
/// @param face_visible one entry per face.
[[nodiscard]] Mesh SelectFaces(const Mesh& mesh, const std::vector<std::uint8_t>& face_visible);

}  // namespace fringe_fusion::sim
