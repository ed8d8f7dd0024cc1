#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

enum class TargetKind {
  kChessboard,         ///< inner corners
  kCharuco,            ///< inner corners of a chessboard with ArUco markers in its white squares
  kCircles,            ///< dots on a square lattice
  kAsymmetricCircles,  ///< every other row shifted by half a pitch (OpenCV's layout)
  kRingDots,           ///< mid-grey dots with a white ring, so that phase survives inside
  kShiftedDots,  ///< lattice whose columns are shifted by pitch / num_shifts one after another
};

/// A flat calibration target. File: target.yaml. Frame "target": x along the columns, y along the
/// rows, z into the target (away from a camera that sees x to the right and y downwards), origin at
/// point 0.
struct CalibrationTarget {
  TargetKind kind = TargetKind::kChessboard;
  int num_columns = 0;         ///< points along x
  int num_rows = 0;            ///< points along y
  double pitch_m = 0.0;        ///< distance of neighbouring points in a row
  double dot_radius_m = 0.0;   ///< dots only, else 0
  double ring_radius_m = 0.0;  ///< ring dots only: outer radius of the white ring
  double marker_m = 0.0;       ///< ChArUco only: edge of a marker
  int dictionary = 0;          ///< ChArUco only: OpenCV's number of a predefined dictionary
  int num_shifts = 1;          ///< shifted dots only: m, columns until the lattice repeats
  double sigma_print_m = 0.0;  ///< standard deviation of a point from its nominal place, each axis
  double print_ratio = 0.0;    ///< lightness of the print, 0: black, 1: as light as the ground
  bool light_on_dark = false;  ///< dots only: light dots on a dark ground (etched glass)
  std::vector<int> marked_points;  ///< larger dots that tell the orientation, may be empty
  double marked_radius_m = 0.0;    ///< radius of the marked dots, 0 without any
};

/// Nominal points, row after row, target frame [m].
[[nodiscard]] std::vector<Eigen::Vector3d> TargetPoints(const CalibrationTarget& target);

/// Radius of one dot, marked or not; 0 for corners [m].
[[nodiscard]] double DotRadius(const CalibrationTarget& target, int point);

/// True where the points are dots, not corners.
[[nodiscard]] bool HasDots(TargetKind kind);

/// Checks counts, lengths and what the kind needs.
[[nodiscard]] Status Validate(const CalibrationTarget& target, const std::string& owner);

/// The word for a kind in files and on the command line, e.g. "asymmetric_circles".
[[nodiscard]] const char* TargetKindName(TargetKind kind);
/// @return error naming the words that there are.
[[nodiscard]] Result<TargetKind> TargetKindFromName(const std::string& name);

/// Where one point of the target was seen. Pixels are those of the true centre or corner as the
/// lens images it for corners; for dots of the centre of the imaged ellipse (`is_ellipse_centre`),
/// which the solver predicts (science section 1.2).
struct PointSighting {
  int point = 0;  ///< index in TargetPoints
  Eigen::Vector2d pixel_camera = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_camera_px2 = Eigen::Matrix2d::Zero();
  bool has_projector = false;
  /// Projector coordinates of the point's true centre, from the local fit of the phase.
  Eigen::Vector2d pixel_projector = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_projector_px2 = Eigen::Matrix2d::Zero();
};

/// What one pose of the target (or of the camera) gave.
struct TargetSighting {
  std::string name;  ///< folder or file, for messages
  bool is_ellipse_centre = false;
  /// The print looks the same turned round, and nothing marks its orientation: by convention x runs
  /// to the right in the image. Of no matter to the lenses, but a hand-eye pose needs a mark.
  bool is_orientation_assumed = false;
  std::vector<PointSighting> points;
};

}  // namespace fringe_fusion
