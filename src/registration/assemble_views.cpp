#include "fringe_fusion/registration/assemble_views.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "at.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "pair_search.hpp"

namespace fringe_fusion {
namespace {

using internal::FeatureCloud;
using internal::Hypothesis;

constexpr std::size_t kMaxChecked = 400;  // samples of a view for one check
constexpr double kConflictPenalty = 8.0;  // points in agreement that one in conflict outweighs
constexpr double kConflictRatio = 3.0;    // of the agreement distance, in front of the other
constexpr float kMinCosine = 0.866F;
constexpr std::size_t kMaxJoins = 6;  // hypotheses compared for every join
constexpr int kBatch = 16;            // pairs between two reports of progress

struct OneWay {
  double samples = 0.0;
  double agree = 0.0;
  double conflict = 0.0;
};

OneWay CheckOneWay(const ViewSurface& source, const ViewSurface& target,
                   const Transform& T_target_source, double distance_m) {
  const Eigen::Matrix3f R = T_target_source.linear().cast<float>();
  const Eigen::Vector3f t = T_target_source.translation().cast<float>();
  const auto distance = static_cast<float>(distance_m);
  const float radius = distance + 1.5F * static_cast<float>(target.target_spacing_m(0));
  const std::vector<int>& samples = source.samples(0);
  const std::size_t stride = std::max<std::size_t>(1, samples.size() / kMaxChecked);
  OneWay out;
  for (std::size_t i = 0; i < samples.size(); i += stride) {
    const SurfacePoint& from = source.points()[At(samples[i])];
    const Eigen::Vector3f point = R * from.point + t;
    const Eigen::Vector3f normal = R * from.normal;
    out.samples += 1.0;
    const auto in_front = target.InFront(point);
    if (in_front && *in_front > static_cast<float>(kConflictRatio) * distance) {
      out.conflict += 1.0;
      continue;
    }
    if (!target.FacesSensor(point, normal)) continue;
    const int nearest = target.Nearest(point, radius, 0);
    if (nearest < 0) continue;
    const SurfacePoint& to = target.points()[At(nearest)];
    if (to.border || !(to.normal.dot(normal) > kMinCosine)) continue;
    if (std::abs(to.normal.dot(point - to.point)) < distance) out.agree += 1.0;
  }
  return out;
}

/// Groups of views that grow together.
class Groups {
 public:
  Groups(const SurfaceSet& set, const AssemblyConfig& config, double distance_m)
      : set_(set), config_(config), distance_m_(distance_m) {
    poses_.assign(set.surfaces.size(), Transform::Identity());
    for (std::size_t i = 0; i < poses_.size(); ++i) group_.push_back(static_cast<int>(i));
  }

  // Joins the pairs of a list, the best first, until none is left that fits.
  void Grow(std::vector<Hypothesis> list) {
    while (true) {
      list.erase(std::remove_if(list.begin(), list.end(),
                                [&](const Hypothesis& one) {
                                  return group_[At(one.first)] == group_[At(one.second)];
                                }),
                 list.end());
      const std::size_t count = std::min(list.size(), kMaxJoins);
      if (count == 0) return;
      std::vector<double> evidence(count, 0.0);
      ParallelFor(static_cast<int>(count), 1, [&](int begin, int end) {
        for (int i = begin; i < end; ++i) evidence[At(i)] = EvidenceOf(list[At(i)]);
      });
      const auto best = static_cast<std::size_t>(
          std::max_element(evidence.begin(), evidence.end()) - evidence.begin());
      if (evidence[best] > 0.0) {
        Join(list[best]);
      } else {
        list.erase(list.begin(), list.begin() + static_cast<std::ptrdiff_t>(count));
      }
    }
  }

  [[nodiscard]] Assembly Finish() const {
    Assembly out;
    std::map<int, int> sizes;
    for (const int group : group_) ++sizes[group];
    std::vector<int> order;
    for (const auto& entry : sizes) order.push_back(entry.first);
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return sizes.at(a) > sizes.at(b); });
    out.num_groups = static_cast<int>(order.size());
    out.T_object_camera = poses_;
    out.group.assign(group_.size(), 0);
    for (std::size_t k = 0; k < order.size(); ++k) {
      const auto first = static_cast<std::size_t>(
          std::find(group_.begin(), group_.end(), order[k]) - group_.begin());
      for (std::size_t i = 0; i < group_.size(); ++i) {
        if (group_[i] != order[k]) continue;
        out.group[i] = static_cast<int>(k);
        out.T_object_camera[i] = poses_[first].inverse() * poses_[i];
      }
    }
    return out;
  }

 private:
  [[nodiscard]] Transform Between(const Hypothesis& one) const {
    return poses_[At(one.first)] * one.T_first_second * poses_[At(one.second)].inverse();
  }

