#include "point_sums.hpp"

#include <algorithm>
#include <cmath>

#include "kernel_sums.hpp"

namespace fringe_fusion::internal {
namespace {

struct Place {
  Eigen::Vector3d position;
  std::array<int, 3> low;  // blocks within reach
  std::array<int, 3> high;
};

Place MakePlace(const Eigen::Vector3d& position, double radius) {
  Place place{position, {}, {}};
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    place.low[a] = FloorDivide(static_cast<int>(std::floor(position[axis] - radius)), kBlockSize);
    place.high[a] = FloorDivide(static_cast<int>(std::floor(position[axis] + radius)), kBlockSize);
  }
  return place;
}

// Adds one view; returns its weight.
double AddSamples(const Place& place, const Eigen::Vector3f& normal, const ViewSamples& view,
                  PointField& field) {
  const SampleSet& set = view.levels[0];
  const double radius2 = view.radius_voxels * view.radius_voxels;
  const double width = view.radius_voxels / static_cast<double>(kRadiusInWidths);
  double added = 0.0;
  const auto add = [&](const Sample& sample, const Eigen::Vector3d& gap) {
    const double gap2 = gap.squaredNorm();
    if (!(gap2 < radius2)) return;
    const double taper = 1.0 - gap2 / radius2;
    double k = std::exp(-gap2 / (2.0 * width * width)) * taper * taper;
    if (normal != Eigen::Vector3f::Zero()) {
      const float cosine = normal.dot(sample.normal) / kFullAgreementCosine;
      k *= static_cast<double>(std::clamp(cosine, 0.0F, 1.0F));
    }
    const double w = k * static_cast<double>(sample.weight);
    const Eigen::Vector3d n = sample.normal.cast<double>();
    field.sums.weight += w;
    field.sums.offset += w * gap;
    field.sums.normal += w * n;
    field.sums.offset_normal += w * (gap.dot(n) + static_cast<double>(sample.offset_normal));
    field.sums.offset_squared += w * (gap2 + static_cast<double>(sample.offset_squared));
    field.variance += k * k * static_cast<double>(sample.weight_variance);
    added += w;
  };
  for (int x = place.low[0]; x <= place.high[0]; ++x) {
    for (int y = place.low[1]; y <= place.high[1]; ++y) {
      const BlockKey first = PackBlock(x, y, place.low[2]);
      const BlockKey last = PackBlock(x, y, place.high[2]);
      auto run = std::lower_bound(set.runs.begin(), set.runs.end(), first,
                                  [](const SampleRun& r, BlockKey key) { return r.block < key; });
      for (; run->block <= last; ++run) {
        const std::array<int, 3> block = UnpackBlock(run->block);
        const Eigen::Vector3d from =
            Eigen::Vector3d(block[0], block[1], block[2]) * kBlockSize - place.position;
        for (std::uint32_t i = run->begin; i < (run + 1)->begin; ++i) {
          add(set.samples[i], set.samples[i].position.cast<double>() + from);
        }
      }
    }
  }
  return added;
}

}  // namespace

PointField SumAtPoint(const Eigen::Vector3d& position, const Eigen::Vector3f& normal,
                      const std::vector<const ViewSamples*>& views, double voxel_m) {
  PointField field;
  double shared = 0.0;
  for (const ViewSamples* view : views) {
    const Place place = MakePlace(position, view->radius_voxels);
    const double weight = AddSamples(place, normal, *view, field);
    if (!(weight > 0.0)) continue;
    field.view_ids.push_back(view->id);
    if (!view->has_pose_covariance) continue;
    const Eigen::Vector3d mean_normal = field.sums.normal.normalized();
    shared += weight * weight *
              PoseVariance(view->pose_covariance, view->T_camera_object * (position * voxel_m),
                           view->T_camera_object.linear() * mean_normal);
  }
  if (field.sums.weight > 0.0) {
    field.pose_variance = shared / (field.sums.weight * field.sums.weight);
  }
  return field;
}

}  // namespace fringe_fusion::internal
