#include "variational_points.hpp"

#include <tbb/parallel_sort.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "border_taper.hpp"
#include "common/median.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/triangulation/point_spacing.hpp"
#include "view_samples.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr int kCoordinateBits = 21;
constexpr int kMaxCells = (1 << kCoordinateBits) - 1;

// Sums of the points of one centre.
struct Group {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  std::vector<std::uint32_t> members;
};

std::vector<Group> GroupByHalfSpace(const std::vector<MeasuredPoint>& points,
                                    const std::uint32_t* begin, const std::uint32_t* end) {
  std::vector<Group> groups;
  for (const std::uint32_t* i = begin; i != end; ++i) {
    const Eigen::Vector3d normal = points[*i].normal.cast<double>();
    Group* chosen = nullptr;
    double best = 0.0;
    for (Group& group : groups) {
      const double agreement = group.normal.normalized().dot(normal);
      if (agreement > best) {
        best = agreement;
        chosen = &group;
      }
    }
    if (chosen == nullptr) {
      groups.emplace_back();
      chosen = &groups.back();
    }
    chosen->normal += normal;
    chosen->members.push_back(*i);
  }
  return groups;
}

void AppendGroup(const std::vector<MeasuredPoint>& points, const Group& group,
                 MergedPoints& merged) {
  const Eigen::Vector3d origin = points[group.members.front()].position.cast<double>();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  Eigen::Vector3d color = Eigen::Vector3d::Zero();
  double weight = 0.0;
  double along = 0.0;
  std::uint16_t last_view = 0;
  int num_views = 0;
  for (const std::uint32_t i : group.members) {
    const MeasuredPoint& point = points[i];
    const double w = 1.0 / std::pow(static_cast<double>(point.sigma), 2);
    const Eigen::Vector3d from = point.position.cast<double>() - origin;
    const Eigen::Vector3d n = point.normal.cast<double>();
    weight += w;
    position += w * from;
    normal += w * n;
    along += w * from.dot(n);
    color += w * Eigen::Vector3d(point.color.r, point.color.g, point.color.b);
    if (num_views == 0 || point.view != last_view) ++num_views;
    last_view = point.view;
  }
  position /= weight;
  along = along / weight - position.dot(normal) / weight;
  color /= weight;
  Center center;
  center.position = (origin + position).cast<float>();
  center.normal = normal.normalized().cast<float>();
  center.sigma = static_cast<float>(1.0 / std::sqrt(weight));
  // f(position) = -along / 2; the point of the surface itself is nearer to the truth than a value
  // off it, because noise lowers the slope of f.
  center.position += static_cast<float>(0.5 * along) * center.normal;
  merged.centers.push_back(center);
  const auto channel = [&](int c) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(color[c], 0.0, 255.0)));
  };
  merged.colors.push_back({channel(0), channel(1), channel(2)});
  merged.num_views.push_back(static_cast<std::uint8_t>(std::min(num_views, 255)));
}

// What is around some of the points, within a radius.
struct Places {
  std::vector<double> density;    // points per area [1/m^2]
  std::vector<double> precision;  // mean of 1 / sigma^2 [1/m^2]
};

Places Around(const std::vector<MeasuredPoint>& points, double radius) {
  constexpr std::size_t kPlaces = 256;
  constexpr std::size_t kMinPoints = 5;
  const PointGrid grid(points, radius);
  const std::size_t step = std::max<std::size_t>(1, points.size() / kPlaces);
  Places places;
  for (std::size_t i = 0; i < points.size(); i += step) {
    const MeasuredPoint& at = points[i];
    std::size_t count = 0;
    double precision = 0.0;
    for (const std::uint32_t k : grid.Within(at.position, static_cast<float>(radius))) {
      const Eigen::Vector3f from = points[k].position - at.position;
      if (from.squaredNorm() >= static_cast<float>(radius * radius)) continue;
      if (!(points[k].normal.dot(at.normal) > 0.0F)) continue;
      ++count;
      precision += 1.0 / std::pow(static_cast<double>(points[k].sigma), 2);
    }
    if (count < kMinPoints) continue;
    places.density.push_back(static_cast<double>(count) / (M_PI * radius * radius));
    places.precision.push_back(precision / static_cast<double>(count));
  }
  return places;
}

