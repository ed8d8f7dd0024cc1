#include "fringe_fusion/registration/match_views.hpp"

#include <algorithm>
#include <cmath>

#include "at.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion {
namespace {

constexpr double kMadToSigma = 1.4826;  // of a Gaussian
constexpr double kHuber = 1.345;        // 95 % efficient for a Gaussian

// Median of |values|, scaled to a standard deviation; 0 for none.
double RobustSigma(std::vector<float>& magnitudes) {
  if (magnitudes.empty()) return 0.0;
  const auto middle = magnitudes.begin() + static_cast<std::ptrdiff_t>(magnitudes.size() / 2);
  std::nth_element(magnitudes.begin(), middle, magnitudes.end());
  return kMadToSigma * static_cast<double>(*middle);
}

std::vector<Match> SearchOneWay(const ViewSurface& source, const ViewSurface& target,
                                const Transform& T_target_source, const MatchLimits& limits) {
  const Eigen::Matrix3f R = T_target_source.linear().cast<float>();
  const Eigen::Vector3f t = T_target_source.translation().cast<float>();
  const auto radius = static_cast<float>(limits.radius_m);
  const auto min_cosine = static_cast<float>(std::cos(limits.max_normal_angle_rad));
  const int margin_px = target.margin_px(limits.level);
  std::vector<Match> matches;
  for (const int i : source.samples(limits.level)) {
    const SurfacePoint& from = source.points()[At(i)];
    const Eigen::Vector3f point = R * from.point + t;
    const Eigen::Vector3f normal = R * from.normal;
    // The target's sensor cannot have measured a surface that faces away from it.
    if (!target.FacesSensor(point, normal)) continue;
    const int nearest = target.Nearest(point, radius, limits.level);
    if (nearest < 0) continue;
    const SurfacePoint& to = target.points()[At(nearest)];
    if (to.border_px < margin_px || !(to.normal.dot(normal) >= min_cosine)) continue;
    Match match;
    match.source = i;
    match.target = nearest;
    matches.push_back(match);
  }
  return matches;
}

void SetResiduals(ViewPair& pair, bool from_first, const SurfaceSet& set,
                  const std::vector<Transform>& poses) {
  const ViewSurface& source = set.surfaces[At(from_first ? pair.first : pair.second)];
  const ViewSurface& target = set.surfaces[At(from_first ? pair.second : pair.first)];
  for (Match& match : from_first ? pair.from_first : pair.from_second) {
    const double residual = ComputeMatch(pair, match, from_first, set, poses).residual_m;
    const double variance =
        source.points()[At(match.source)].variance + target.points()[At(match.target)].variance;
    match.residual_m = static_cast<float>(residual);
    match.normalized = static_cast<float>(residual / std::sqrt(variance));
    match.weight = static_cast<float>(1.0 / variance);
  }
}

// Robust scale of the pair, rejection of what lies beyond it, Huber weights of the rest.
void RejectOutliers(ViewPair& pair, const MatchLimits& limits, double scale_floor) {
  std::vector<float> normalized;
  std::vector<float> metric;
  for (const std::vector<Match>* matches : {&pair.from_first, &pair.from_second}) {
    for (const Match& match : *matches) {
      normalized.push_back(std::abs(match.normalized));
      metric.push_back(std::abs(match.residual_m));
    }
  }
  pair.scale = RobustSigma(normalized);
  pair.scale_m = RobustSigma(metric);
  const double scale = std::max(scale_floor, pair.scale);
  const auto limit = static_cast<float>(limits.rejection_mad * scale);
  const auto huber = static_cast<float>(kHuber * scale);
  for (std::vector<Match>* matches : {&pair.from_first, &pair.from_second}) {
    matches->erase(
        std::remove_if(matches->begin(), matches->end(),
                       [&](const Match& match) { return !(std::abs(match.normalized) <= limit); }),
        matches->end());
    for (Match& match : *matches) {
      const float size = std::abs(match.normalized);
      if (size > huber) match.weight *= huber / size;
    }
  }
}

bool HasOverlap(const ViewPair& pair, const SurfaceSet& set, const MatchLimits& limits,
                bool counted) {
  const ViewSurface& first = set.surfaces[At(pair.first)];
  const ViewSurface& second = set.surfaces[At(pair.second)];
  const auto count = [&](const ViewSurface& surface, int level) {
    return static_cast<double>(surface.samples(level).size());
  };
  const double ratio_first =
      static_cast<double>(pair.from_first.size()) / count(first, limits.level);
  const double ratio_second =
      static_cast<double>(pair.from_second.size()) / count(second, limits.level);
  const int finest = ViewSurface::kNumLevels - 1;
  const double share = (count(first, limits.level) + count(second, limits.level)) /
                       (count(first, finest) + count(second, finest));
  const double relief = counted ? 0.5 : 1.0;
  const double needed = std::max(6.0, relief * share * limits.min_correspondences);
  const auto found = static_cast<double>(pair.from_first.size() + pair.from_second.size());
  return found >= needed &&
         std::max(ratio_first, ratio_second) >= relief * limits.min_overlap_ratio;
}

// A point seen by K views yields K-1 residuals that share its noise, and each pair is searched from
// both sides. With weights c/K the sum over all pairs carries just the information of the points
// used: c = 1 if every point is a sample, and c -> K if so few are that no point is used twice.
double UseFactor(int num_partners, double sampled_ratio) {
  const double views = num_partners + 1.0;
  const double used = 1.0 - std::pow(1.0 - std::min(1.0, sampled_ratio), views);
  return used / (std::min(1.0, sampled_ratio) * views);
}

void WeightRepeatedUse(MatchSet& matches, const SurfaceSet& set, int level) {
  std::vector<std::vector<int>> partners(set.surfaces.size());
  for (std::size_t i = 0; i < partners.size(); ++i) {
    partners[i].assign(set.surfaces[i].points().size(), 0);
  }
  const auto for_each_side = [&](const auto& action) {
    for (ViewPair& pair : matches.pairs) {
      if (!pair.counts) continue;
      for (Match& match : pair.from_first) action(pair.first, match);
      for (Match& match : pair.from_second) action(pair.second, match);
    }
  };
  for_each_side([&](int view, Match& match) { ++partners[At(view)][At(match.source)]; });
  std::vector<std::vector<float>> factors(set.surfaces.size());
  for (std::size_t i = 0; i < factors.size(); ++i) {
    const ViewSurface& surface = set.surfaces[i];
    const double ratio = static_cast<double>(surface.samples(level).size()) /
                         static_cast<double>(surface.num_inner());
    for (std::size_t k = 0; k <= set.surfaces.size(); ++k) {
      factors[i].push_back(static_cast<float>(UseFactor(static_cast<int>(k), ratio)));
    }
  }
  for_each_side([&](int view, Match& match) {
    match.weight *= factors[At(view)][At(partners[At(view)][At(match.source)])];
  });
}

void Summarize(MatchSet& matches) {
  std::vector<float> normalized;
  double sum = 0.0;
  for (const ViewPair& pair : matches.pairs) {
    if (!pair.counts) continue;
    for (const std::vector<Match>* side : {&pair.from_first, &pair.from_second}) {
      for (const Match& match : *side) {
        normalized.push_back(std::abs(match.normalized));
        sum += static_cast<double>(match.residual_m) * static_cast<double>(match.residual_m);
      }
    }
  }
  if (!normalized.empty()) matches.rms_m = std::sqrt(sum / static_cast<double>(normalized.size()));
  matches.scale = RobustSigma(normalized);
}

}  // namespace

