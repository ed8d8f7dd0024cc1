#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion {

/// The point of a surface that is nearest to a query.
struct NearestPoint {
  double distance_m = 0.0;  ///< signed: positive on the side that the normals point to
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  int face = -1;  ///< of the mesh given to Create
};

/// Closest point on a triangle, and where on it: 0 inside, 1..3 at that corner, 4..6 on the edge
/// from corner 1, 2, 3 to the next one.
struct TrianglePoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  int feature = 0;
};
[[nodiscard]] TrianglePoint ClosestOnTriangle(const Eigen::Vector3d& query,
                                              const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                              const Eigen::Vector3d& c);

/// Exact signed distance to a triangle mesh, answered from many threads at once.
/// Candidates come from Embree point queries, distances are computed in double precision. The sign
/// is that of the pseudo-normal of the nearest face, edge or vertex, which is right for any closed
/// mesh; beyond the border of an open one it continues the border's plane.
/// Ref: Baerentzen & Aanaes, Signed distance computation using the angle weighted pseudonormal,
/// IEEE TVCG 11(3), 2005.
class SurfaceDistance {
 public:
  /// Vertices of equal coordinates count as one, faces without area are left out.
  /// @return error for non-finite vertices, indices out of range, or no face with area.
  [[nodiscard]] static Result<SurfaceDistance> Create(const Mesh& mesh);
  SurfaceDistance(SurfaceDistance&&) noexcept;
  SurfaceDistance& operator=(SurfaceDistance&&) noexcept;
  ~SurfaceDistance();

  /// @return none when the surface is farther than max_distance_m, or the query is not finite.
  [[nodiscard]] std::optional<NearestPoint> Nearest(const Eigen::Vector3d& query,
                                                    double max_distance_m) const;

 private:
  struct Impl;
  explicit SurfaceDistance(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace fringe_fusion
