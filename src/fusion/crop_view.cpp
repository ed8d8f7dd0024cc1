#include <Eigen/Core>
#include <limits>

#include "common/constants.hpp"
#include "fringe_fusion/fusion/implicit_model.hpp"

namespace fringe_fusion {
namespace {

using Box = std::array<double, 3>;

Status CheckBox(const char* name, const Box& low, const Box& high) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(low[axis] < high[axis])) {
      return Fail("crop: {}_min_m[{}] = {} must be below {}_max_m[{}] = {}", name, axis, low[axis],
                  name, axis, high[axis]);
    }
  }
  return {};
}

Status Check(const CropConfig& config) {
  if (Status status = CheckBounds(config, "crop"); !status) return status;
  if (config.crop_box) {
    if (Status status = CheckBox("box", config.box_min_m, config.box_max_m); !status) return status;
  }
  if (config.remove_fixture) {
    if (Status status = CheckBox("fixture", config.fixture_min_m, config.fixture_max_m); !status) {
      return status;
    }
  }
  const double length = Eigen::Map<const Eigen::Vector3d>(config.plane_normal.data()).norm();
  if (config.remove_plane && !(std::abs(length - 1.0) <= 1e-3)) {
    return Fail("crop: plane_normal has the length {}, it must be 1 within 0.001", length);
  }
  return {};
}

bool IsInside(const Eigen::Vector3d& point, const Box& low, const Box& high) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double value = point[static_cast<int>(axis)];
    if (!(value >= low[axis] && value <= high[axis])) return false;
  }
  return true;
}

void Invalidate(RangeImage& range, std::size_t i) {
  range.points[i].setConstant(kNan);
  if (i < range.normals.size()) range.normals[i].setConstant(kNan);
  if (i < range.sigma_range.size()) range.sigma_range[i] = kNan;
  if (i < range.sigma_lateral.size()) range.sigma_lateral[i] = kNan;
}

}  // namespace

Result<CropResult> CropView(const View& view, const CropConfig& config) {
  if (Status status = Check(config); !status) return Forward(status);
  if (!view.pose.T_object_camera.matrix().allFinite()) {
    return Fail("view {} ({}): pose has a value that is not finite", view.id, view.name);
  }
  CropResult result;
  result.view = view;
  const Eigen::Map<const Eigen::Vector3d> normal(config.plane_normal.data());
  for (std::size_t i = 0; i < view.range.points.size(); ++i) {
    if (!view.range.points[i].allFinite()) continue;
    const Eigen::Vector3d point = view.pose.T_object_camera * view.range.points[i].cast<double>();
    // A point counts under the first reason that drops it.
    if (config.crop_box && !IsInside(point, config.box_min_m, config.box_max_m)) {
      ++result.num_outside_box;
    } else if (config.remove_plane &&
               !(normal.dot(point) > config.plane_offset_m + config.plane_margin_m)) {
      ++result.num_on_plane;
    } else if (config.remove_fixture &&
               IsInside(point, config.fixture_min_m, config.fixture_max_m)) {
      ++result.num_on_fixture;
    } else {
      ++result.num_kept;
      continue;
    }
    Invalidate(result.view.range, i);
  }
  return result;
}

}  // namespace fringe_fusion
