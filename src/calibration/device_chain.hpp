#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "fringe_fusion/geometry/transform.hpp"

/// A device (robot, turntable) between a camera and a target:
///
///   T_camera_target = T_camera_carrier G T_other_target,  G = T_base_flange Exp(correction)
///
/// or G its inverse where the flange carries the camera. Both ends are unknown, the corrections are
/// tied to zero by the accuracy of the device.
namespace fringe_fusion::chain {

constexpr int kNumLens = 9;  ///< fx fy cx cy k1 k2 p1 p2 k3 of the camera, where they are free
/// Right perturbations of T_camera_carrier and of T_other_target, then the lens.
constexpr int kNumEnds = 12 + kNumLens;
using EndVector = Eigen::Matrix<double, kNumEnds, 1>;
using EndMatrix = Eigen::Matrix<double, kNumEnds, kNumEnds>;
using EndCoupling = Eigen::Matrix<double, 6, kNumEnds>;
using LensVector = Eigen::Matrix<double, kNumLens, 1>;
using LensMatrix = Eigen::Matrix<double, kNumLens, kNumLens>;

/// Squared whitened residuals of a camera's measurement at a target pose, and their normal
/// equations in its right perturbation and in the lens, where points tell of it.
struct TargetTerms {
  Matrix6d hessian = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
  double cost = 0.0;
  Eigen::Matrix<double, 6, kNumLens> by_lens = Eigen::Matrix<double, 6, kNumLens>::Zero();
  LensMatrix lens_hessian = LensMatrix::Zero();
  LensVector lens_gradient = LensVector::Zero();
};
/// @param lens change of the lens from what was stated.
using TargetCost = std::function<TargetTerms(std::size_t pose, const Transform& T_camera_target,
                                             const LensVector& lens)>;

/// One pose of the device.
struct Link {
  Transform T_base_flange = Transform::Identity();
  Matrix6d information = Matrix6d::Zero();  ///< of the correction; zero rows: free
  double weight = 1.0;                      ///< 0: takes no part
};

struct Chain {
  bool in_hand = true;  ///< the flange carries the camera
  std::vector<Link> links;
  std::array<bool, kNumEnds> free{true, true, true, true, true, true,
                                  true, true, true, true, true, true};
  LensMatrix lens_information = LensMatrix::Zero();  ///< of the change of the lens

  [[nodiscard]] std::vector<Eigen::Index> FreeEnds() const;
};

struct ChainState {
  Transform T_camera_carrier = Transform::Identity();
  Transform T_other_target = Transform::Identity();
  std::vector<Transform> corrections;    ///< one per link
  LensVector lens = LensVector::Zero();  ///< change from what was stated
};

/// How a target pose moves: c = by_ends ends + by_correction correction, right perturbations.
struct LinkJacobian {
  EndCoupling by_ends = EndCoupling::Zero();
  Matrix6d by_correction = Matrix6d::Zero();
};

/// G of a link.
[[nodiscard]] Transform LinkMotion(const Chain& chain, std::size_t link,
                                   const Transform& correction);
[[nodiscard]] Transform PredictTarget(const Chain& chain, const ChainState& state,
                                      std::size_t link);
[[nodiscard]] LinkJacobian JacobianOf(const Chain& chain, const ChainState& state,
                                      std::size_t link);

/// d Log(T Exp(x)) / dx at x = 0, to second order in e = Log(T).
[[nodiscard]] Matrix6d LogJacobian(const Vector6d& e);

/// Levenberg-Marquardt over ends and corrections; these are eliminated link by link.
/// @return false when the start costs infinitely much or no step is finite.
[[nodiscard]] bool SolveChain(const Chain& chain, const TargetCost& target, ChainState& state,
                              int max_iterations);

struct ChainCovariance {
  EndMatrix ends = EndMatrix::Zero();     ///< zero rows: held
  std::vector<Matrix6d> corrections;      ///< zero for links that take no part
  double condition = 0.0;                 ///< of the reduced system, scaled to unit diagonal
  EndVector weakest = EndVector::Zero();  ///< direction of the largest relative uncertainty
};
/// @return nothing where the system is singular.
[[nodiscard]] std::optional<ChainCovariance> CovarianceOf(const Chain& chain,
                                                          const TargetCost& target,
                                                          const ChainState& state);

/// Squared norm of the corrections in units of their information.
[[nodiscard]] double CorrectionCost(const Link& link, const Transform& correction);

}  // namespace fringe_fusion::chain
