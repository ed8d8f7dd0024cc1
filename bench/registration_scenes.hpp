#pragma once

#include <array>
#include <string>
#include <vector>

#include "bench/proof_objects.hpp"
#include "bench/registration_bound.hpp"
#include "fringe_fusion/registration/register_views.hpp"

namespace fringe_fusion::bench {

/// Views to be registered. The objects, the cameras, the noise, the disturbances and the seeds were
/// fixed before any setting of the registration was chosen with them.
struct RegistrationScene {
  std::string name;
  ViewGraph graph;  ///< at the reference poses
  std::vector<Transform> T_object_camera_reference;
  bool exact = true;  ///< the reference is the truth; false: published poses of real scans
  Mesh truth;         ///< of a simulated part
  PinholeGrid grid;   ///< of its views
};

/// Five simulated parts of 160 mm diameter and the ten range scans of the Stanford bunny:
///   knot   trefoil tube: occlusion from every side
///   fins   heat sink: many parallel planes, a period of 25 to 33 mm
///   blade  twisted wing: thin, few features
///   bumpy  star-shaped body with bumps of 10 %
///   hare   the published mesh of the bunny, rendered
///   bunny  the real scans
/// Each part is seen by ten cameras of 260 x 260 px, six at 15 and four at 50 deg above the
/// horizon, with noise of 0.05 mm along the ray and normals estimated from the noisy points.
[[nodiscard]] const std::vector<std::string>& RegistrationSceneNames();

/// @param data_folder that holds stanford_bunny/, for `hare` and `bunny`.
[[nodiscard]] Result<RegistrationScene> MakeRegistrationScene(const std::string& name,
                                                              const std::string& data_folder);

/// One of the parts by other cameras or with other noise; 0: the exact points.
inline constexpr double kPartSigmaM = 5e-5;
[[nodiscard]] ProofCameras RegistrationCameras();
[[nodiscard]] Result<RegistrationScene> MakePartScene(const std::string& name,
                                                      const std::string& data_folder,
                                                      const ProofCameras& cameras, double sigma_m);

/// How far every view is moved from its reference: turned about the middle of all points around a
/// random axis, and shifted in a random direction.
struct Disturbance {
  double angle_deg = 0.0;
  double shift_m = 0.0;
};
inline constexpr std::array<Disturbance, 3> kDisturbances = {
    {{2.0, 0.002}, {5.0, 0.010}, {10.0, 0.020}}};
inline constexpr int kNumSeeds = 20;  ///< 1 to 20

/// Poses of one start.
[[nodiscard]] std::vector<Transform> DisturbedPoses(const RegistrationScene& scene,
                                                    const Disturbance& disturbance, unsigned seed);

/// A start has converged when no view is farther (rms over its points, after one rigid alignment
/// of all) from its reference than this.
inline constexpr double kConvergedM = 0.001;

}  // namespace fringe_fusion::bench