  // Of all pairs of views that a join brings together; negative: it cannot be.
  [[nodiscard]] double EvidenceOf(const Hypothesis& one) const {
    const Transform T = Between(one);
    double sum = 0.0;
    for (std::size_t a = 0; a < group_.size(); ++a) {
      if (group_[a] != group_[At(one.first)]) continue;
      for (std::size_t b = 0; b < group_.size(); ++b) {
        if (group_[b] != group_[At(one.second)]) continue;
        const PairCheck check = CheckPair(set_.surfaces[a], set_.surfaces[b],
                                          poses_[a].inverse() * T * poses_[b], distance_m_);
        if (!(check.conflict_ratio <= 3.0 * config_.max_conflict_ratio)) return -1.0;
        sum += check.evidence;
      }
    }
    return sum;
  }

  void Join(const Hypothesis& one) {
    const Transform T = Between(one);
    const int from = group_[At(one.second)];
    const int to = group_[At(one.first)];
    for (std::size_t i = 0; i < group_.size(); ++i) {
      if (group_[i] != from) continue;
      poses_[i] = T * poses_[i];
      group_[i] = to;
    }
  }

  const SurfaceSet& set_;
  const AssemblyConfig& config_;
  double distance_m_;
  std::vector<Transform> poses_;
  std::vector<int> group_;
};

}  // namespace

PairCheck CheckPair(const ViewSurface& first, const ViewSurface& second,
                    const Transform& T_first_second, double distance_m) {
  const OneWay a = CheckOneWay(first, second, T_first_second.inverse(), distance_m);
  const OneWay b = CheckOneWay(second, first, T_first_second, distance_m);
  PairCheck check;
  check.overlap_ratio = std::max(a.agree / a.samples, b.agree / b.samples);
  check.conflict_ratio = std::max(a.conflict / a.samples, b.conflict / b.samples);
  check.evidence = a.agree + b.agree - kConflictPenalty * (a.conflict + b.conflict);
  return check;
}

double TotalEvidence(const SurfaceSet& set, const std::vector<Transform>& poses,
                     const std::vector<int>& group, double distance_m) {
  const std::vector<PairNumbers> pairs = AllPairs(static_cast<int>(poses.size()));
  std::vector<double> evidence(pairs.size(), 0.0);
  ParallelFor(static_cast<int>(pairs.size()), 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const auto a = At(pairs[At(i)].first);
      const auto b = At(pairs[At(i)].second);
      if (group[a] != 0 || group[b] != 0) continue;
      evidence[At(i)] =
          CheckPair(set.surfaces[a], set.surfaces[b], poses[a].inverse() * poses[b], distance_m)
              .evidence;
    }
  });
  double sum = 0.0;
  for (const double one : evidence) sum += one;
  return sum;
}

double AgreementDistance(const SurfaceSet& set, const AssemblyConfig& config) {
  return internal::AgreementDistance(set, internal::FeatureCell(set, config.max_points_per_view));
}

Result<Assembly> AssembleViews(const SurfaceSet& set, const AssemblyConfig& config,
                               const std::vector<Transform>& starts, const Progress& progress) {
  if (Status status = CheckBounds(config, "assembly"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const auto num_views = static_cast<int>(set.surfaces.size());
  if (num_views < 2) return Fail("assembly: {} view(s) given, at least 2 needed", num_views);
  const double cell_m = internal::FeatureCell(set, config.max_points_per_view);
  const double distance_m = internal::AgreementDistance(set, cell_m);
  std::vector<FeatureCloud> clouds(set.surfaces.size());
  ParallelFor(num_views, 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      clouds[At(i)] =
          internal::MakeFeatures(set.surfaces[At(i)], cell_m, config.feature_radius_cells * cell_m);
    }
  });
  const std::vector<PairNumbers> pairs = AllPairs(num_views);
  std::vector<std::vector<Hypothesis>> found(pairs.size());
  const auto num_pairs = static_cast<int>(pairs.size());
  for (int batch = 0; batch < num_pairs; batch += kBatch) {
    if (!progress("assemble", static_cast<double>(batch) / num_pairs))
      return Fail("{}", kCancelled);
    ParallelFor(std::min(kBatch, num_pairs - batch), 1, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        found[At(batch + i)] =
            internal::SearchPair(set, clouds, pairs[At(batch + i)], config, cell_m);
      }
    });
  }
  std::vector<Hypothesis> list;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (!starts.empty()) {
      const auto a = At(pairs[k].first);
      const auto b = At(pairs[k].second);
      const Transform T = starts[a].inverse() * starts[b];
      const PairCheck check = CheckPair(set.surfaces[a], set.surfaces[b], T, distance_m);
      found[k].push_back({pairs[k].first, pairs[k].second, T, check});
    }
    for (const Hypothesis& one : found[k]) {
      if (one.check.overlap_ratio >= config.min_overlap_ratio &&
          one.check.conflict_ratio <= config.max_conflict_ratio) {
        list.push_back(one);
      }
    }
  }
  std::stable_sort(list.begin(), list.end(), [](const Hypothesis& a, const Hypothesis& b) {
    return a.check.evidence > b.check.evidence;
  });
  Groups groups(set, config, distance_m);
  groups.Grow(std::move(list));
  Assembly out = groups.Finish();
  out.evidence = TotalEvidence(set, out.T_object_camera, out.group, distance_m);
  static_cast<void>(progress("assemble", 1.0));
  return out;
}

}  // namespace fringe_fusion
