#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/calibration/hand_eye.hpp"
#include "fringe_fusion/calibration/turntable_axis.hpp"

namespace fringe_fusion {

/// One pose of a robot and where the picture taken there is.
struct RobotStation {
  DevicePose pose;
  std::string image;  ///< picture of the target; "": none is named
  int view = -1;      ///< view of the scan folder in which the file lies; -1: none
};

/// robot_poses.yaml: where a robot was and what was seen there.
struct RobotPosesFile {
  HandEyeMount mount = HandEyeMount::kEyeInHand;
  std::vector<RobotStation> stations;
};

/// Keys: `mount`, `root` (folder of pictures and pose files, relative to the file; with
/// FRINGE_FUSION_DATA as for view.yaml) and `poses`, each with `name` and one of
/// `T_base_flange: {translation_m, quaternion_xyzw}` and `pose_file` (x y z qx qy qz qw [m], as
/// robot_cal_tools writes them); optional `sigma_rotation_rad` with `sigma_translation_m`, or
/// `covariance`; optional `image` or `view`.
/// @return error naming file, pose, key and value.
[[nodiscard]] Result<RobotPosesFile> LoadRobotPoses(const std::string& path);

/// stops.yaml: `stops`, each with `name`, `angle_rad` and, optional, `sigma_angle_rad`.
[[nodiscard]] Result<std::vector<TurntableStop>> LoadTurntableStops(const std::string& path);

/// Lens models of a rig: cell.yaml, or a file that states only its `camera`, which then has no
/// projector (width 0).
[[nodiscard]] Result<CellCalibration> ReadRig(const std::string& path);

/// Result with covariances and verdict.
[[nodiscard]] Status WriteHandEye(const HandEyeResult& result, const std::string& path);
[[nodiscard]] Status WriteTurntable(const TurntableResult& result, const std::string& path);

/// A calibrated edge of the tf tree.
struct FrameEdge {
  std::string name;  ///< of the edge in its file, e.g. "scanner"
  std::string parent_frame;
  std::string child_frame;
  Transform T_parent_child = Transform::Identity();
};

/// Edges as scanner_node reads them (config/cell_sim/arm_edges.yaml).
/// @return error naming file, edge, key and value.
[[nodiscard]] Result<std::vector<FrameEdge>> ReadFrameEdges(const std::string& path);
[[nodiscard]] Status WriteFrameEdges(const std::vector<FrameEdge>& edges, const std::string& path);

/// Puts an edge in the place of the one of its name, or adds it.
void SetFrameEdge(const FrameEdge& edge, std::vector<FrameEdge>& edges);

/// The edge that a hand-eye states: `scanner` (the camera's optical frame is its frame) under the
/// flange or the base.
[[nodiscard]] FrameEdge ScannerEdge(const HandEyeResult& result, const std::string& flange_frame,
                                    const std::string& base_frame);

/// The edge `turntable_base` under `parent`. Where the edges have one, its origin's height along
/// the axis and its x stay; only the axis moves.
/// @param T_parent_camera p_parent = T_parent_camera p_camera.
[[nodiscard]] FrameEdge TurntableBaseEdge(const TurntableResult& result,
                                          const Transform& T_parent_camera,
                                          const std::string& parent,
                                          const std::vector<FrameEdge>& edges);

}  // namespace fringe_fusion
