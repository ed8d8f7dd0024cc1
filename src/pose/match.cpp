#include "fringe_fusion/pose/match.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "common/dense.hpp"

namespace fringe_fusion {
namespace {

bool HasSize(const Image<float>& image, const PhaseMap& phase) {
  return image.width() == phase.width && image.height() == phase.height && !image.empty();
}

Status CheckMap(const PhaseMap& phase) {
  if (phase.u.empty() || phase.v.empty()) {
    return Fail("pose: the phase map codes only the {} axis; the epipolar constraint needs both",
                phase.u.empty() ? (phase.v.empty() ? "no" : "v") : "u");
  }
  if (!HasSize(phase.u, phase) || !HasSize(phase.v, phase) || !HasSize(phase.sigma_u, phase) ||
      !HasSize(phase.sigma_v, phase)) {
    return Fail("pose: an image of the phase map is not {} x {}", phase.width, phase.height);
  }
  return {};
}

bool IsUsable(const PhaseMap& phase, std::size_t i) {
  return std::isfinite(phase.u[i]) && std::isfinite(phase.v[i]) && phase.sigma_u[i] > 0.0F &&
         phase.sigma_v[i] > 0.0F && std::isfinite(phase.sigma_u[i]) &&
         std::isfinite(phase.sigma_v[i]) && (phase.mask.empty() || phase.mask[i] == 0);
}

float Variance(const PhaseMap& phase, std::size_t i) {
  return phase.sigma_u[i] * phase.sigma_u[i] + phase.sigma_v[i] * phase.sigma_v[i];
}

Match MatchAt(const PhaseMap& phase, int x, int y) {
  Match match;
  match.anchor_px = {x, y};
  match.observed_px = {static_cast<double>(phase.u(x, y)), static_cast<double>(phase.v(x, y))};
  const Eigen::Vector2d sigma(static_cast<double>(phase.sigma_u(x, y)),
                              static_cast<double>(phase.sigma_v(x, y)));
  match.covariance_px2 = sigma.cwiseAbs2().asDiagonal();
  return match;
}

/// Root mean square extent of points along and across their main direction [px].
Eigen::Vector2d Spread(const std::vector<Match>& matches, Eigen::Vector2d Match::*pixel) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Match& match : matches) mean += match.*pixel;
  mean /= static_cast<double>(matches.size());
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const Match& match : matches) {
    const Eigen::Vector2d d = match.*pixel - mean;
    scatter += d * d.transpose();
  }
  scatter /= static_cast<double>(matches.size());
  return dense::SymmetricEigenvalues(scatter).cwiseMax(0.0).cwiseSqrt();
}

Status CheckSpread(const std::vector<Match>& matches, const DevicePair& devices,
                   const EpipolarConfig& config) {
  const auto check = [&](const char* name, const CameraModel& model,
                         Eigen::Vector2d Match::*pixel) -> Status {
    const Eigen::Vector2d spread = Spread(matches, pixel);
    const double limit_px = config.min_spread_ratio * std::hypot(model.width, model.height);
    if (!(spread[1] > limit_px)) {
      return Fail(
          "pose: all {} matches have the same {} pixel ({:.1f}, {:.1f}) within {:.3g} px, "
          "limit {:.3g}: the codes are equal or the object is too small",
          matches.size(), name, (matches.front().*pixel).x(), (matches.front().*pixel).y(),
          spread[1], limit_px);
    }
    if (!(spread[0] > limit_px)) {
      return Fail(
          "pose: the {} pixels of {} matches are collinear: rms distance to a line {:.3g} "
          "px, limit {:.3g}: one axis is constant or the object is a thin strip",
          name, matches.size(), spread[0], limit_px);
    }
    return {};
  };
  if (Status status = check("anchor", devices.anchor, &Match::anchor_px); !status) return status;
  return check("observed", devices.observed, &Match::observed_px);
}

Status CheckValues(const std::vector<Match>& matches) {
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Match& match = matches[i];
    if (!match.anchor_px.allFinite() || !match.observed_px.allFinite()) {
      return Fail("pose: match {} has a pixel that is not finite: ({}, {}) -> ({}, {})", i,
                  match.anchor_px.x(), match.anchor_px.y(), match.observed_px.x(),
                  match.observed_px.y());
    }
    const Eigen::Matrix2d& c = match.covariance_px2;
    if (!c.allFinite() || !(c(0, 0) > 0.0) || !(c.determinant() > 0.0)) {
      return Fail("pose: match {} has the variances {} and {} px^2, which must be positive", i,
                  c(0, 0), c(1, 1));
    }
  }
  return {};
}

