#pragma once

#include <optional>
#include <vector>

#include "fringe_fusion/geometry/transform.hpp"

namespace fringe_fusion::chain {

/// Two motions of one rigid body, seen from two frames a and b of it: A X = X B with X = T_a_b.
struct MotionPair {
  Transform A = Transform::Identity();
  Transform B = Transform::Identity();
};

/// All pairs of poses, less those of half turns, whose rotation vector has no sign, and those that
/// hardly turn. @param T_camera_target, T_carrier_other of the same length: G of device_chain.
[[nodiscard]] std::vector<MotionPair> MotionPairs(const std::vector<Transform>& T_camera_target,
                                                  const std::vector<Transform>& T_carrier_other);

/// X of A X = X B: rotation from the rotation vectors, R_X = argmin sum |alpha - R beta|^2, then
/// translation by least squares.
/// @return nothing for parallel axes.
/// Ref: Park & Martin, TRA 10(5), 1994, eq. 18 and 24; for vectors of equal length their
/// (M^T M)^-1/2 M^T is Kabsch's rotation.
[[nodiscard]] std::optional<Transform> ParkMartin(const std::vector<MotionPair>& motions);

/// X of A X = X B, rotation and translation at once, from the null space of the dual quaternions'
/// vector parts.
/// @return nothing for parallel axes.
/// Ref: Daniilidis, IJRR 18(3), 1999, eq. 31 and 33-35.
[[nodiscard]] std::optional<Transform> DualQuaternion(const std::vector<MotionPair>& motions);

}  // namespace fringe_fusion::chain
