#include "axis_decoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace fringe_fusion::decode {
namespace {

constexpr double kTwoPi = 6.28318530717958647692;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

AxisPixel Invalid(AxisPixel pixel, MaskReason reason) {
  pixel.coordinate_px = kNan;
  pixel.sigma_px = kNan;
  pixel.reason = reason;
  return pixel;
}

}  // namespace

AxisDecoder::AxisDecoder(const AxisPlan& plan, const PhaseConfig& config, int width)
    : plan_(plan), config_(config) {
  if (plan.gray) gray_.emplace(*plan.gray, config, width);
  for (const PhaseSet& set : plan.sets) fits_.emplace_back(set, width);
  repeats_over_size_ = !plan.gray && !plan.sets.empty() && plan.sets.front().fringes == 1.0 &&
                       std::all_of(plan.sets.begin(), plan.sets.end(), [](const PhaseSet& set) {
                         return set.fringes == std::round(set.fringes);
                       });
}

void AxisDecoder::Run(const FrameRows& rows) {
  if (gray_) gray_->Run(rows);
  for (StepFit& fit : fits_) fit.Run(rows);
}

AxisPixel AxisDecoder::Decode(std::size_t x, float full_scale_dn) const {
  if (fits_.empty()) return DecodeGray(x);
  const MaskReason reason = CheckSets(x, full_scale_dn);
  if (reason == MaskReason::kValid) return DecodePhases(x);
  AxisPixel pixel;
  pixel.offset_dn = fits_.back().offset_dn(x);
  pixel.modulation_dn = fits_.back().modulation_dn(x);
  return Invalid(pixel, reason);
}

MaskReason AxisDecoder::CheckSets(std::size_t x, float full_scale_dn) const {
  const auto saturation = static_cast<float>(config_.saturation_ratio) * full_scale_dn;
  for (const StepFit& fit : fits_) {
    if (!(fit.peak_dn(x) < saturation)) return MaskReason::kSaturated;
  }
  for (const StepFit& fit : fits_) {
    const float variance = NoiseVariance(config_, fit.offset_dn(x));
    const float b = fit.modulation_dn(x);
    const auto least = static_cast<float>(config_.min_modulation_sigma);
    if (!(b * b >= least * least * variance) || !(b > 0.0F)) return MaskReason::kLowModulation;
    if (fit.num_steps() < 4.0F) continue;
    // Harmonics of a projector gamma that was not undone are no reason to drop a pixel: they shift
    // the phase by a small, known amount (science section 2.2). Their share of B is let through.
    const auto noise = static_cast<float>(config_.max_residual_sigma);
    const float harmonics = static_cast<float>(config_.max_harmonic_ratio) * b;
    const float limit = noise * noise * variance * (fit.num_steps() - 3.0F) +
                        harmonics * harmonics * fit.num_steps();
    if (!(fit.residual_dn2(x) <= limit)) return MaskReason::kResidual;
  }
  return MaskReason::kValid;
}

AxisPixel AxisDecoder::DecodeGray(std::size_t x) const {
  AxisPixel pixel;
  pixel.offset_dn = gray_->offset_dn(x);
  pixel.modulation_dn = gray_->modulation_dn(x);
  const GrayInterval interval = gray_->Cell(x);
  if (!std::isfinite(interval.centre_px)) return Invalid(pixel, MaskReason::kDoubtfulOrder);
  if (!(interval.centre_px >= -0.5 && interval.centre_px <= plan_.size_px - 0.5)) {
    return Invalid(pixel, MaskReason::kOutsideProjector);
  }
  pixel.coordinate_px = static_cast<float>(interval.centre_px);
  // A uniform error of +-half has the standard deviation half / sqrt(3).
  pixel.sigma_px = static_cast<float>(interval.half_px / std::sqrt(3.0));
  return pixel;
}

