#include "view_samples.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::sim {
namespace {

constexpr int kGrain = 8;  // image rows per chunk

// True when two neighbouring pixels show different things: a silhouette or crease (the one's point
// is off the other's tangent plane by more than 20 degrees), a shadow border, another albedo.
class EdgeTest {
 public:
  EdgeTest(const Image<SurfaceSample>& samples, const Image<RayHit>& hits)
      : samples_(samples), hits_(hits) {}

  [[nodiscard]] bool IsEdge(int x, int y) const {
    for (const auto& [dx, dy] :
         {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
      if (samples_.Contains(x + dx, y + dy) && Differ(x, y, x + dx, y + dy)) return true;
    }
    return false;
  }

 private:
  [[nodiscard]] bool Differ(int x, int y, int x_other, int y_other) const {
    const SurfaceSample& a = samples_(x, y);
    const SurfaceSample& b = samples_(x_other, y_other);
    if ((a.face < 0) != (b.face < 0)) return true;
    if (a.face < 0) return false;
    if (a.lit != b.lit || a.albedo != b.albedo) return true;
    const RayHit& hit_a = hits_(x, y);
    const RayHit& hit_b = hits_(x_other, y_other);
    const Eigen::Vector3d apart = hit_b.point - hit_a.point;
    constexpr double kSine = 0.34;
    const double limit = kSine * apart.norm();
    return std::abs(hit_a.normal.dot(apart)) > limit || std::abs(hit_b.normal.dot(apart)) > limit;
  }

  const Image<SurfaceSample>& samples_;
  const Image<RayHit>& hits_;
};

std::vector<EdgePixel> FindEdges(const Image<SurfaceSample>& samples, const Image<RayHit>& hits) {
  const EdgeTest test(samples, hits);
  const int height = samples.height();
  std::vector<std::vector<EdgePixel>> rows(static_cast<std::size_t>(height));
  ParallelFor(height, kGrain, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < samples.width(); ++x) {
        if (test.IsEdge(x, y)) {
          rows[static_cast<std::size_t>(y)].push_back({y * samples.width() + x, 0});
        }
      }
    }
  });
  std::vector<EdgePixel> edges;
  for (const std::vector<EdgePixel>& row : rows) edges.insert(edges.end(), row.begin(), row.end());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    edges[i].first = static_cast<std::int32_t>(i) * kEdgeSamples;
  }
  return edges;
}

}  // namespace

Image<Eigen::Vector2d> PixelRays(const CameraModel& camera) {
  Image<Eigen::Vector2d> rays(camera.width, camera.height, Eigen::Vector2d::Zero());
  ParallelFor(camera.height, kGrain, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < camera.width; ++x) rays(x, y) = Undistort(camera, Eigen::Vector2d(x, y));
    }
  });
  return rays;
}

RayHit CastPixel(const RayScene& scene, const Transform& T_object_camera,
                 const Eigen::Vector2d& normalized) {
  if (!normalized.allFinite()) return {};
  const Eigen::Vector3d direction =
      T_object_camera.linear() * Eigen::Vector3d(normalized.x(), normalized.y(), 1.0);
  return scene.Cast(T_object_camera.translation(), direction).value_or(RayHit{});
}

ViewSamples CastView(const RayScene& scene, const Shader& shader, const CameraModel& camera,
                     const Image<Eigen::Vector2d>& rays, const Transform& T_object_camera) {
  ViewSamples view;
  view.centers = Image<SurfaceSample>(camera.width, camera.height);
  Image<RayHit> hits(camera.width, camera.height);
  const auto cast = [&](const Eigen::Vector2d& normalized, RayHit& hit) {
    hit = CastPixel(scene, T_object_camera, normalized);
    if (hit.face < 0) return SurfaceSample{};
    return shader.Shade(hit, T_object_camera.translation(), true);
  };
  ParallelFor(camera.height, kGrain, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < camera.width; ++x) view.centers(x, y) = cast(rays(x, y), hits(x, y));
    }
  });
  view.edges = FindEdges(view.centers, hits);
  view.edge_samples.resize(view.edges.size() * kEdgeSamples);
  ParallelFor(static_cast<int>(view.edges.size()), 256, [&](int begin, int end) {
    RayHit hit;
    for (int i = begin; i < end; ++i) {
      const EdgePixel& edge = view.edges[static_cast<std::size_t>(i)];
      const Eigen::Vector2d center(edge.pixel % camera.width, edge.pixel / camera.width);
      for (int k = 0; k < kEdgeSamples; ++k) {
        const Eigen::Vector2d offset((k % 3 - 1) / 3.0, (k / 3 - 1) / 3.0);
        view.edge_samples[static_cast<std::size_t>(edge.first + k)] =
            cast(Undistort(camera, center + offset), hit);
      }
    }
  });
  for (const SurfaceSample& sample : view.centers) {
    view.max_defocus_px2 = std::max(view.max_defocus_px2, sample.lit ? sample.defocus_px2 : 0.0F);
  }
  return view;
}

}  // namespace fringe_fusion::sim
