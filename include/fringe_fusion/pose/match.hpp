#pragma once

#include <Eigen/Core>
#include <vector>

#include "fringe_fusion/geometry/camera_model.hpp"
#include "fringe_fusion/phase/phase_map.hpp"
#include "fringe_fusion/pose/epipolar_config.hpp"

namespace fringe_fusion {

/// One surface point in two devices. Phase is measured at whole camera pixels, so the camera's
/// pixel is exact and all noise is in the decoded projector pixel: the camera is the `anchor`, the
/// projector the `observed` device. Where projector pixels are the identities of points that a
/// moving camera sees, the roles are swapped.
struct Match {
  Eigen::Vector2d anchor_px = Eigen::Vector2d::Zero();           ///< exact
  Eigen::Vector2d observed_px = Eigen::Vector2d::Zero();         ///< noisy
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();  ///< of observed_px
};

/// The two devices of a set of matches.
struct DevicePair {
  CameraModel anchor;
  CameraModel observed;
};

/// Samples a phase map on a grid of cells: of each cell the pixel with the smallest variance.
/// @param max_matches upper bound of the number of matches.
/// @return anchor = camera, observed = projector; error when an axis is not coded, sizes differ or
/// no pixel is valid.
[[nodiscard]] Result<std::vector<Match>> SampleMatches(const PhaseMap& phase, int max_matches);

/// Looks for input from which no pose can follow: too few matches, values that are not finite,
/// variances that are not positive, all pixels equal or on one line, u and v swapped, an axis
/// mirrored.
/// @return error naming the cause with value and limit.
[[nodiscard]] Status CheckMatches(const std::vector<Match>& matches, const DevicePair& devices,
                                  const EpipolarConfig& config);

/// How the code map turns the image: both devices see the same side of a surface, so that the map
/// between their images never mirrors.
enum class MapFault { kNone, kSwapped, kMirroredU, kMirroredV };

struct MapOrientation {
  int num_patches = 0;
  double mirrored_ratio = 0.0;       ///< of patches whose map from anchor to observed has det < 0
  MapFault fault = MapFault::kNone;  ///< what brings the map closest to upright
};

/// Fits an affine map to patches of neighbouring matches and votes.
/// A mirrored map is called swapped, mirrored in u or mirrored in v by what leaves the smallest
/// roll between the devices when it is undone.
[[nodiscard]] MapOrientation FindOrientation(const std::vector<Match>& matches);

}  // namespace fringe_fusion