double NoiseOfPoint(const View& view, std::size_t i, double min_sigma_m) {
  const RangeImage& range = view.range;
  const Eigen::Vector3f to_camera = DirectionToCamera(range.line_of_sight, range.points[i]);
  const auto cosine = static_cast<double>(range.normals[i].dot(to_camera));
  const double along = static_cast<double>(range.sigma_range[i]);
  const double across = static_cast<double>(range.sigma_lateral[i]);
  const double cosine2 = std::min(1.0, cosine * cosine);
  if (!(cosine > 0.0)) return -1.0;
  double variance = along * along * cosine2 + across * across * (1.0 - cosine2);
  if (view.pose.covariance.diagonal().maxCoeff() > 0.0) {
    variance += PoseVariance(view.pose.covariance, range.points[i].cast<double>(),
                             range.normals[i].cast<double>());
  }
  return std::max(variance, min_sigma_m * min_sigma_m);
}

}  // namespace

std::vector<MeasuredPoint> UsablePoints(const std::vector<MeasuredPoint>& points,
                                        double min_sigma_m) {
  std::vector<MeasuredPoint> usable;
  usable.reserve(points.size());
  for (const MeasuredPoint& point : points) {
    const float length = point.normal.norm();
    if (!point.position.allFinite() || !(length > 0.0F) || !std::isfinite(length)) continue;
    if (!(point.sigma >= 0.0F) || !std::isfinite(point.sigma)) continue;
    usable.push_back(point);
    usable.back().normal /= length;
    usable.back().sigma = std::max(point.sigma, static_cast<float>(min_sigma_m));
  }
  return usable;
}

PointGrid::PointGrid(const std::vector<MeasuredPoint>& points, double cell_m)
    : points_(&points), low_(Eigen::Vector3f::Zero()), cell_m_(static_cast<float>(cell_m)) {
  Eigen::AlignedBox3f box;
  for (const MeasuredPoint& point : points) box.extend(point.position);
  if (points.empty()) return;
  low_ = box.min();
  cell_m_ = std::max({cell_m_, box.sizes().maxCoeff() / static_cast<float>(kMaxCells), 1e-12F});
  std::vector<std::pair<std::uint64_t, std::uint32_t>> sorted(points.size());
  ParallelFor(static_cast<int>(points.size()), 4096, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      sorted[i] = {KeyOf(points[i].position), static_cast<std::uint32_t>(i)};
    }
  });
  tbb::parallel_sort(sorted.begin(), sorted.end());
  order_.reserve(points.size());
  for (const auto& [key, index] : sorted) {
    if (keys_.empty() || keys_.back() != key) {
      keys_.push_back(key);
      begins_.push_back(static_cast<std::uint32_t>(order_.size()));
    }
    order_.push_back(index);
  }
  begins_.push_back(static_cast<std::uint32_t>(order_.size()));
}

std::uint64_t PointGrid::KeyOf(const Eigen::Vector3f& position) const {
  std::uint64_t key = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto cell = static_cast<int>((position[axis] - low_[axis]) / cell_m_);
    key = (key << kCoordinateBits) | static_cast<std::uint64_t>(std::clamp(cell, 0, kMaxCells));
  }
  return key;
}

std::vector<std::uint32_t> PointGrid::Within(const Eigen::Vector3f& middle, float half) const {
  std::vector<std::uint32_t> found;
  const auto cell = [&](int axis, float side) {
    const float at = (middle[axis] + side * half - low_[axis]) / cell_m_;
    return static_cast<std::uint64_t>(std::clamp(at, 0.0F, static_cast<float>(kMaxCells)));
  };
  for (std::uint64_t x = cell(0, -1.0F); x <= cell(0, 1.0F); ++x) {
    for (std::uint64_t y = cell(1, -1.0F); y <= cell(1, 1.0F); ++y) {
      const std::uint64_t row = ((x << kCoordinateBits) | y) << kCoordinateBits;
      const std::uint64_t last = row | cell(2, 1.0F);
      auto key = std::lower_bound(keys_.begin(), keys_.end(), row | cell(2, -1.0F));
      for (; key != keys_.end() && *key <= last; ++key) {
        const auto c = static_cast<std::size_t>(key - keys_.begin());
        for (std::uint32_t i = begins_[c]; i < begins_[c + 1]; ++i) {
          const Eigen::Vector3f from = (*points_)[order_[i]].position - middle;
          if (from.cwiseAbs().maxCoeff() <= half) found.push_back(order_[i]);
        }
      }
    }
  }
  return found;
}

