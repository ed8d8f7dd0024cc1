#include "fringe_fusion/triangulation/range_image.hpp"

#include <limits>

#include "common/constants.hpp"

namespace fringe_fusion {

Eigen::Vector3f DirectionToCamera(const LineOfSight& line_of_sight, const Eigen::Vector3f& point) {
  if (line_of_sight.directional) return line_of_sight.camera;
  return (line_of_sight.camera - point).normalized();
}

RangeImage MakeRangeImage(int width, int height) {
  RangeImage range;
  range.width = width;
  range.height = height;
  range.points = Image<Eigen::Vector3f>(width, height, Eigen::Vector3f::Constant(kNan));
  range.normals = Image<Eigen::Vector3f>(width, height, Eigen::Vector3f::Constant(kNan));
  range.color = Image<Rgb8>(width, height);
  range.sigma_range = Image<float>(width, height, kNan);
  range.sigma_lateral = Image<float>(width, height, kNan);
  return range;
}

bool IsValid(const RangeImage& range, int x, int y) { return range.points(x, y).allFinite(); }

int CountValid(const RangeImage& range) {
  int count = 0;
  for (const Eigen::Vector3f& point : range.points) count += point.allFinite() ? 1 : 0;
  return count;
}

}  // namespace fringe_fusion
