#include "interreflection.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "common/constants.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "random.hpp"

namespace fringe_fusion::sim {
namespace {

constexpr int kGridStep = 8;  // pixels between receivers
constexpr int kRings = 8;     // directions in elevation
constexpr int kSectors = 16;  // directions in azimuth

// Columns span the surface, the third is the normal.
Eigen::Matrix3d SurfaceFrame(const Eigen::Vector3d& normal) {
  Eigen::Matrix3d frame;
  frame.col(0) = normal.unitOrthogonal();
  frame.col(1) = normal.cross(frame.col(0));
  frame.col(2) = normal;
  return frame;
}

}  // namespace

Interreflection::Interreflection(const RayScene& scene, const Shader& shader,
                                 const ViewSamples& view, const Image<Eigen::Vector2d>& rays,
                                 const Transform& T_object_camera) {
  const int width = view.centers.width();
  const int height = view.centers.height();
  Image<RayHit> hits(width, height);
  ParallelFor(height, 8, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < width; ++x) {
        const int face = view.centers(x, y).face;
        if (face < 0) continue;
        const Eigen::Vector3d direction = T_object_camera.linear() * rays(x, y).homogeneous();
        hits(x, y) = scene.Intersect(face, T_object_camera.translation(), direction);
      }
    }
  });
  MakeReceivers(hits);
  ParallelFor(static_cast<int>(receivers_.size()), 64, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      Gather(scene, shader, receivers_[static_cast<std::size_t>(i)], i);
    }
  });
}

void Interreflection::MakeReceivers(const Image<RayHit>& hits) {
  grid_width_ = (hits.width() - 1) / kGridStep + 1;
  grid_height_ = (hits.height() - 1) / kGridStep + 1;
  for (int j = 0; j < grid_height_; ++j) {
    for (int i = 0; i < grid_width_; ++i) {
      receivers_.push_back({hits(i * kGridStep, j * kGridStep), {}});
    }
  }
  blends_ = Image<Blend>(hits.width(), hits.height());
  for (int y = 0; y < hits.height(); ++y) {
    for (int x = 0; x < hits.width(); ++x) {
      const RayHit& hit = hits(x, y);
      if (hit.face < 0 || BlendGrid(hit, x, y, blends_(x, y))) continue;
      blends_(x, y) = Blend{};
      blends_(x, y).receiver[0] = static_cast<std::int32_t>(receivers_.size());
      blends_(x, y).share[0] = 1.0F;
      receivers_.push_back({hit, {}});
    }
  }
}

bool Interreflection::BlendGrid(const RayHit& hit, int x, int y, Blend& blend) const {
  float sum = 0.0F;
  for (std::size_t k = 0; k < 4; ++k) {
    const int i = x / kGridStep + static_cast<int>(k % 2);
    const int j = y / kGridStep + static_cast<int>(k / 2);
    if (i >= grid_width_ || j >= grid_height_) continue;
    const int index = j * grid_width_ + i;
    const RayHit& other = receivers_[static_cast<std::size_t>(index)].hit;
    if (other.face < 0) continue;
    const Eigen::Vector3d apart = other.point - hit.point;
    // Another surface: turned by more than 20 degrees, or off this one's tangent plane.
    if (hit.normal.dot(other.normal) < 0.94) continue;
    if (std::abs(hit.normal.dot(apart)) > 0.25 * apart.norm() + 1e-6) continue;
    const double near_x = 1.0 - std::abs(x - i * kGridStep) / static_cast<double>(kGridStep);
    const double near_y = 1.0 - std::abs(y - j * kGridStep) / static_cast<double>(kGridStep);
    blend.receiver[k] = index;
    blend.share[k] = static_cast<float>(near_x * near_y);
    sum += blend.share[k];
  }
  if (!(sum > 0.1F)) return false;
  for (float& share : blend.share) share /= sum;
  return true;
}

void Interreflection::Gather(const RayScene& scene, const Shader& shader, Receiver& receiver,
                             int index) const {
  if (receiver.hit.face < 0) return;
  const Eigen::Matrix3d frame = SurfaceFrame(receiver.hit.normal);
  const Eigen::Vector3d start = receiver.hit.point + scene.lift_m() * receiver.hit.normal;
  // Cosine-weighted strata, shifted from receiver to receiver so that no pattern shows.
  const RandomStream random(RandomUse::kGather, {index});
  constexpr double kShare = 1.0 / (kRings * kSectors);
  for (int k = 0; k < kRings * kSectors; ++k) {
    const int ring = k / kSectors;
    const auto counter = static_cast<std::uint64_t>(k) * 2U;
    const double sine_squared = (ring + random.Uniform(counter)) / kRings;
    const double azimuth = 2.0 * kPi * (k % kSectors + random.Uniform(counter + 1)) / kSectors;
    const double sine = std::sqrt(sine_squared);
    const Eigen::Vector3d local(sine * std::cos(azimuth), sine * std::sin(azimuth),
                                std::sqrt(1.0 - sine_squared));
    const auto hit = scene.Cast(start, frame * local);
    if (!hit) continue;
    const SurfaceSample sample = shader.Shade(*hit, start, false);
    if (!sample.lit) continue;
    // The mean of the radiance over cosine-weighted directions is the irradiance over pi.
    receiver.emitters.push_back(
        {sample.u, sample.v, static_cast<float>(kShare * sample.direct), sample.defocus_px2});
  }
}

Image<float> Interreflection::Irradiance(const ProjectedLight& light, float max_defocus_px2) const {
  std::vector<float> gathered(receivers_.size(), 0.0F);
  ParallelFor(static_cast<int>(receivers_.size()), 256, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      for (const Emitter& e : receivers_[i].emitters) {
        gathered[i] +=
            e.weight *
            light.Sample(e.u, e.v, ProjectedLight::Level(e.defocus_px2, max_defocus_px2));
      }
    }
  });
  Image<float> irradiance(blends_.width(), blends_.height());
  ParallelFor(static_cast<int>(blends_.size()), 8192, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      for (std::size_t k = 0; k < 4; ++k) {
        irradiance[i] +=
            blends_[i].share[k] * gathered[static_cast<std::size_t>(blends_[i].receiver[k])];
      }
    }
  });
  return irradiance;
}

}  // namespace fringe_fusion::sim
