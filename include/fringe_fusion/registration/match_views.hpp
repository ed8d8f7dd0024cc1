#pragma once

#include <Eigen/Core>
#include <vector>

#include "fringe_fusion/registration/view_surface.hpp"

namespace fringe_fusion {

/// What makes two points of two views partners.
struct MatchLimits {
  double radius_m = 0.003;
  double max_normal_angle_rad = 0.5;
  double rejection_mad = 3.0;      ///< residual limit in robust standard deviations of the pair
  double min_overlap_ratio = 0.0;  ///< of the samples of one view, for a pair to count
  int min_correspondences = 6;     ///< at the finest level; coarser levels need their share
  int level = 0;                   ///< of the samples, see ViewSurface::samples
  bool symmetric = true;           ///< residual along the mean of both normals, not the target's
};

/// A sample of one view and its partner in the other.
struct Match {
  int source = 0;           ///< index into points() of the sampled view
  int target = 0;           ///< index into points() of the other view
  float residual_m = 0.0F;  ///< normal . (point of the pair's first view - of its second)
  float normalized = 0.0F;  ///< residual over its standard deviation
  float weight = 0.0F;      ///< 1/variance, reduced for outliers and for repeated use [1/m^2]
};

/// All partners of two views, searched from both sides. Views are numbered as in the graph.
struct ViewPair {
  int first = 0;
  int second = 0;
  std::vector<Match> from_first;   ///< samples of `first`
  std::vector<Match> from_second;  ///< samples of `second`
  double scale = 0.0;              ///< robust standard deviation of `normalized`
  double scale_m = 0.0;            ///< robust standard deviation of `residual_m`
  bool symmetric = true;           ///< as in MatchLimits
  bool counts = false;             ///< enough overlap to be used
};

/// The partners of all views at some poses.
struct MatchSet {
  std::vector<ViewPair> pairs;
  double scale = 0.0;  ///< robust standard deviation of `normalized` over the pairs that count
  double rms_m = 0.0;  ///< of the accepted residuals of the pairs that count
};

/// Both orders of view numbers are one pair: (0, 1), (0, 2), ..., first < second.
struct PairNumbers {
  int first = 0;
  int second = 0;
  bool counted = false;  ///< counted before: half the overlap suffices, so that it does not flicker
};
[[nodiscard]] std::vector<PairNumbers> AllPairs(int num_views);

/// Residual geometry of one match in the object frame.
struct MatchGeometry {
  Eigen::Vector3d middle;      ///< between both points [m]
  Eigen::Vector3d normal;      ///< unit mean of both normals, or that of the target
  Eigen::Vector3d difference;  ///< with the covariance of the noise of `normal`
  double residual_m = 0.0;     ///< normal . (point of first - point of second)
};

/// @param from_first whether match.source belongs to pair.first.
[[nodiscard]] MatchGeometry ComputeMatch(const ViewPair& pair, const Match& match, bool from_first,
                                         const SurfaceSet& set,
                                         const std::vector<Transform>& poses);

/// Searches the partners of every sample in every given pair of views: the nearest point within
/// the radius, not on a border, seen by the other sensor, with a similar normal; then drops
/// residuals beyond rejection_mad robust standard deviations of the pair and sets the weights.
/// @param poses T_object_camera of every view of the set.
/// The residual uses the mean of both normals, which is exact to second order on curved surfaces,
/// or, not symmetric, the normal of the target (point to plane).
/// Ref: Rusinkiewicz, A symmetric objective function for ICP, 2019, eq. 7.
[[nodiscard]] MatchSet MatchViews(const SurfaceSet& set, const std::vector<Transform>& poses,
                                  const std::vector<PairNumbers>& pairs, const MatchLimits& limits);

/// Least robust standard deviation that is believed: 1 with stated sigmas, else a nanometre.
[[nodiscard]] double ScaleFloor(const SurfaceSet& set);

}  // namespace fringe_fusion