/// Share of matches whose observed pixel lies outside the device by more than a pixel.
double OutsideRatio(const std::vector<Match>& matches, const CameraModel& model, bool swapped) {
  const double width = swapped ? model.height : model.width;
  const double height = swapped ? model.width : model.height;
  const auto outside = std::count_if(matches.begin(), matches.end(), [&](const Match& match) {
    const Eigen::Vector2d& p = match.observed_px;
    return p.x() < -1.0 || p.y() < -1.0 || p.x() > width || p.y() > height;
  });
  return static_cast<double>(outside) / static_cast<double>(matches.size());
}

Status CheckRange(const std::vector<Match>& matches, const CameraModel& observed) {
  constexpr double kMaxOutsideRatio = 0.02;
  const double outside = OutsideRatio(matches, observed, false);
  if (outside <= kMaxOutsideRatio) return {};
  if (OutsideRatio(matches, observed, true) <= kMaxOutsideRatio) {
    return Fail(
        "pose: u and v are swapped: {:.0f} % of the codes lie outside {} x {} px, but "
        "inside when exchanged",
        100.0 * outside, observed.width, observed.height);
  }
  return Fail("pose: {:.0f} % of the codes lie outside the device of {} x {} px, limit {:.0f} %",
              100.0 * outside, observed.width, observed.height, 100.0 * kMaxOutsideRatio);
}

Status CheckOrientation(const std::vector<Match>& matches) {
  const MapOrientation orientation = FindOrientation(matches);
  const double percent = 100.0 * orientation.mirrored_ratio;
  switch (orientation.fault) {
    case MapFault::kNone:
      return {};
    case MapFault::kSwapped:
      return Fail(
          "pose: u and v are swapped: the code map mirrors {:.0f} % of {} image patches, "
          "and exchanging the axes turns it upright",
          percent, orientation.num_patches);
    case MapFault::kMirroredU:
      return Fail(
          "pose: the u axis of the projector is mirrored: the code map mirrors {:.0f} % of "
          "{} image patches, and reversing u turns it upright",
          percent, orientation.num_patches);
    case MapFault::kMirroredV:
      return Fail(
          "pose: the v axis of the projector is mirrored: the code map mirrors {:.0f} % of "
          "{} image patches, and reversing v turns it upright",
          percent, orientation.num_patches);
  }
  return {};
}

}  // namespace

Status Validate(const EpipolarConfig& config) {
  if (Status status = CheckBounds(config, "epipolar"); !status) return status;
  if (config.objective != "one_sided" && config.objective != "symmetric") {
    return Fail("epipolar: objective = '{}' must be one_sided or symmetric", config.objective);
  }
  return {};
}

Result<std::vector<Match>> SampleMatches(const PhaseMap& phase, int max_matches) {
  if (Status status = CheckMap(phase); !status) return tl::unexpected<Error>(status.error());
  int num_valid = 0;
  for (std::size_t i = 0; i < phase.u.size(); ++i) num_valid += IsUsable(phase, i) ? 1 : 0;
  if (num_valid == 0) return Fail("pose: the phase map has no valid pixel");
  // Cells on the rim of the valid region are partly filled: enlarge until the bound holds.
  int cell = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(num_valid) / max_matches)));
  std::vector<Match> matches;
  while (true) {
    matches.clear();
    for (int y0 = 0; y0 < phase.height; y0 += cell) {
      for (int x0 = 0; x0 < phase.width; x0 += cell) {
        int best_x = -1;
        int best_y = -1;
        float best = 0.0F;
        for (int y = y0; y < std::min(y0 + cell, phase.height); ++y) {
          for (int x = x0; x < std::min(x0 + cell, phase.width); ++x) {
            const auto i = static_cast<std::size_t>(y) * static_cast<std::size_t>(phase.width) +
                           static_cast<std::size_t>(x);
            if (!IsUsable(phase, i)) continue;
            if (best_x >= 0 && !(Variance(phase, i) < best)) continue;
            best = Variance(phase, i);
            best_x = x;
            best_y = y;
          }
        }
        if (best_x >= 0) matches.push_back(MatchAt(phase, best_x, best_y));
      }
    }
    if (matches.size() <= static_cast<std::size_t>(max_matches)) return matches;
    ++cell;
  }
}

Status CheckMatches(const std::vector<Match>& matches, const DevicePair& devices,
                    const EpipolarConfig& config) {
  if (matches.size() < static_cast<std::size_t>(config.min_matches)) {
    return Fail("pose: {} matches, at least {} are needed", matches.size(), config.min_matches);
  }
  if (Status status = CheckValues(matches); !status) return status;
  if (Status status = CheckSpread(matches, devices, config); !status) return status;
  if (Status status = CheckRange(matches, devices.observed); !status) return status;
  return CheckOrientation(matches);
}

}  // namespace fringe_fusion
