#include "corrected_fit.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "common/constants.hpp"
#include "common/turn_place.hpp"

namespace fringe_fusion {
namespace {

// Grey values are whole numbers: amplitudes below this have no phase.
constexpr double kLeastNormDn2 = 1e-6;
constexpr double kLeastInformation = 1e-12;  // [1/rad^2] of a pixel that has none

}  // namespace

double CorrectPhase(const PhaseLut& lut, double phase_rad) {
  const TurnPlace place(phase_rad, lut.error_rad.size());
  return std::remainder(phase_rad - place.In(lut.error_rad), kTwoPi);
}

namespace decode {

CorrectedFit::CorrectedFit(const PhaseSet& set, const DecodeContext& context, const PhaseLut& lut)
    : lut_(lut),
      width_(context.width),
      noise_(NoiseOf(context.config)),
      limits_(context.limits()),
      sign_(set.sign),
      offset_rad_(set.offset_rad),
      num_steps_(static_cast<std::size_t>(set.steps)),
      grey_(num_steps_),
      variance_(num_steps_) {
  for (std::size_t n = 0; n < num_steps_; ++n) {
    deltas_rad_.push_back(kTwoPi * static_cast<double>(n) / static_cast<double>(num_steps_));
    cosines_.push_back(std::cos(deltas_rad_.back()));
    sines_.push_back(std::sin(deltas_rad_.back()));
  }
  std::map<int, Shot> shots;  // by exposure group
  for (std::size_t i = 0; i < set.samples.size(); ++i) {
    const PhaseSample& sample = set.samples[i];
    Shot& shot = shots[sample.group];
    shot.exposure_ratio = context.plan.groups[static_cast<std::size_t>(sample.group)].ratio;
    shot.samples.resize(num_steps_);
    shot.samples[static_cast<std::size_t>(sample.step)] = i;
  }
  for (auto& [group, shot] : shots) shots_.push_back(std::move(shot));
}

void CorrectedFit::Run(const std::vector<const float*>& frames, SetRow& row) {
  for (std::size_t x = 0; x < static_cast<std::size_t>(width_); ++x) {
    Estimate all;
    for (const Shot& shot : shots_) {
      Read(frames, shot, x);
      const Estimate one = FitShot(shot.exposure_ratio);
      if (!one.saturated) Join(one, all);
    }
    Store(all, x, row);
  }
}

void CorrectedFit::Read(const std::vector<const float*>& frames, const Shot& shot, std::size_t x) {
  for (std::size_t n = 0; n < num_steps_; ++n) {
    const float grey = frames[shot.samples[n]][x];
    grey_[n] = static_cast<double>(grey);
    variance_[n] = static_cast<double>(noise_.floor_dn2 + noise_.gain_dn * grey);
  }
}

CorrectedFit::Estimate CorrectedFit::FitShot(double exposure_ratio) const {
  const double peak = *std::max_element(grey_.begin(), grey_.end());
  if (!(peak < static_cast<double>(limits_.saturation_dn))) return {};
  double sum = 0.0;
  double sine = 0.0;
  double cosine = 0.0;
  for (std::size_t n = 0; n < num_steps_; ++n) {
    sum += grey_[n];
    sine += grey_[n] * sines_[n];
    cosine += grey_[n] * cosines_[n];
  }
  const double norm = std::max(sine * sine + cosine * cosine, kLeastNormDn2);
  // d phase / d I_n = (C sin delta_n - S cos delta_n) / (S^2 + C^2).
  double spread = 0.0;
  for (std::size_t n = 0; n < num_steps_; ++n) {
    const double slope = cosine * sines_[n] - sine * cosines_[n];
    spread += slope * slope * variance_[n];
  }
  const double measured_rad = std::atan2(sine, cosine);
  const TurnPlace place(measured_rad, lut_.error_rad.size());
  const double slope = place.In(lut_.slope);
  const auto steps = static_cast<double>(num_steps_);
  Estimate fit;
  fit.saturated = false;
  fit.phase_rad = measured_rad - place.In(lut_.error_rad);
  fit.measured_information = norm * norm / std::max(spread, kLeastNormDn2);
  fit.information = fit.measured_information / (slope * slope);
  fit.offset_dn = sum / steps;
  fit.amplitude_dn = 2.0 / steps * std::sqrt(norm) / place.In(lut_.amplitude_ratio);
  AddResiduals(fit);
  fit.offset_dn /= exposure_ratio;
  fit.amplitude_dn /= exposure_ratio;
  return fit;
}

// The shape of the fringes is known: what is left of it is no residual.
void CorrectedFit::AddResiduals(Estimate& fit) const {
  if (num_steps_ < 4) return;
  const auto expected = [&](std::size_t n) {
    return fit.amplitude_dn *
           TurnPlace(fit.phase_rad - deltas_rad_[n], lut_.wave.size()).In(lut_.wave);
  };
  double mean = 0.0;
  for (std::size_t n = 0; n < num_steps_; ++n) mean += grey_[n] - expected(n);
  mean /= static_cast<double>(num_steps_);
  fit.offset_dn = mean;
  double weight = 0.0;
  for (std::size_t n = 0; n < num_steps_; ++n) {
    const double rest = grey_[n] - mean - expected(n);
    fit.chi2 += rest * rest / variance_[n];
    weight += 1.0 / variance_[n];
  }
  fit.largest_chi2 =
      static_cast<double>(limits_.max_residual2) * static_cast<double>(num_steps_ - 3) +
      static_cast<double>(limits_.harmonic2) * fit.amplitude_dn * fit.amplitude_dn * weight;
}

void CorrectedFit::Join(const Estimate& one, Estimate& all) {
  if (all.saturated) {
    all = one;
    return;
  }
  const double share = one.information / (all.information + one.information);
  all.phase_rad += share * std::remainder(one.phase_rad - all.phase_rad, kTwoPi);
  all.offset_dn += share * (one.offset_dn - all.offset_dn);
  all.amplitude_dn += share * (one.amplitude_dn - all.amplitude_dn);
  all.information += one.information;
  all.measured_information += one.measured_information;
  all.chi2 += one.chi2;
  all.largest_chi2 += one.largest_chi2;
}

void CorrectedFit::Store(const Estimate& fit, std::size_t x, SetRow& row) const {
  const double cycles = (sign_ * fit.phase_rad - offset_rad_) / kTwoPi;
  row.cycles[x] = static_cast<float>(cycles - std::floor(cycles));
  const double information = std::max(fit.information, kLeastInformation);
  row.variance[x] = static_cast<float>(1.0 / (kTwoPi * kTwoPi * information));
  row.offset[x] = static_cast<float>(fit.offset_dn);
  row.amplitude2[x] = static_cast<float>(fit.amplitude_dn * fit.amplitude_dn);
  // (B / sigma_I)^2 of an equal set; the slope of the table takes no light away.
  const double strength = 2.0 / static_cast<double>(num_steps_) * fit.measured_information;
  row.status[x] = fit.chi2 <= fit.largest_chi2 ? kRowValid : kRowResidual;
  if (!(strength >= static_cast<double>(limits_.min_modulation2))) {
    row.status[x] = kRowLowModulation;
  }
  if (fit.saturated) row.status[x] = kRowSaturated;
}

}  // namespace decode
}  // namespace fringe_fusion
