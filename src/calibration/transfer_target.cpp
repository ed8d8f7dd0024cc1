#include "fringe_fusion/calibration/transfer_target.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "fringe_fusion/calibration/target_print.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "print_edges.hpp"
#include "target_homography.hpp"

namespace fringe_fusion {
namespace {

using internal::Homography;
using internal::PrintEdges;

constexpr int kNumTerms = 6;
using Terms = Eigen::Matrix<double, kNumTerms, 1>;

Terms Polynomial(const Eigen::Vector2d& d) {
  Terms terms;
  terms << 1.0, d.x(), d.y(), d.x() * d.x(), d.x() * d.y(), d.y() * d.y();
  return terms;
}

/// One pixel of a fit.
struct Sample {
  Terms terms;
  double value = 0.0;
  double weight = 0.0;  ///< 1 / variance
};

struct Fitted {
  double value = 0.0;
  double variance = 0.0;
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();  ///< by d
};

/// Weighted polynomial of second degree, outliers left out, its value and slope at d = 0.
std::optional<Fitted> FitPolynomial(std::vector<Sample> samples, const TransferConfig& config) {
  const Terms at = Polynomial(Eigen::Vector2d::Zero());
  double scale = 1.0;
  for (int round = 0; round < 4; ++round) {
    if (static_cast<int>(samples.size()) < std::max(config.min_pixels, kNumTerms + 1)) {
      return std::nullopt;
    }
    Eigen::Matrix<double, kNumTerms, kNumTerms> normal;
    normal.setZero();
    Terms right = Terms::Zero();
    for (const Sample& s : samples) {
      normal += s.weight * s.terms * s.terms.transpose();
      right += s.weight * s.value * s.terms;
    }
    const Eigen::LDLT<decltype(normal)> factors(normal);
    if (factors.info() != Eigen::Success || !factors.isPositive()) return std::nullopt;
    const Terms coefficients = factors.solve(right);
    double chi2 = 0.0;
    for (const Sample& s : samples) {
      const double residual = s.value - coefficients.dot(s.terms);
      chi2 += s.weight * residual * residual;
    }
    // Errors that the sigmas do not know of, such as ripple, show in the residuals.
    scale = std::max(1.0, chi2 / static_cast<double>(samples.size() - kNumTerms));
    const double limit = config.max_residual_sigma * config.max_residual_sigma * scale;
    const auto is_outlier = [&](const Sample& s) {
      const double residual = s.value - coefficients.dot(s.terms);
      return !(s.weight * residual * residual <= limit);
    };
    const auto end = std::remove_if(samples.begin(), samples.end(), is_outlier);
    if (end == samples.end() || round == 3) {
      const double variance = scale * at.dot(factors.solve(at));
      if (!std::isfinite(variance) || !(variance > 0.0)) return std::nullopt;
      return Fitted{at.dot(coefficients), variance, coefficients.segment<2>(1)};
    }
    samples.erase(end, samples.end());
  }
  return std::nullopt;
}

Eigen::Vector2d Undistorted(const CameraModel& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d n = Undistort(camera, pixel);
  return {camera.fx * n.x() + camera.cx, camera.fy * n.y() + camera.cy};
}

class PointTransfer {
 public:
  PointTransfer(const PhaseMap& phase, const CalibrationTarget& target,
                const TransferConfig& config, const std::optional<CameraModel>& camera)
      : phase_(phase),
        target_(target),
        config_(config),
        camera_(camera),
        points_(TargetPoints(target)),
        edges_(target) {}

  /// @param centre pixel of the true centre. @param homography of the whole target.
  void Transfer(const Eigen::Vector2d& centre, const Homography& homography,
                PointSighting& sighting) const {
    const Eigen::Vector2d point = points_[static_cast<std::size_t>(sighting.point)].head<2>();
    const Eigen::Matrix2d pixel_by_point = homography.Jacobian(point);
    const Eigen::Matrix2d point_by_pixel = pixel_by_point.inverse();
    const double step_px = target_.pitch_m * std::sqrt(std::abs(pixel_by_point.determinant()));
    const double radius = std::min(config_.window_ratio * step_px, config_.max_window_px);
    const Eigen::Vector2d origin = camera_ ? Undistorted(*camera_, centre) : centre;
    std::vector<Sample> u;
    std::vector<Sample> v;
    const auto reach = static_cast<int>(std::ceil(radius));
    const int x0 = static_cast<int>(std::lround(centre.x()));
    const int y0 = static_cast<int>(std::lround(centre.y()));
    for (int y = y0 - reach; y <= y0 + reach; ++y) {
      for (int x = x0 - reach; x <= x0 + reach; ++x) {
        if (!phase_.u.Contains(x, y) || !IsValid(x, y)) continue;
        const Eigen::Vector2d offset = Eigen::Vector2d(x, y) - centre;
        if (offset.norm() > radius) continue;
        const double guard = edges_.Distance(point + point_by_pixel * offset, pixel_by_point);
        if (guard < config_.edge_guard_px) continue;
        const Eigen::Vector2d d =
            camera_ ? Eigen::Vector2d(Undistorted(*camera_, Eigen::Vector2d(x, y)) - origin)
                    : offset;
        const Terms terms = Polynomial(d / radius);
        u.push_back({terms, phase_.u(x, y), Weight(phase_.sigma_u(x, y))});
        v.push_back({terms, phase_.v(x, y), Weight(phase_.sigma_v(x, y))});
      }
    }
    Finish(std::move(u), std::move(v), radius, sighting);
  }

