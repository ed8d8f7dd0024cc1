#include "surface_samples.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace fringe_fusion::internal {

Result<SurfaceSamples> SurfaceSamples::Create(const Mesh& mesh,
                                              const std::vector<std::uint8_t>& use_face,
                                              double spacing_m) {
  constexpr double kMaxSamples = 2e8;
  SurfaceSamples samples;
  samples.mesh_ = &mesh;
  samples.cumulative_m2_.reserve(mesh.faces.size());
  double area = 0.0;
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const Eigen::Vector3i& face = mesh.faces[i];
    const auto corner = [&](int k) -> Eigen::Vector3d {
      return mesh.vertices[static_cast<std::size_t>(face[k])].cast<double>();
    };
    if (use_face.empty() || use_face[i] != 0) {
      area += 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    }
    samples.cumulative_m2_.push_back(area);
  }
  if (!(area > 0.0)) return Fail("no face to be sampled has an area");
  const double count = std::max(1.0, std::round(area / (spacing_m * spacing_m)));
  if (!(count <= kMaxSamples)) {
    return Fail("{} m2 at sample_spacing_m = {} need {:.3g} samples, limit {:.0e}", area, spacing_m,
                count, kMaxSamples);
  }
  samples.count_ = static_cast<int>(count);
  return samples;
}

Eigen::Vector3d SurfaceSamples::At(int sample) const {
  const double share = (sample + 0.5) * cumulative_m2_.back() / count_;
  const auto found = std::lower_bound(cumulative_m2_.begin(), cumulative_m2_.end(), share);
  const auto index = static_cast<std::size_t>(std::min(
      found - cumulative_m2_.begin(), static_cast<std::ptrdiff_t>(cumulative_m2_.size()) - 1));
  // Additive recurrence of the plastic number: even over the unit square for any run of samples.
  constexpr double kAlpha1 = 0.7548776662466927;
  constexpr double kAlpha2 = 0.5698402909980532;
  const double walk_s = 0.5 + sample * kAlpha1;
  const double walk_t = 0.5 + sample * kAlpha2;
  double s = walk_s - std::floor(walk_s);
  double t = walk_t - std::floor(walk_t);
  // The upper half of the square folds onto the triangle.
  if (s + t > 1.0) {
    s = 1.0 - s;
    t = 1.0 - t;
  }
  const Eigen::Vector3i& face = mesh_->faces[index];
  const auto corner = [&](int k) -> Eigen::Vector3d {
    return mesh_->vertices[static_cast<std::size_t>(face[k])].cast<double>();
  };
  return corner(0) + s * (corner(1) - corner(0)) + t * (corner(2) - corner(0));
}

}  // namespace fringe_fusion::internal
