#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/pose/view.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::bench {

/// Names of the closed objects of the fusion proof. The shapes, the views and the seeds were fixed
/// before any setting of the fusion was chosen with them:
///   knot   trefoil tube, tube radius 7 mm: occlusion from every side
///   fins   heat sink with fins of 0.8, 1.2, 1.6, 2.4 and 4 mm: thin parts and sharp edges
///   gear   24 radial teeth around a bore: sharp edges, narrow gaps
///   cup    wall of 1.2 mm with a round rim: thin part seen from both sides
///   blade  twisted wing with a trailing edge of 0.6 mm: thin edge, flat and curved parts
///   ripple ball with waves of 7 mm length and 0.5 mm height: high curvature everywhere
[[nodiscard]] const std::vector<std::string>& ProofObjectNames();

/// One of ProofObjectNames(), or a mesh file in metres.
[[nodiscard]] Result<Mesh> MakeProofObject(const std::string& name_or_path);

/// An object, what 14 pinhole cameras measured of it, and which part of it they could see.
struct ProofScene {
  Mesh truth;
  std::vector<View> views;  ///< exact poses, normals estimated from the noisy points
  double focal_px = 0.0;
  int image_px = 0;  ///< width and height
};

/// Where the cameras stand: rings around the vertical, five radii away, one after another.
struct CameraRing {
  int count = 0;
  double elevation_deg = 0.0;
};
struct ProofCameras {
  std::vector<CameraRing> rings{{6, 12.0}, {5, 42.0}, {3, 72.0}};
  int image_px = 520;       ///< width and height
  unsigned noise_seed = 0;  ///< other noise on the same rays
};

/// Renders the views: noise along the ray of `sigma_m`, nothing seen from below, no point where a
/// ray meets the inner side of a face.
/// @return error when the object is not usable.
[[nodiscard]] Result<ProofScene> RenderProof(Mesh truth, double sigma_m,
                                             const ProofCameras& cameras = {});

/// Points spread evenly on a mesh, with the normals of their faces.
struct SurfacePoints {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> normals;
};
[[nodiscard]] SurfacePoints SpreadPoints(const Mesh& mesh, std::size_t count);

/// Which points at least one camera of the scene sees at less than 75 deg.
[[nodiscard]] Result<std::vector<bool>> SeenPoints(const ProofScene& scene,
                                                   const SurfacePoints& points);

}  // namespace fringe_fusion::bench