std::vector<PairNumbers> AllPairs(int num_views) {
  std::vector<PairNumbers> pairs;
  for (int i = 0; i < num_views; ++i) {
    for (int k = i + 1; k < num_views; ++k) pairs.push_back({i, k, false});
  }
  return pairs;
}

MatchGeometry ComputeMatch(const ViewPair& pair, const Match& match, bool from_first,
                           const SurfaceSet& set, const std::vector<Transform>& poses) {
  const SurfacePoint& first =
      set.surfaces[At(pair.first)].points()[At(from_first ? match.source : match.target)];
  const SurfacePoint& second =
      set.surfaces[At(pair.second)].points()[At(from_first ? match.target : match.source)];
  const Transform& T_object_first = poses[At(pair.first)];
  const Transform& T_object_second = poses[At(pair.second)];
  const Eigen::Vector3d point_first = T_object_first * first.point.cast<double>();
  const Eigen::Vector3d point_second = T_object_second * second.point.cast<double>();
  const Eigen::Vector3d normal_first = T_object_first.linear() * first.normal.cast<double>();
  const Eigen::Vector3d normal_second = T_object_second.linear() * second.normal.cast<double>();
  MatchGeometry out;
  out.middle = 0.5 * (point_first + point_second);
  if (pair.symmetric) {
    out.normal = normal_first + normal_second;
    const double length = out.normal.norm();
    out.normal /= length;
    out.difference = (normal_first - normal_second) / length;
  } else {
    out.normal = from_first ? normal_second : normal_first;
    out.difference = (normal_first - normal_second) * std::sqrt(0.5);
  }
  out.residual_m = out.normal.dot(point_first - point_second);
  return out;
}

double ScaleFloor(const SurfaceSet& set) { return set.sigma_known ? 1.0 : 1e-9; }

MatchSet MatchViews(const SurfaceSet& set, const std::vector<Transform>& poses,
                    const std::vector<PairNumbers>& pairs, const MatchLimits& limits) {
  MatchSet out;
  out.pairs.resize(pairs.size());
  ParallelFor(static_cast<int>(2 * pairs.size()), 1, [&](int begin, int end) {
    for (int task = begin; task < end; ++task) {
      const PairNumbers& numbers = pairs[At(task / 2)];
      const bool from_first = task % 2 == 0;
      const int source = from_first ? numbers.first : numbers.second;
      const int target = from_first ? numbers.second : numbers.first;
      const Transform T_target_source = poses[At(target)].inverse() * poses[At(source)];
      ViewPair& pair = out.pairs[At(task / 2)];
      (from_first ? pair.from_first : pair.from_second) =
          SearchOneWay(set.surfaces[At(source)], set.surfaces[At(target)], T_target_source, limits);
    }
  });
  ParallelFor(static_cast<int>(pairs.size()), 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      ViewPair& pair = out.pairs[At(i)];
      pair.first = pairs[At(i)].first;
      pair.second = pairs[At(i)].second;
      pair.symmetric = limits.symmetric;
      SetResiduals(pair, true, set, poses);
      SetResiduals(pair, false, set, poses);
      RejectOutliers(pair, limits, ScaleFloor(set));
      pair.counts = HasOverlap(pair, set, limits, pairs[At(i)].counted);
    }
  });
  WeightRepeatedUse(out, set, limits.level);
  Summarize(out);
  return out;
}

}  // namespace fringe_fusion
