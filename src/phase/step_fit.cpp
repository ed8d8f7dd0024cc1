#include "step_fit.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>

#include "common/constants.hpp"

namespace fringe_fusion::decode {
namespace {

// Numbers the distinct shifts; samples of one shift follow each other in `order`.
std::vector<int> NumberPlaces(std::vector<PhaseSample>& samples) {
  std::stable_sort(samples.begin(), samples.end(), [](const PhaseSample& a, const PhaseSample& b) {
    return a.delta_rad < b.delta_rad;
  });
  std::vector<int> places;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const bool same = i > 0 && samples[i].delta_rad - samples[i - 1].delta_rad < 1e-6;
    places.push_back(i == 0 ? 0 : places.back() + (same ? 0 : 1));
  }
  return places;
}

}  // namespace

StepFit::StepFit(const PhaseSet& set, const DecodeContext& context, const PhaseLut* lut)
    : set_(set), context_(context), row_(context.stride()), refit_(context.stride()) {
  if (set_.carrier_steps == 0) places_ = NumberPlaces(set_.samples);
  for (const PhaseSample& sample : set_.samples) {
    cosines_.push_back(static_cast<float>(std::cos(sample.delta_rad)));
    sines_.push_back(static_cast<float>(std::sin(sample.delta_rad)));
    const auto group = static_cast<std::size_t>(sample.group);
    exposures_.push_back(static_cast<float>(context_.plan.groups[group].ratio));
  }
  frames_.resize(set_.samples.size());
  if (lut != nullptr) corrected_.emplace(set_, context_, *lut);
}

void StepFit::Run(const FrameRows& rows) {
  for (std::size_t n = 0; n < frames_.size(); ++n) frames_[n] = rows.frame(set_.samples[n].frame);
  if (corrected_) {
    corrected_->Run(frames_, row_);
    return;
  }
  if (set_.carrier_steps > 0) {
    for (std::size_t x = 0; x < static_cast<std::size_t>(context_.width); ++x) DemodulatePixel(x);
    return;
  }
  const FitArgs args = Args();
  if (set_.even && (set_.steps == 3 || set_.steps == 4)) {
    RunEven(args);
  } else {
    context_.kernels.fit_weighted(args, row_.out(), context_.width);
  }
}

FitArgs StepFit::Args() const {
  FitArgs args;
  args.frames = frames_.data();
  args.cosines = cosines_.data();
  args.sines = sines_.data();
  args.exposures = exposures_.data();
  args.places = places_.data();
  args.num_samples = static_cast<int>(frames_.size());
  args.num_places = places_.empty() ? 0 : places_.back() + 1;
  args.sign = static_cast<float>(set_.sign);
  args.offset_cycles = static_cast<float>(set_.offset_rad / kTwoPi);
  args.noise = NoiseOf(context_.config);
  args.limits = context_.limits();
  return args;
}

void StepFit::RunEven(const FitArgs& args) {
  const auto fit = set_.steps == 3 ? context_.kernels.fit_three : context_.kernels.fit_four;
  const std::int32_t greatest = fit(args, row_.out(), context_.width);
  // Three different shifts must remain.
  if (set_.steps > 3 && greatest == kRowSaturated) RefitSaturated(args);
}

void StepFit::RefitSaturated(const FitArgs& args) {
  const auto width = static_cast<std::size_t>(context_.width);
  context_.kernels.fit_weighted(args, refit_.out(), context_.width);
  for (std::size_t x = 0; x < width; ++x) {
    if (row_.status[x] != kRowSaturated) continue;
    row_.cycles[x] = refit_.cycles[x];
    row_.variance[x] = refit_.variance[x];
    row_.offset[x] = refit_.offset[x];
    row_.amplitude2[x] = refit_.amplitude2[x];
    row_.status[x] = refit_.status[x];
  }
}

// Science 2.9. All steps of a pixel share the carrier's phase, because direct light alone carries
// it. Projecting on that phase instead of taking magnitudes keeps the noise unbiased near zero.
void StepFit::DemodulatePixel(std::size_t x) {
  const auto num_steps = static_cast<std::size_t>(set_.steps);
  const auto num_carrier = static_cast<std::size_t>(set_.carrier_steps);
  std::vector<std::complex<double>> direct(num_steps);
  double mean = 0.0;
  float peak = 0.0F;
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    const auto grey = static_cast<double>(frames_[i][x]);
    const double angle = kTwoPi * set_.samples[i].carrier_step / set_.carrier_steps;
    direct[static_cast<std::size_t>(set_.samples[i].step)] += grey * std::polar(1.0, angle);
    mean += grey / static_cast<double>(frames_.size());
    peak = std::max(peak, frames_[i][x]);
  }
  std::complex<double> sum;
  for (const std::complex<double>& part : direct) sum += part;
  const std::complex<double> carrier = sum / std::max(std::abs(sum), 1e-12);
  std::complex<double> fringe;
  double offset = 0.0;
  for (std::size_t n = 0; n < num_steps; ++n) {
    const double level =
        2.0 / static_cast<double>(num_carrier) * (direct[n] * std::conj(carrier)).real();
    fringe += level * std::polar(2.0 / set_.steps, kTwoPi * static_cast<double>(n) / set_.steps);
    offset += level / set_.steps;
  }
  const RowNoise noise = NoiseOf(context_.config);
  const double variance_dn2 =
      2.0 / set_.carrier_steps *
      (static_cast<double>(noise.floor_dn2) + static_cast<double>(noise.gain_dn) * mean);
  const double b2 = std::max(std::norm(fringe), 1e-20);
  const double variance_rad2 = 2.0 / set_.steps * variance_dn2 / b2;
  const double cycles = (set_.sign * std::arg(fringe) - set_.offset_rad) / kTwoPi;
  row_.cycles[x] = static_cast<float>(cycles - std::floor(cycles));
  row_.variance[x] = static_cast<float>(variance_rad2 / (kTwoPi * kTwoPi));
  row_.offset[x] = static_cast<float>(offset);
  row_.amplitude2[x] = static_cast<float>(b2);
  const double least = context_.config.min_modulation_sigma;
  row_.status[x] = least * least * variance_dn2 <= b2 ? kRowValid : kRowLowModulation;
  if (!(peak < context_.saturation_dn())) row_.status[x] = kRowSaturated;
}

}  // namespace fringe_fusion::decode
