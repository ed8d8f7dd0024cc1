#include "bench/straight_decode.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/imgproc.hpp>

namespace fringe_fusion::bench {
namespace {

constexpr double kTwoPi = 6.28318530717958647692;

using FourSteps = std::array<cv::Mat, 4>;

cv::Mat FloatImage(const CapturedFrame& frame) {
  const auto& image = std::get<Image<std::uint8_t>>(frame.pixels);
  const cv::Mat bytes(image.height(), image.width(), CV_8UC1,
                      const_cast<std::uint8_t*>(image.data()));
  cv::Mat out;
  bytes.convertTo(out, CV_32F);
  return out;
}

struct SetFit {
  cv::Mat coordinate, variance, offset, amplitude2;
};

SetFit FitSet(const FourSteps& grey, double period_px, const PhaseConfig& config) {
  SetFit fit;
  const cv::Mat a = 0.5 * (grey[0] - grey[2]);
  const cv::Mat b = 0.5 * (grey[1] - grey[3]);
  fit.offset = 0.25 * (grey[0] + grey[1] + grey[2] + grey[3]);
  fit.amplitude2 = a.mul(a) + b.mul(b);
  cv::Mat phase;
  cv::phase(a, b, phase);
  fit.coordinate = phase * (period_px / kTwoPi) - 0.5;
  const double floor_dn2 = config.read_noise_dn * config.read_noise_dn + 1.0 / 12.0;
  const cv::Mat noise = config.gain_dn * fit.offset + floor_dn2;
  const double scale = 0.5 * std::pow(period_px / kTwoPi, 2);
  cv::divide(scale * noise, cv::max(fit.amplitude2, 1e-6), fit.variance);
  return fit;
}

struct AxisMap {
  cv::Mat coordinate, sigma, offset, amplitude2, valid;
};

AxisMap DecodeAxis(const std::map<double, FourSteps>& sets, double size_px,
                   const PhaseConfig& config) {
  AxisMap out;
  cv::Mat variance;
  for (const auto& [fringes, grey] : sets) {
    const double period_px = size_px / fringes;
    const SetFit fit = FitSet(grey, period_px, config);
    const cv::Mat noise = config.gain_dn * fit.offset + 1.0;
    const double least = config.min_modulation_sigma * config.min_modulation_sigma;
    const cv::Mat strong = fit.amplitude2 >= least * noise;
    if (out.coordinate.empty()) {
      out.coordinate = fit.coordinate;
      variance = fit.variance;
      out.valid = strong;
    } else {
      const cv::Mat periods = (out.coordinate - fit.coordinate) / period_px;
      cv::Mat order, rounded;
      periods.convertTo(rounded, CV_32S);
      rounded.convertTo(order, CV_32F);
      const cv::Mat certain = cv::abs(periods - order) <= config.max_order_error_ratio;
      const cv::Mat unwrapped = fit.coordinate + order * period_px;
      cv::Mat share;
      cv::divide(fit.variance, fit.variance + variance, share);
      out.coordinate = unwrapped + share.mul(out.coordinate - unwrapped);
      variance = share.mul(variance);
      out.valid = out.valid & strong & certain;
    }
    out.offset = fit.offset;
    out.amplitude2 = fit.amplitude2;
  }
  cv::sqrt(variance, out.sigma);
  out.valid = out.valid & (out.coordinate >= -0.5) & (out.coordinate <= size_px - 0.5);
  return out;
}

}  // namespace

std::array<cv::Mat, 4> FinestSteps(const ImageStack& stack) {
  std::array<cv::Mat, 4> steps;
  double finest = 0.0;
  for (const Pattern& pattern : stack.sequence.frames) finest = std::max(finest, pattern.fringes);
  for (std::size_t i = 0; i < stack.frames.size(); ++i) {
    const Pattern& pattern = stack.sequence.frames[i];
    if (pattern.axis != Axis::kU || pattern.fringes != finest) continue;
    steps[static_cast<std::size_t>(pattern.step)] = FloatImage(stack.frames[i]);
  }
  return steps;
}

StraightMap DecodeStraight(const ImageStack& stack, const PhaseConfig& config) {
  std::map<double, FourSteps> u_sets;
  std::map<double, FourSteps> v_sets;
  cv::Mat low, high;
  for (std::size_t i = 0; i < stack.frames.size(); ++i) {
    const Pattern& pattern = stack.sequence.frames[i];
    const cv::Mat grey = FloatImage(stack.frames[i]);
    auto& sets = pattern.axis == Axis::kU ? u_sets : v_sets;
    sets[pattern.fringes][static_cast<std::size_t>(pattern.step)] = grey;
    low = low.empty() ? grey.clone() : cv::Mat(cv::min(low, grey));
    high = high.empty() ? grey.clone() : cv::Mat(cv::max(high, grey));
  }
  const AxisMap u = DecodeAxis(u_sets, stack.sequence.width, config);
  const AxisMap v = DecodeAxis(v_sets, stack.sequence.height, config);
  StraightMap map{
      u.coordinate, v.coordinate, u.sigma, v.sigma, 0.5 * (u.offset + v.offset), {}, {}};
  cv::sqrt(cv::min(u.amplitude2, v.amplitude2), map.modulation);
  map.mask = u.valid & v.valid & ((high - low) >= config.min_contrast_dn) &
             (high < config.saturation_ratio * 255.0);
  const cv::Mat invalid = ~map.mask;
  for (cv::Mat* image : {&map.u, &map.v, &map.sigma_u, &map.sigma_v}) {
    image->setTo(std::numeric_limits<float>::quiet_NaN(), invalid);
  }
  return map;
}

}  // namespace fringe_fusion::bench
