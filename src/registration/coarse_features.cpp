#include "coarse_features.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

namespace fringe_fusion::internal {
namespace {

constexpr int kBins = 11;

struct Neighbor {
  int index = 0;
  float distance = 0.0F;
};

// Angles of the Darboux frame of two oriented points, as three bins.
std::array<int, 3> BinsOf(const Eigen::Vector3f& p, const Eigen::Vector3f& n_p,
                          const Eigen::Vector3f& q, const Eigen::Vector3f& n_q) {
  const Eigen::Vector3f d = (q - p).normalized();
  // The point whose normal makes the smaller angle with the line is the source.
  const bool swap = std::abs(n_p.dot(d)) < std::abs(n_q.dot(d));
  const Eigen::Vector3f& u = swap ? n_q : n_p;
  const Eigen::Vector3f& n_t = swap ? n_p : n_q;
  const Eigen::Vector3f line = swap ? Eigen::Vector3f(-d) : d;
  Eigen::Vector3f v = u.cross(line);
  const float length = v.norm();
  if (length > 1e-6F) v /= length;
  const Eigen::Vector3f w = u.cross(v);
  const float alpha = v.dot(n_t);
  const float phi = u.dot(line);
  const float theta = std::atan2(w.dot(n_t), u.dot(n_t));
  const auto bin = [](float unit) {
    return std::clamp(static_cast<int>(unit * static_cast<float>(kBins)), 0, kBins - 1);
  };
  return {bin(0.5F * (alpha + 1.0F)), bin(0.5F * (phi + 1.0F)),
          bin(0.5F * (theta / static_cast<float>(M_PI) + 1.0F))};
}

void Thin(const ViewSurface& surface, double cell_m, FeatureCloud& cloud) {
  std::map<std::tuple<int, int, int>, std::size_t> cell_of;
  std::vector<int> counts;
  for (const SurfacePoint& point : surface.points()) {
    if (point.border) continue;
    const auto index = [&](int axis) {
      return static_cast<int>(std::floor(static_cast<double>(point.point[axis]) / cell_m));
    };
    // Opposite sides of a thin wall stay apart: the normal's strongest axis is part of the key.
    int axis = 0;
    point.normal.cwiseAbs().maxCoeff(&axis);
    const int side = 2 * axis + (point.normal[axis] > 0.0F ? 1 : 0);
    const auto [at, added] =
        cell_of.try_emplace({index(0), index(1), 8 * index(2) + side}, cloud.points.size());
    if (added) {
      cloud.points.emplace_back(Eigen::Vector3f::Zero());
      cloud.normals.emplace_back(Eigen::Vector3f::Zero());
      counts.push_back(0);
    }
    cloud.points[at->second] += point.point;
    cloud.normals[at->second] += point.normal;
    ++counts[at->second];
  }
  for (std::size_t i = 0; i < counts.size(); ++i) {
    cloud.points[i] /= static_cast<float>(counts[i]);
    cloud.normals[i].normalize();
  }
}

std::vector<Neighbor> NeighborsOf(const FeatureCloud& cloud, std::size_t i, float radius) {
  std::vector<Neighbor> neighbors;
  for (std::size_t k = 0; k < cloud.points.size(); ++k) {
    const float squared = (cloud.points[k] - cloud.points[i]).squaredNorm();
    if (k != i && squared < radius * radius) {
      neighbors.push_back({static_cast<int>(k), std::sqrt(squared)});
    }
  }
  return neighbors;
}

float SquaredDistance(const Feature& a, const Feature& b) {
  using Column = Eigen::Map<const Eigen::Matrix<float, kFeatureSize, 1>>;
  return (Column(a.data()) - Column(b.data())).squaredNorm();
}

}  // namespace

double FeatureCell(const SurfaceSet& set, int max_points) {
  std::vector<double> areas;
  for (const ViewSurface& surface : set.surfaces) {
    areas.push_back(surface.num_inner() * surface.spacing_m() * surface.spacing_m());
  }
  const auto middle = areas.begin() + static_cast<std::ptrdiff_t>(areas.size() / 2);
  std::nth_element(areas.begin(), middle, areas.end());
  return std::sqrt(*middle / max_points);
}

FeatureCloud MakeFeatures(const ViewSurface& surface, double cell_m, double radius_m) {
  FeatureCloud cloud;
  Thin(surface, cell_m, cloud);
  const std::size_t count = cloud.points.size();
  std::vector<std::vector<Neighbor>> neighbors(count);
  std::vector<Feature> simple(count, Feature{});
  for (std::size_t i = 0; i < count; ++i) {
    neighbors[i] = NeighborsOf(cloud, i, static_cast<float>(radius_m));
    const float share = 100.0F / static_cast<float>(std::max<std::size_t>(1, neighbors[i].size()));
    for (const Neighbor& one : neighbors[i]) {
      const auto k = static_cast<std::size_t>(one.index);
      const std::array<int, 3> bins =
          BinsOf(cloud.points[i], cloud.normals[i], cloud.points[k], cloud.normals[k]);
      for (std::size_t j = 0; j < 3; ++j) {
        simple[i][j * kBins + static_cast<std::size_t>(bins.at(j))] += share;
      }
    }
  }
  cloud.features.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    Feature sum{};
    float weights = 0.0F;
    for (const Neighbor& one : neighbors[i]) {
      const float weight = 1.0F / std::max(one.distance, 1e-9F);
      weights += weight;
      const Feature& of = simple[static_cast<std::size_t>(one.index)];
      for (std::size_t j = 0; j < kFeatureSize; ++j) sum[j] += weight * of[j];
    }
    for (std::size_t j = 0; j < kFeatureSize; ++j) {
      cloud.features[i][j] = simple[i][j] + (weights > 0.0F ? sum[j] / weights : 0.0F);
    }
  }
  return cloud;
}

std::vector<FeatureMatch> MatchFeatures(const FeatureCloud& first, const FeatureCloud& second,
                                        int count) {
  std::vector<FeatureMatch> matches;
  const auto search = [&](const FeatureCloud& from, const FeatureCloud& to, bool forwards) {
    std::vector<std::pair<float, int>> best;
    for (std::size_t i = 0; i < from.features.size(); ++i) {
      best.clear();
      for (std::size_t k = 0; k < to.features.size(); ++k) {
        best.emplace_back(SquaredDistance(from.features[i], to.features[k]), static_cast<int>(k));
      }
      const auto wanted = std::min(best.size(), static_cast<std::size_t>(count));
      std::partial_sort(best.begin(), best.begin() + static_cast<std::ptrdiff_t>(wanted),
                        best.end());
      for (std::size_t k = 0; k < wanted; ++k) {
        const auto here = static_cast<int>(i);
        matches.push_back(forwards ? FeatureMatch{here, best[k].second}
                                   : FeatureMatch{best[k].second, here});
      }
    }
  };
  search(first, second, true);
  search(second, first, false);
  return matches;
}

}  // namespace fringe_fusion::internal