AxisPixel AxisDecoder::DecodePhases(std::size_t x) const {
  AxisPixel pixel;
  pixel.offset_dn = fits_.back().offset_dn(x);
  pixel.modulation_dn = fits_.back().modulation_dn(x);
  Estimate estimate;
  if (gray_) {
    const GrayInterval interval = gray_->Interval(x);
    if (!std::isfinite(interval.centre_px)) return Invalid(pixel, MaskReason::kDoubtfulOrder);
    estimate.coordinate_px = interval.centre_px;
    estimate.half_px = interval.half_px;
  } else {
    const double period_px = plan_.size_px / plan_.sets.front().fringes;
    estimate.coordinate_px = 0.5 * period_px - 0.5;
    estimate.half_px = 0.5 * period_px;
  }
  for (const StepFit& fit : fits_) {
    if (!AddSet(fit, x, estimate)) return Invalid(pixel, MaskReason::kDoubtfulOrder);
  }
  const double coordinate_px = WrapIntoProjector(estimate.coordinate_px);
  const double sigma_px = 1.0 / std::sqrt(estimate.information);
  // Where the code repeats, a pixel this close to the border may belong to the opposite one.
  const double margin_px = repeats_over_size_ ? 3.0 * sigma_px : 0.0;
  if (!(coordinate_px >= -0.5 + margin_px && coordinate_px <= plan_.size_px - 0.5 - margin_px)) {
    return Invalid(pixel, MaskReason::kOutsideProjector);
  }
  pixel.coordinate_px = static_cast<float>(coordinate_px);
  pixel.sigma_px = static_cast<float>(sigma_px);
  return pixel;
}

bool AxisDecoder::AddSet(const StepFit& fit, std::size_t x, Estimate& estimate) const {
  const PhaseSet& set = fit.set();
  const double period_px = plan_.size_px / set.fringes;
  const double px_per_rad = period_px / kTwoPi;
  // Science 2.4: u = W Phi / (2 pi f) - 1/2, once sign and offset of the pattern are undone.
  const double wrapped_px =
      px_per_rad * (set.sign * static_cast<double>(fit.phase_rad(x)) - set.offset_rad) - 0.5;
  const double order = std::round((estimate.coordinate_px - wrapped_px) / period_px);
  const double unwrapped_px = wrapped_px + order * period_px;
  const double error_px = std::abs(unwrapped_px - estimate.coordinate_px);
  // Science 2.1: var phi = 2 sigma_I^2 / (N B^2).
  const double b = static_cast<double>(fit.modulation_dn(x));
  const double variance_rad2 = 2.0 * static_cast<double>(NoiseVariance(config_, fit.offset_dn(x))) /
                               (static_cast<double>(fit.num_steps()) * b * b);
  const double information = 1.0 / (px_per_rad * px_per_rad * variance_rad2);
  // An interval says nothing about where in it the pixel lies, so any phase inside agrees. It
  // leaves the order open when the next order agrees as well. (The ends of a first set that repeats
  // over the projector are sorted out by WrapIntoProjector.)
  const double half_px = estimate.half_px;
  if (!(error_px <= std::max(config_.max_order_error_ratio * period_px, 1.01 * half_px))) {
    return false;
  }
  const bool open_ended = repeats_over_size_ && estimate.information == 0.0;
  const double margin_px = 4.0 / std::sqrt(information);
  if (!open_ended && half_px > 0.0 && !(period_px - error_px > half_px + margin_px)) return false;
  estimate.information += information;
  estimate.weighted_sum += information * unwrapped_px;
  estimate.coordinate_px = estimate.weighted_sum / estimate.information;
  estimate.half_px = 0.0;
  return true;
}

// The coarsest set of exactly one fringe jumps by the projector size at its ends, where noise
// decides the side. Finer sets repeat over the size too, so only the fused value can tell.
double AxisDecoder::WrapIntoProjector(double coordinate_px) const {
  if (!repeats_over_size_) return coordinate_px;
  const double size_px = plan_.size_px;
  return coordinate_px - size_px * std::floor((coordinate_px + 0.5) / size_px);
}

}  // namespace fringe_fusion::decode