 private:
  static double Weight(float sigma) { return 1.0 / (static_cast<double>(sigma) * sigma); }

  [[nodiscard]] bool IsValid(int x, int y) const {
    return phase_.mask(x, y) == static_cast<std::uint8_t>(MaskReason::kValid) &&
           std::isfinite(phase_.u(x, y)) && std::isfinite(phase_.v(x, y)) &&
           phase_.sigma_u(x, y) > 0.0F && phase_.sigma_v(x, y) > 0.0F;
  }

  void Finish(std::vector<Sample> u, std::vector<Sample> v, double radius,
              PointSighting& sighting) const {
    const auto fitted_u = FitPolynomial(std::move(u), config_);
    const auto fitted_v = FitPolynomial(std::move(v), config_);
    if (!fitted_u || !fitted_v) return;
    // The place at which the fit is read off is itself uncertain.
    Eigen::Matrix2d projector_by_camera;
    projector_by_camera << fitted_u->slope.transpose(), fitted_v->slope.transpose();
    projector_by_camera /= radius;
    Eigen::Matrix2d covariance =
        projector_by_camera * sighting.covariance_camera_px2 * projector_by_camera.transpose();
    covariance(0, 0) += fitted_u->variance;
    covariance(1, 1) += fitted_v->variance;
    const double limit = config_.max_sigma_px * config_.max_sigma_px;
    if (!(covariance(0, 0) <= limit && covariance(1, 1) <= limit)) return;
    sighting.has_projector = true;
    sighting.pixel_projector = Eigen::Vector2d(fitted_u->value, fitted_v->value);
    sighting.covariance_projector_px2 = covariance;
  }

  const PhaseMap& phase_;
  const CalibrationTarget& target_;
  const TransferConfig& config_;
  const std::optional<CameraModel>& camera_;
  std::vector<Eigen::Vector3d> points_;
  PrintEdges edges_;
};

Status CheckPhase(const PhaseMap& phase) {
  if (phase.u.empty() || phase.v.empty()) {
    return Fail("the patterns code only one axis of the projector, a calibration needs both");
  }
  if (phase.relative_u || phase.relative_v) {
    return Fail(
        "the patterns leave the projector coordinates relative, a calibration needs a "
        "code that is absolute on both axes");
  }
  return {};
}

}  // namespace

std::vector<Eigen::Vector2d> TrueCentres(const TargetSighting& sighting,
                                         const CalibrationTarget& target) {
  std::vector<Eigen::Vector2d> centres;
  const std::optional<Homography> homography =
      sighting.is_ellipse_centre ? internal::FitTargetHomography(sighting, target) : std::nullopt;
  const std::vector<Eigen::Vector3d> points = TargetPoints(target);
  for (const PointSighting& point : sighting.points) {
    centres.push_back(point.pixel_camera);
    if (!homography) continue;
    const Eigen::Vector2d xy = points[static_cast<std::size_t>(point.point)].head<2>();
    centres.back() += homography->Map(xy) -
                      internal::EllipseCentre(*homography, xy, DotRadius(target, point.point));
  }
  return centres;
}

Result<TargetSighting> TransferToProjector(const PhaseMap& phase, const TargetSighting& sighting,
                                           const CalibrationTarget& target,
                                           const TransferConfig& config,
                                           const std::optional<CameraModel>& camera) {
  Status status = CheckBounds(config, "transfer");
  if (status) status = Validate(target, "target");
  if (status) status = CheckPhase(phase);
  if (!status) return tl::unexpected<Error>(status.error());
  const std::optional<Homography> homography = internal::FitTargetHomography(sighting, target);
  if (!homography) {
    return Fail("{} points of the target do not fix its plane, at least 4 are needed",
                sighting.points.size());
  }
  const std::vector<Eigen::Vector2d> centres = TrueCentres(sighting, target);
  const PointTransfer transfer(phase, target, config, camera);
  TargetSighting transferred = sighting;
  ParallelFor(static_cast<int>(centres.size()), 4, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      transferred.points[i].has_projector = false;
      transfer.Transfer(centres[i], *homography, transferred.points[i]);
    }
  });
  const auto num_transferred =
      std::count_if(transferred.points.begin(), transferred.points.end(),
                    [](const PointSighting& point) { return point.has_projector; });
  if (num_transferred == 0) {
    return Fail(
        "none of {} target points has decoded pixels about it: is the projector's light on "
        "the target, and clear of its print?",
        transferred.points.size());
  }
  return transferred;
}

}  // namespace fringe_fusion