void AppendMerged(const std::vector<MeasuredPoint>& points, const std::uint32_t* begin,
                  const std::uint32_t* end, MergedPoints& merged) {
  for (const Group& group : GroupByHalfSpace(points, begin, end)) {
    AppendGroup(points, group, merged);
  }
}

MergedPoints MergePoints(const std::vector<MeasuredPoint>& points, const PointGrid& grid) {
  const auto num_cells = static_cast<int>(grid.begins().size()) - 1;
  constexpr int kGrain = 512;
  std::vector<MergedPoints> chunks(static_cast<std::size_t>(std::max(0, num_cells) / kGrain + 1));
  ParallelFor(num_cells, kGrain, [&](int begin, int end) {
    MergedPoints& chunk = chunks[static_cast<std::size_t>(begin / kGrain)];
    for (auto c = static_cast<std::size_t>(begin); c < static_cast<std::size_t>(end); ++c) {
      const std::uint32_t* first = grid.order().data();
      AppendMerged(points, first + grid.begins()[c], first + grid.begins()[c + 1], chunk);
    }
  });
  MergedPoints all;
  for (const MergedPoints& chunk : chunks) {
    all.centers.insert(all.centers.end(), chunk.centers.begin(), chunk.centers.end());
    all.colors.insert(all.colors.end(), chunk.colors.begin(), chunk.colors.end());
    all.num_views.insert(all.num_views.end(), chunk.num_views.begin(), chunk.num_views.end());
  }
  return all;
}

MergedPoints KeepPoints(const std::vector<MeasuredPoint>& points) {
  MergedPoints kept;
  for (const MeasuredPoint& point : points) {
    kept.centers.push_back({point.position, point.normal, point.sigma, 0.0F});
    kept.colors.push_back(point.color);
  }
  kept.num_views.assign(points.size(), 1);
  return kept;
}

SurfaceDensity MeasureDensity(const std::vector<MeasuredPoint>& points) {
  Eigen::AlignedBox3f box;
  for (const MeasuredPoint& point : points) box.extend(point.position);
  SurfaceDensity measured;
  // A first guess from the box; each round counts within a radius that should hold 30 points.
  measured.spacing_m = static_cast<double>(box.diagonal().norm()) /
                       std::sqrt(static_cast<double>(std::max<std::size_t>(points.size(), 1)));
  constexpr int kRounds = 3;
  constexpr double kPointsWithin = 30.0;
  for (int round = 0; round < kRounds && measured.spacing_m > 0.0; ++round) {
    const Places places = Around(points, measured.spacing_m * std::sqrt(kPointsWithin / M_PI));
    if (places.density.empty()) {
      measured.spacing_m *= 4.0;
      continue;
    }
    measured.spacing_m = 1.0 / std::sqrt(Median(places.density));
    measured.sigma_m = 1.0 / std::sqrt(Median(places.precision));
  }
  return measured;
}

}  // namespace fringe_fusion::internal

namespace fringe_fusion {

Result<std::vector<MeasuredPoint>> MeasuredPoints(const std::vector<View>& views,
                                                  const VariationalConfig& config) {
  std::vector<MeasuredPoint> points;
  std::uint16_t number = 0;
  for (const View& view : views) {
    if (Status status = Validate(view); !status) return tl::unexpected<Error>(status.error());
    const RangeImage& range = view.range;
    const double step_m = std::max(config.voxel_m, internal::PointSpacing(range));
    const Image<float> taper = internal::BorderTaper(range, config.border_taper_px, step_m);
    for (std::size_t i = 0; i < range.points.size(); ++i) {
      if (!range.points[i].allFinite() || !range.normals[i].allFinite()) continue;
      constexpr float kMinTaper = 1e-3F;
      if (!(taper[i] > kMinTaper)) continue;
      const double variance = internal::NoiseOfPoint(view, i, config.min_sigma_m);
      if (!(variance > 0.0) || !std::isfinite(variance)) continue;
      MeasuredPoint point;
      point.position = (view.pose.T_object_camera * range.points[i].cast<double>()).cast<float>();
      point.normal =
          (view.pose.T_object_camera.linear() * range.normals[i].cast<double>()).cast<float>();
      point.sigma = static_cast<float>(std::sqrt(variance / static_cast<double>(taper[i])));
      point.view = number;
      point.color = range.color[i];
      points.push_back(point);
    }
    ++number;
  }
  return points;
}

}  // namespace fringe_fusion
