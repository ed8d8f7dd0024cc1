#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion {

/// Where the measuring rays of a range image come from, in its own frame.
struct LineOfSight {
  bool directional = false;  ///< true: a scanner with parallel rays (Stanford range scans)
  /// Camera centre [m], or, if directional, the unit direction towards the sensor.
  Eigen::Vector3f camera = Eigen::Vector3f::Zero();
  std::optional<Eigen::Vector3f> projector;  ///< projector centre [m]; none: no second device
};

/// Unit vector from a point towards the camera.
[[nodiscard]] Eigen::Vector3f DirectionToCamera(const LineOfSight& line_of_sight,
                                                const Eigen::Vector3f& point);

/// Organised points of one view in the camera frame; invalid pixels are NaN in every field.
/// Covariance of a point with unit ray r: sigma_range^2 r r^T + sigma_lateral^2 (I - r r^T).
struct RangeImage {
  int width = 0;
  int height = 0;
  Image<Eigen::Vector3f> points;   ///< [m]
  Image<Eigen::Vector3f> normals;  ///< unit, towards the camera
  Image<Rgb8> color;
  Image<float> sigma_range;    ///< along the ray [m]
  Image<float> sigma_lateral;  ///< across the ray [m]
  LineOfSight line_of_sight;
  std::int64_t first_stamp_ns = 0;
  std::int64_t last_stamp_ns = 0;
};

/// An all-invalid range image of the given size.
[[nodiscard]] RangeImage MakeRangeImage(int width, int height);
[[nodiscard]] bool IsValid(const RangeImage& range, int x, int y);
[[nodiscard]] int CountValid(const RangeImage& range);

struct TriangulationConfig {
  double min_range_m = 0.05;
  double max_range_m = 10.0;
  double max_epipolar_sigma = 8.0;     ///< largest epipolar residual in standard deviations ...
  double max_epipolar_px = 2.0;        ///< ... plus this calibration allowance [projector px]
  double max_normal_angle_deg = 85.0;  ///< between normal and ray to the camera
  int normal_radius_px = 2;            ///< half window of the normal fit
  double max_depth_step_ratio = 6.0;   ///< largest depth step between neighbours, of their lateral
                                       ///< distance; larger ones separate two surfaces
  int min_neighbors = 5;               ///< valid points in the normal window
  int min_component_px = 20;           ///< smaller connected specks are removed
  double lateral_sigma_px = 0.2887;    ///< across the ray [camera px]; 1/sqrt(12): a whole pixel

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("min_range_m", min_range_m, 0.0, 1000.0);
    field("max_range_m", max_range_m, 0.0, 1000.0);
    field("max_epipolar_sigma", max_epipolar_sigma, 1.0, 1e6);
    field("max_epipolar_px", max_epipolar_px, 0.0, 1e4);
    field("max_normal_angle_deg", max_normal_angle_deg, 1.0, 90.0);
    field("normal_radius_px", normal_radius_px, 1, 20);
    field("max_depth_step_ratio", max_depth_step_ratio, 0.1, 1e6);
    field("min_neighbors", min_neighbors, 3, 1000);
    field("min_component_px", min_component_px, 0, 1000000);
    field("lateral_sigma_px", lateral_sigma_px, 0.0, 10.0);
  }
};

struct TriangulationResult {
  RangeImage range;
  Image<float> epipolar_residual_px;  ///< signed distance of (u, v) to the epipolar line
                                      ///< [projector px], NaN without both axes
  Image<std::uint8_t> mask;           ///< MaskReason, the phase mask refined
  double median_abs_epipolar_px = 0.0;
};

/// Triangulates a phase map: weighted least squares on both coordinates along each camera ray.
/// Points with no normal and small specks are removed (kEdge, kIsolated).
/// @return error when the sizes of map and calibration differ or no coordinate is present.
/// Ref: science section 2.5.
[[nodiscard]] Result<TriangulationResult> Triangulate(const PhaseMap& phase,
                                                      const CellCalibration& calibration,
                                                      const TriangulationConfig& config,
                                                      const Progress& progress = NoProgress);

/// Undistorted normalised coordinates (x, y) of every camera pixel, so that its ray is (x, y, 1);
/// NaN where the distortion cannot be inverted. The same for all views of a camera.
[[nodiscard]] Image<Eigen::Vector2f> MakeRayTable(const CameraModel& camera);

/// As above with the ray table of the camera, for many views with one calibration.
/// @param rays MakeRayTable(calibration.camera).
[[nodiscard]] Result<TriangulationResult> Triangulate(const PhaseMap& phase,
                                                      const CellCalibration& calibration,
                                                      const Image<Eigen::Vector2f>& rays,
                                                      const TriangulationConfig& config,
                                                      const Progress& progress = NoProgress);

/// Fits unit normals to an organised cloud in place of those it has; points whose neighbourhood
/// is too thin or too oblique become invalid.
/// The fit is weighted with the noise along the ray, in coordinates in which a plane is linear
/// and the noise lies in one of them: inverse depth over ray direction (camera), or depth over
/// position (directional line of sight).
[[nodiscard]] RangeImage EstimateNormals(const RangeImage& range,
                                         const TriangulationConfig& config);

/// Removes connected groups of fewer than config.min_component_px points. Two neighbours connect
/// unless a depth step (config.max_depth_step_ratio) lies between them.
[[nodiscard]] RangeImage RemoveSpecks(const RangeImage& range, const TriangulationConfig& config);

}  // namespace fringe_fusion
