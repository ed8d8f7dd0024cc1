#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::sim {

/// Where a ray meets a triangle.
struct RayHit {
  int face = -1;  ///< faces of the part first, then those of the background
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, towards the ray's origin
};

/// Triangles of part and background in `object`, ready for ray queries from many threads.
/// Embree finds the triangle in single precision; point and normal come from the triangle's plane
/// in double precision.
class RayScene {
 public:
  /// @return error when a face names a vertex that is not there, a vertex is not finite, or there
  /// is no face at all.
  [[nodiscard]] static Result<RayScene> Create(const Mesh& part, const Mesh& background);
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(RayScene&&) noexcept;
  ~RayScene();

  /// First triangle along origin + t direction, t > 0. Both sides of a triangle are opaque.
  [[nodiscard]] std::optional<RayHit> Cast(const Eigen::Vector3d& origin,
                                           const Eigen::Vector3d& direction) const;

  /// Plane intersection of a ray with a known face, as Cast reports it.
  [[nodiscard]] RayHit Intersect(int face, const Eigen::Vector3d& origin,
                                 const Eigen::Vector3d& direction) const;

  /// True when nothing lies between a surface point and a device.
  /// @param normal of the surface, towards the side of the device; lifts the start off the
  /// surface.
  [[nodiscard]] bool Sees(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                          const Eigen::Vector3d& device) const;

  [[nodiscard]] int num_part_faces() const { return num_part_faces_; }
  /// Corners of a face.
  [[nodiscard]] Eigen::Matrix3d Corners(int face) const;
  /// Start offset of secondary rays [m].
  [[nodiscard]] double lift_m() const { return lift_m_; }

 private:
  struct Embree;
  RayScene();
  void Append(const Mesh& mesh);
  void Commit();

  std::unique_ptr<Embree> embree_;
  std::vector<Eigen::Vector3f> vertices_;
  std::vector<Eigen::Vector3i> faces_;
  int num_part_faces_ = 0;
  double lift_m_ = 0.0;
};

}  // namespace fringe_fusion::sim
