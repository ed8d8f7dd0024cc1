#include "surface_fit.hpp"

#include <cmath>

namespace fringe_fusion::internal {

Surface PlaneSurface(const PointSums& sums) {
  const Eigen::Vector3d gradient = sums.normal / sums.weight;
  return {static_cast<float>(-sums.offset_normal / sums.weight), gradient.cast<float>()};
}

Surface SphereSurface(const PointSums& sums) {
  const double weight = sums.weight;
  const Eigen::Vector3d& s1 = sums.offset;
  const Eigen::Vector3d& s2 = sums.normal;
  const double spread = sums.offset_squared - s1.squaredNorm() / weight;
  // Samples closer together than a fraction of a voxel carry no curvature.
  constexpr double kMinSpread = 0.05;
  if (!(spread > kMinSpread * weight)) return PlaneSurface(sums);
  const double u4 = (sums.offset_normal - s1.dot(s2) / weight) / (2.0 * spread);
  const Eigen::Vector3d u = (s2 - 2.0 * u4 * s1) / weight;
  const double u0 = -(u.dot(s1) + u4 * sums.offset_squared) / weight;
  const double discriminant = u.squaredNorm() - 4.0 * u0 * u4;
  // A sphere of less than a voxel's radius, or one the voxel sits in the middle of, is no surface.
  constexpr double kMaxCurvature = 0.5;
  if (!(discriminant > 0.25 * u.squaredNorm()) || !(std::abs(u4) < kMaxCurvature * u.norm())) {
    return PlaneSurface(sums);
  }
  const double distance = 2.0 * u0 / (u.norm() + std::sqrt(discriminant));
  return {static_cast<float>(distance), u.normalized().cast<float>()};
}

double CentroidOffset(const PointSums& sums) {
  const Eigen::Vector3d centroid = sums.offset / sums.weight;
  const Eigen::Vector3d normal = sums.normal.normalized();
  return (centroid - normal * normal.dot(centroid)).norm();
}

PointSums SumsAt(const KernelSums& sums, int voxel) {
  const auto vector_at = [&](const std::array<Channel, 3>& channels) {
    return Eigen::Vector3f(channels[0][voxel], channels[1][voxel], channels[2][voxel])
        .cast<double>()
        .eval();
  };
  return {static_cast<double>(sums.weight[voxel]), vector_at(sums.offset), vector_at(sums.normal),
          static_cast<double>(sums.offset_normal[voxel]),
          static_cast<double>(sums.offset_squared[voxel])};
}

}  // namespace fringe_fusion::internal
