#include <algorithm>
#include <cmath>
#include <limits>

#include "cell_data.hpp"

namespace fringe_fusion::bundle {
namespace {

/// Median distance between seen and predicted projector pixels over all poses [px].
double MedianMiss(const CellData& data, const DeviceStart& camera, const DeviceStart& projector,
                  const Transform& T_projector_camera) {
  std::vector<double> misses;
  for (std::size_t i = 0; i < data.stations.size(); ++i) {
    if (!camera.T_device_target[i]) continue;
    const Transform T = T_projector_camera * *camera.T_device_target[i];
    for (const Observation& seen : data.stations[i].seen[kProjector]) {
      const Eigen::Vector3d point = T * data.points[static_cast<std::size_t>(seen.point)];
      const double miss = (Project(projector.model, point) - seen.pixel).norm();
      misses.push_back(std::isfinite(miss) ? miss : std::numeric_limits<double>::max());
    }
  }
  if (misses.empty()) return std::numeric_limits<double>::max();
  const auto middle = misses.begin() + static_cast<std::ptrdiff_t>(misses.size() / 2);
  std::nth_element(misses.begin(), middle, misses.end());
  return *middle;
}

/// Every pose states the pose of the devices; the one that fits most points wins.
std::optional<Transform> ChooseDevicePose(const CellData& data, const DeviceStart& camera,
                                          const DeviceStart& projector) {
  std::optional<Transform> best;
  double best_miss = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < data.stations.size(); ++i) {
    if (!camera.T_device_target[i] || !projector.T_device_target[i]) continue;
    const Transform T = *projector.T_device_target[i] * camera.T_device_target[i]->inverse();
    const double miss = MedianMiss(data, camera, projector, T);
    if (miss >= best_miss) continue;
    best_miss = miss;
    best = T;
  }
  return best;
}

}  // namespace

Result<State> StartCell(const CellData& data, const DeviceSizes& sizes) {
  const auto camera = StartDevice(data, kCamera, sizes.camera_width, sizes.camera_height, false);
  if (!camera) return Forward(camera);
  const auto projector =
      StartDevice(data, kProjector, sizes.projector_width, sizes.projector_height, true);
  if (!projector) return Forward(projector);
  const auto T_projector_camera = ChooseDevicePose(data, *camera, *projector);
  if (!T_projector_camera) return Fail("no pose is seen by camera and projector");
  State state;
  state.devices = {camera->model, projector->model};
  state.T_projector_camera = *T_projector_camera;
  state.points_target = data.points;
  for (std::size_t b = 0; b < data.nominal_shifts.size(); ++b) {
    PoseBlock block;
    block.shifts_m = data.nominal_shifts[b];
    // Any usable station of the block: on a stage the target has moved by its shift.
    for (std::size_t i = 0; i < data.stations.size(); ++i) {
      const Station& station = data.stations[i];
      if (station.block != b || !camera->T_device_target[i]) continue;
      block.T_camera_target = *camera->T_device_target[i];
      if (station.shift >= 0) {
        block.T_camera_target.translate(-block.shifts_m[static_cast<std::size_t>(station.shift)]);
      }
      break;
    }
    state.blocks.push_back(std::move(block));
  }
  return state;
}

}  // namespace fringe_fusion::bundle
