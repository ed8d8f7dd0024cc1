#include "device_figures.hpp"

#include <algorithm>
#include <cmath>

#include "common/constants.hpp"

namespace fringe_fusion::cli {

std::vector<Json> OutcomeFigures(const std::vector<DevicePoseOutcome>& poses) {
  std::vector<Json> figures;
  for (const DevicePoseOutcome& pose : poses) {
    Json figure;
    figure.Set("name", pose.name)
        .Set("used", pose.used)
        .Set("reason", pose.reason)
        .Set("rotation_miss_deg", kDegPerRad * pose.rotation_miss_rad)
        .Set("translation_miss_mm", 1e3 * pose.translation_miss_m)
        .Set("held_out_ratio", pose.held_out_ratio)
        .Set("num_points", pose.num_points)
        .Set("num_points_rejected", pose.num_rejected_points)
        .Set("rms_px", pose.rms_px);
    figures.push_back(std::move(figure));
  }
  return figures;
}

void PrintOutcomes(const std::vector<DevicePoseOutcome>& poses) {
  for (const DevicePoseOutcome& pose : poses) {
    if (!pose.used) {
      fmt::print("{}: left out: {}\n", pose.name, pose.reason);
      continue;
    }
    fmt::print("{}: misses by {:.4f} deg, {:.4f} mm", pose.name,
               kDegPerRad * pose.rotation_miss_rad, 1e3 * pose.translation_miss_m);
    // Registered views have poses, but no points of a target.
    if (pose.num_points > 0) {
      fmt::print("; {} points, rms {:.3f} px", pose.num_points, pose.rms_px);
    }
    fmt::print("\n");
  }
}

std::string PoseWords(const Transform& T, const Matrix6d& covariance) {
  const Eigen::Vector3d t = T.translation();
  const Eigen::Vector3d r = kDegPerRad * LogRotation(T.linear());
  const Vector6d sigma = covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  return fmt::format(
      "translation {:.6f} {:.6f} {:.6f} m, rotation vector {:.4f} {:.4f} {:.4f} deg; +- {:.4f} "
      "{:.4f} {:.4f} mm, {:.4f} {:.4f} {:.4f} deg",
      t.x(), t.y(), t.z(), r.x(), r.y(), r.z(), 1e3 * sigma[3], 1e3 * sigma[4], 1e3 * sigma[5],
      kDegPerRad * sigma[0], kDegPerRad * sigma[1], kDegPerRad * sigma[2]);
}

Json PoseFigure(const Transform& T, const Matrix6d& covariance) {
  const Eigen::Vector3d t = T.translation();
  const Eigen::Vector4d q = QuaternionXyzw(T);
  constexpr std::array<const char*, 4> kAxes = {"x", "y", "z", "w"};
  Json figure;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const std::string axis = kAxes[static_cast<std::size_t>(i)];
    figure.Set("translation_m_" + axis, t[i])
        .Set("sigma_translation_m_" + axis, std::sqrt(std::max(0.0, covariance(3 + i, 3 + i))))
        .Set("sigma_rotation_rad_" + axis, std::sqrt(std::max(0.0, covariance(i, i))));
  }
  for (Eigen::Index i = 0; i < 4; ++i) {
    figure.Set(std::string("quaternion_") + kAxes[static_cast<std::size_t>(i)], q[i]);
  }
  return figure;
}

tl::unexpected<Error> NotWritten(const std::string& path, const Verdict& verdict) {
  return Fail("{}: not written, {} (--force writes it all the same)", path,
              fmt::join(verdict.reasons, "; "));
}

Result<std::vector<TargetSighting>> SightingsOf(const std::vector<std::string>& names,
                                                const std::vector<TargetSighting>& sightings,
                                                const std::string& file) {
  std::vector<TargetSighting> ordered;
  for (const std::string& name : names) {
    const auto found =
        std::find_if(sightings.begin(), sightings.end(),
                     [&](const TargetSighting& sighting) { return sighting.name == name; });
    if (found == sightings.end()) return Fail("{}: has no sighting named '{}'", file, name);
    ordered.push_back(*found);
  }
  for (const TargetSighting& sighting : sightings) {
    if (std::find(names.begin(), names.end(), sighting.name) == names.end()) {
      fmt::print("skipped: sighting '{}' belongs to no pose of the device\n", sighting.name);
    }
  }
  return ordered;
}

}  // namespace fringe_fusion::cli
