#include "fringe_fusion/registration/overlap_check.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "common/constants.hpp"
#include "fringe_fusion/registration/match_views.hpp"

namespace fringe_fusion {
namespace {

constexpr int kPointsPerView = 5000;  // for the alignment: far more than its six unknowns need

Status CheckPoses(const ViewGraph& graph, const std::vector<Transform>& poses) {
  if (poses.size() != graph.views.size()) {
    return Fail("{} poses for {} views", poses.size(), graph.views.size());
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!poses[i].matrix().allFinite()) {
      return Fail("view {} ({}): pose has a value that is not finite", graph.views[i].id,
                  graph.views[i].name);
    }
  }
  return {};
}

// Evenly strided valid points of a view.
std::vector<Eigen::Vector3d> SomePoints(const RangeImage& range) {
  const int stride = std::max(1, CountValid(range) / kPointsPerView);
  std::vector<Eigen::Vector3d> points;
  int count = 0;
  for (const Eigen::Vector3f& point : range.points) {
    if (point.allFinite() && count++ % stride == 0) points.push_back(point.cast<double>());
  }
  return points;
}

}  // namespace

Result<double> HeldOutOverlapResidual(const ViewGraph& graph, const std::vector<Transform>& poses,
                                      const RegistrationConfig& config) {
  if (Status status = CheckPoses(graph, poses); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const Result<SurfaceSet> set =
      MakeSurfaces(graph.views, PixelSet::kHeldOut, config.max_points_per_view);
  if (!set) return Forward(set);
  MatchLimits limits;
  limits.radius_m = config.max_distance_m;
  limits.max_normal_angle_rad = config.max_normal_angle_deg * kRadPerDeg;
  limits.rejection_mad = config.rejection_mad;
  limits.min_overlap_ratio = config.min_overlap_ratio;
  limits.min_correspondences = config.min_correspondences;
  limits.level = ViewSurface::kNumLevels - 1;
  const MatchSet matches =
      MatchViews(*set, poses, AllPairs(static_cast<int>(poses.size())), limits);
  const bool any = std::any_of(matches.pairs.begin(), matches.pairs.end(),
                               [](const ViewPair& pair) { return pair.counts; });
  if (!any) {
    return Fail("no two of {} views overlap within {} m by {} correspondences", poses.size(),
                config.max_distance_m, config.min_correspondences);
  }
  return matches.rms_m;
}

Result<PoseComparison> RigidAlign(const ViewGraph& graph, const std::vector<Transform>& poses,
                                  const std::vector<Transform>& reference) {
  for (const std::vector<Transform>* set : {&poses, &reference}) {
    if (Status status = CheckPoses(graph, *set); !status) {
      return tl::unexpected<Error>(status.error());
    }
  }
  std::vector<std::vector<Eigen::Vector3d>> points;
  Eigen::Index count = 0;
  for (const View& view : graph.views) {
    points.push_back(SomePoints(view.range));
    if (points.back().empty()) return Fail("view {} ({}): no valid point", view.id, view.name);
    count += static_cast<Eigen::Index>(points.back().size());
  }
  Eigen::Matrix3Xd from(3, count);
  Eigen::Matrix3Xd to(3, count);
  Eigen::Index column = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (const Eigen::Vector3d& point : points[i]) {
      from.col(column) = poses[i] * point;
      to.col(column++) = reference[i] * point;
    }
  }
  PoseComparison out;
  out.T_reference_poses.matrix() = Eigen::umeyama(from, to, false);
  column = 0;
  for (const std::vector<Eigen::Vector3d>& view_points : points) {
    double sum = 0.0;
    for (std::size_t i = 0; i < view_points.size(); ++i, ++column) {
      sum += (out.T_reference_poses * from.col(column) - to.col(column)).squaredNorm();
    }
    out.rms_m.push_back(std::sqrt(sum / static_cast<double>(view_points.size())));
    out.max_rms_m = std::max(out.max_rms_m, out.rms_m.back());
  }
  return out;
}

}  // namespace fringe_fusion
