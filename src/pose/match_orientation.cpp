#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "fringe_fusion/pose/match.hpp"

namespace fringe_fusion {
namespace {

/// Sums of an affine fit observed = J anchor + b over one patch.
struct PatchSums {
  double n = 0.0;
  Eigen::Vector2d a = Eigen::Vector2d::Zero();
  Eigen::Vector2d o = Eigen::Vector2d::Zero();
  Eigen::Matrix2d aa = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d oa = Eigen::Matrix2d::Zero();

  void Add(const Match& match) {
    n += 1.0;
    a += match.anchor_px;
    o += match.observed_px;
    aa += match.anchor_px * match.anchor_px.transpose();
    oa += match.observed_px * match.anchor_px.transpose();
  }
  /// Derivative of the map; not finite when the patch is degenerate.
  [[nodiscard]] Eigen::Matrix2d Jacobian() const {
    const Eigen::Matrix2d aa_centred = aa - a * a.transpose() / n;
    const Eigen::Matrix2d oa_centred = oa - o * a.transpose() / n;
    return oa_centred * aa_centred.inverse();
  }
};

/// Angle by which a map turns the image [rad].
double Roll(const Eigen::Matrix2d& J) { return std::atan2(J(1, 0) - J(0, 1), J(0, 0) + J(1, 1)); }

MapFault Explain(const Eigen::Matrix2d& J) {
  Eigen::Matrix2d swapped;
  swapped << J.row(1), J.row(0);
  const Eigen::Matrix2d mirrored_u = Eigen::Vector2d(-1.0, 1.0).asDiagonal() * J;
  const Eigen::Matrix2d mirrored_v = Eigen::Vector2d(1.0, -1.0).asDiagonal() * J;
  const std::array<std::pair<double, MapFault>, 3> rolls{
      {{std::abs(Roll(swapped)), MapFault::kSwapped},
       {std::abs(Roll(mirrored_u)), MapFault::kMirroredU},
       {std::abs(Roll(mirrored_v)), MapFault::kMirroredV}}};
  return std::min_element(rolls.begin(), rolls.end(),
                          [](const auto& a, const auto& b) { return a.first < b.first; })
      ->second;
}

}  // namespace

MapOrientation FindOrientation(const std::vector<Match>& matches) {
  // Patches of about 16 matches: small enough to lie on one surface, large enough for the noise.
  constexpr double kMatchesPerPatch = 16.0;
  constexpr double kMinPatchMatches = 6.0;
  constexpr double kMirroredLimit = 0.8;
  MapOrientation out;
  if (matches.empty()) return out;
  Eigen::Vector2d low = matches.front().anchor_px;
  Eigen::Vector2d high = low;
  for (const Match& match : matches) {
    low = low.cwiseMin(match.anchor_px);
    high = high.cwiseMax(match.anchor_px);
  }
  const double area = std::max(1.0, high.x() - low.x()) * std::max(1.0, high.y() - low.y());
  const double cell = std::sqrt(area * kMatchesPerPatch / static_cast<double>(matches.size()));
  std::map<std::pair<int, int>, PatchSums> patches;
  for (const Match& match : matches) {
    const Eigen::Vector2d p = (match.anchor_px - low) / cell;
    patches[{static_cast<int>(p.y()), static_cast<int>(p.x())}].Add(match);
  }
  int num_mirrored = 0;
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  for (const auto& [key, patch] : patches) {
    if (patch.n < kMinPatchMatches) continue;
    const Eigen::Matrix2d J = patch.Jacobian();
    if (!J.allFinite()) continue;
    ++out.num_patches;
    num_mirrored += J.determinant() < 0.0 ? 1 : 0;
    // Each patch has one vote, however steep it is.
    sum += J / J.norm();
  }
  if (out.num_patches == 0) return out;
  out.mirrored_ratio = static_cast<double>(num_mirrored) / out.num_patches;
  if (out.mirrored_ratio > kMirroredLimit) out.fault = Explain(sum);
  return out;
}

}  // namespace fringe_fusion
