#include "capture_predictor.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "common/constants.hpp"

namespace fringe_fusion::diagnosis {
namespace {

constexpr int kNumPredictedHarmonics = 24;
constexpr std::size_t kNumOrders = 8;

double NormalCdf(double z) { return 0.5 * std::erfc(-z / std::sqrt(2.0)); }
double WithinProbability(double limit, double sigma) {
  return sigma > 0.0 ? std::erf(limit / (std::sqrt(2.0) * sigma)) : 1.0;
}

// z with P(|normal| < z) = ratio.
double UnitQuantile(double ratio) {
  double low = 0.0;
  double high = 10.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (WithinProbability(middle, 1.0) < ratio ? low : high) = middle;
  }
  return high;
}

// Squared distance of an order whose sets deviate like this, the best common shift taken out.
// @param variance per set, the finest last [cycles^2].
double SquaredDistance(const std::vector<double>& fringes, const std::vector<double>& residual,
                       const std::vector<double>& variance) {
  double information = 1.0 / variance.back();
  double sum = 0.0;
  double cost = 0.0;
  for (std::size_t i = 0; i < residual.size(); ++i) {
    const double ratio = fringes[i] / fringes.back();
    information += ratio * ratio / variance[i];
    sum += ratio * residual[i] / variance[i];
    cost += residual[i] * residual[i] / variance[i];
  }
  return cost - sum * sum / information;
}

}  // namespace

std::vector<WrongOrder> ClosestOrders(const std::vector<double>& fringes, std::size_t count) {
  const double finest = fringes.back();
  const std::vector<double> unit(fringes.size(), 1.0);
  std::vector<std::pair<double, WrongOrder>> orders;
  for (int k = 1; k < finest; ++k) {
    WrongOrder order;
    order.share = 1.0 - k / finest;
    for (std::size_t i = 0; i + 1 < fringes.size(); ++i) {
      order.residual_cycles.push_back(std::remainder(fringes[i] / finest * k, 1.0));
    }
    orders.emplace_back(SquaredDistance(fringes, order.residual_cycles, unit), std::move(order));
  }
  count = std::min(count, orders.size());
  std::partial_sort(orders.begin(), orders.begin() + static_cast<std::ptrdiff_t>(count),
                    orders.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<WrongOrder> closest;
  for (std::size_t i = 0; i < count; ++i) closest.push_back(std::move(orders[i].second));
  return closest;
}

double OrderMargin(const std::vector<double>& fringes) {
  const std::vector<WrongOrder> closest = ClosestOrders(fringes, 1);
  if (closest.empty()) return kInfinity;
  const std::vector<double> unit(fringes.size(), 1.0);
  return std::sqrt(std::max(0.0, SquaredDistance(fringes, closest[0].residual_cycles, unit)));
}

CapturePredictor::CapturePredictor(const CaptureScene& scene, const PhaseConfig& phase,
                                   const CaptureAssistantConfig& config)
    : scene_(scene),
      phase_(phase),
      config_(config),
      harmonics_(Harmonics(scene.response, kNumPredictedHarmonics)),
      unit_quantile_(UnitQuantile(config.covered_ratio)) {
  const double wrong = phase.max_wrong_order_ratio;
  least_log_odds_ = std::log((1.0 - wrong) / wrong);
}

double CapturePredictor::Transfer(int axis, double fringes) const {
  const auto i = static_cast<std::size_t>(axis);
  const double angle = kTwoPi * fringes * scene_.blur_px[i] / scene_.size_px[i];
  return std::exp(-0.5 * angle * angle);
}

double CapturePredictor::Ripple(int axis, double fringes, int steps) const {
  const double first = Transfer(axis, fringes);
  const auto harmonic = [&](int k) {
    if (k >= kNumPredictedHarmonics) return 0.0;
    return harmonics_[static_cast<std::size_t>(k)] * Transfer(axis, k * fringes) / first;
  };
  return std::abs(harmonic(steps - 1) - harmonic(steps + 1));
}

CapturePredictor::Look CapturePredictor::MakeLook(int axis, double exposure_s, double fringes,
                                                  int steps) const {
  Look look;
  const double transfer = Transfer(axis, fringes);
  const double floor_dn2 = scene_.read_noise_dn * scene_.read_noise_dn + 1.0 / 12.0;
  const double limit_dn = phase_.saturation_ratio * scene_.full_scale_dn;
  for (const CaptureScene::Pixel& pixel : scene_.pixels) {
    const double contrast_dn = exposure_s * pixel.contrast_dn_s;
    const double offset_dn = exposure_s * pixel.black_dn_s + scene_.mean_ratio * contrast_dn;
    const double b_dn = scene_.fringe_ratio * transfer * contrast_dn;
    double information = 0.0;
    int usable = 0;
    for (int place = 0; place < kNumPlaces; ++place) {
      Normal normal{};
      int count = 0;
      for (int n = 0; n < steps; ++n) {
        // Equal steps look the same after one of them.
        const double theta = kTwoPi * (n + (place + 0.5) / kNumPlaces) / steps;
        const double cosine = std::cos(theta);
        const double grey_dn = std::max(0.0, offset_dn + b_dn * cosine);
        const double weight = 1.0 / (floor_dn2 + scene_.gain_dn * grey_dn);
        const double slope = -b_dn * std::sin(theta);
        information += weight * slope * slope / kNumPlaces;
        if (!(grey_dn < limit_dn)) continue;
        ++count;
        // In units of the exposure, which all exposures share.
        const double a = exposure_s;
        const double b = exposure_s * cosine;
        const std::array<double, 6> terms = {a * a, a * b,     a * slope,
                                             b * b, b * slope, slope * slope};
        for (std::size_t k = 0; k < 6; ++k) normal[k] += static_cast<float>(weight * terms[k]);
      }
      usable += count;
      look.normals.push_back(normal);
      look.counts.push_back(count);
    }
    look.information.push_back(information);
    look.share.push_back(static_cast<double>(usable) / (kNumPlaces * steps));
  }
  return look;
}

const CapturePredictor::Look& CapturePredictor::LookAt(int axis, double exposure_s, double fringes,
                                                       int steps) {
  const std::tuple<int, double, double, int> key(axis, exposure_s, fringes, steps);
  const auto found = looks_.find(key);
  if (found != looks_.end()) return found->second;
  return looks_.emplace(key, MakeLook(axis, exposure_s, fringes, steps)).first->second;
}

// Science 2.7: one least squares over all exposures, saturated steps left out.
CapturePredictor::SetFit CapturePredictor::FitSet(const Look* const* views,
                                                  std::size_t num_exposures, int steps,
                                                  std::size_t pixel) {
  SetFit fit;
  double information = 0.0;
  for (std::size_t e = 0; e < num_exposures; ++e) {
    information += views[e]->information[pixel];
    fit.count += steps * views[e]->share[pixel];
  }
  fit.keep = 1.0;
  fit.variance_rad2 = 1.0 / std::max(information, 1e-12);
  if (fit.count > (static_cast<double>(num_exposures) - 1e-9) * steps) return fit;
  fit.variance_rad2 = 0.0;
  int num_usable = 0;
  for (int place = 0; place < kNumPlaces; ++place) {
    const std::size_t at = pixel * kNumPlaces + static_cast<std::size_t>(place);
    std::array<double, 6> m{};
    for (std::size_t e = 0; e < num_exposures; ++e) {
      for (std::size_t k = 0; k < 6; ++k) m[k] += static_cast<double>(views[e]->normals[at][k]);
    }
    // What the phase has left when A and B are unknown too.
    const double det = m[0] * m[3] - m[1] * m[1];
    const double taken =
        (m[3] * m[2] * m[2] - 2.0 * m[1] * m[2] * m[4] + m[0] * m[4] * m[4]) / std::max(det, 1e-30);
    const double left = m[5] - taken;
    // The shortest exposure has the most steps left.
    if (views[0]->counts[at] < 3 || !(left > 1e-9 * m[5])) continue;
    fit.variance_rad2 += 1.0 / left;
    ++num_usable;
  }
  fit.keep = static_cast<double>(num_usable) / kNumPlaces;
  fit.variance_rad2 = num_usable > 0 ? fit.variance_rad2 / num_usable : 1e12;
  return fit;
}

// The likelihood of the decoder's nested unwrapping; see NestStep of the kernels.
void CapturePredictor::Nest(const std::vector<double>& fringes, const std::vector<SetNoise>& noise,
                            AxisResult& out) const {
  double stated = noise[0].stated / (fringes[0] * fringes[0]);
  double actual = noise[0].actual / (fringes[0] * fringes[0]);
  for (std::size_t i = 1; i < fringes.size(); ++i) {
    const double f2 = fringes[i] * fringes[i];
    const double systematic = phase_.phase_error_rad / kTwoPi * (1.0 + fringes[i] / fringes[i - 1]);
    const double variance = f2 * stated + noise[i].stated + systematic * systematic;
    const double farthest =
        std::min(phase_.max_order_error_ratio, 0.5 - least_log_odds_ * variance);
    const double sigma = std::sqrt(f2 * actual + noise[i].actual);
    const double sure = farthest > 0.0 ? WithinProbability(farthest, sigma) : 0.0;
    out.doubtful = 1.0 - (1.0 - out.doubtful) * sure;
    // Fused with the weights of the stated variances.
    const double own = noise[i].stated / f2;
    const double share = own / (own + stated);
    actual = share * share * actual + (1.0 - share) * (1.0 - share) * noise[i].actual / f2;
    stated = share * stated;
  }
  out.variance = actual;
}

// The likelihood of the decoder's joint unwrapping; see JointUnwrap. The log odds against an order
// at the distance D scatter about D^2 / 2 by D.
void CapturePredictor::Join(const std::vector<double>& fringes, const std::vector<SetNoise>& noise,
                            AxisResult& out) {
  auto found = orders_.find(fringes);
  if (found == orders_.end()) {
    found = orders_.emplace(fringes, ClosestOrders(fringes, kNumOrders)).first;
  }
  const double systematic = phase_.phase_error_rad / kTwoPi;
  std::vector<double> believed(noise.size());
  double information = 0.0;
  double spread = 0.0;
  double excess = 0.0;
  for (std::size_t i = 0; i < noise.size(); ++i) {
    believed[i] = noise[i].stated + systematic * systematic;
    excess += noise[i].actual / believed[i] / static_cast<double>(noise.size());
    const double weight = fringes[i] * fringes[i] / noise[i].stated;
    information += weight;
    spread += weight * weight * noise[i].actual / (fringes[i] * fringes[i]);
  }
  double doubt = 0.0;
  for (const WrongOrder& order : found->second) {
    const double distance2 = SquaredDistance(fringes, order.residual_cycles, believed);
    const double distance = std::sqrt(std::max(distance2, 1e-12));
    const double margin = 0.5 * distance2 - least_log_odds_;
    doubt += 2.0 * order.share * NormalCdf(-margin / (distance * std::sqrt(excess)));
  }
  out.doubtful = std::min(1.0, doubt);
  out.variance = spread / (information * information);
}

CapturePredictor::AxisResult CapturePredictor::Decode(const CaptureSettings& settings,
                                                      std::size_t pixel) {
  const std::size_t num_exposures = settings.exposures_s.size();
  noise_.resize(settings.fringes.size());
  AxisResult out;
  for (std::size_t i = 0; i < noise_.size(); ++i) {
    const SetFit fit = FitSet(&views_[i * num_exposures], num_exposures, settings.steps, pixel);
    out.keep = std::min(out.keep, fit.keep);
    const double noise_ratio2 = 0.5 * fit.count * fit.variance_rad2;
    const double least = phase_.min_modulation_sigma;
    if (!(least * least * noise_ratio2 <= 1.0)) out.keep = 0.0;
    out.noise_ratio = std::sqrt(noise_ratio2);
    noise_[i].stated = fit.variance_rad2 / (kTwoPi * kTwoPi);
    noise_[i].actual = (fit.variance_rad2 + 0.5 * ripples_[i] * ripples_[i]) / (kTwoPi * kTwoPi);
  }
  if (out.keep == 0.0) return out;
  if (settings.fringes.front() <= 1.0) {
    Nest(settings.fringes, noise_, out);
  } else {
    Join(settings.fringes, noise_, out);
  }
  out.keep *= 1.0 - out.doubtful;
  return out;
}

double CapturePredictor::SolveQuantile(const std::vector<double>& keep,
                                       const std::vector<double>& sigma) const {
  const double needed = config_.covered_ratio * static_cast<double>(keep.size());
  const auto covered = [&](double limit) {
    double sum = 0.0;
    for (std::size_t i = 0; i < keep.size(); ++i) {
      if (keep[i] > 0.0) sum += keep[i] * WithinProbability(limit, sigma[i]);
    }
    return sum;
  };
  double low = 0.0;
  double high = 0.0;
  for (std::size_t i = 0; i < keep.size(); ++i) {
    if (keep[i] > 0.0) high = std::max(high, 10.0 * sigma[i]);
  }
  if (!(covered(high) >= needed)) return kInfinity;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (covered(middle) < needed ? low : high) = middle;
  }
  return high / unit_quantile_;
}

CapturePrediction CapturePredictor::Run(const CaptureSettings& settings, double worth_m) {
  const std::size_t num_pixels = scene_.pixels.size();
  std::vector<double> keep(num_pixels, 1.0);
  std::vector<double> information(num_pixels, 0.0);
  std::vector<double> noise_ratios(num_pixels, 0.0);
  CapturePrediction out;
  for (const int axis : {0, 1}) {
    if (!(axis == 0 ? settings.axis_u : settings.axis_v)) continue;
    views_.clear();
    ripples_.clear();
    for (const double fringes : settings.fringes) {
      for (const double t : settings.exposures_s) {
        views_.push_back(&LookAt(axis, t, fringes, settings.steps));
      }
      ripples_.push_back(Ripple(axis, fringes, settings.steps));
    }
    out.ripple_rad = std::max(out.ripple_rad, ripples_.back());
    const double size_px = scene_.size_px[static_cast<std::size_t>(axis)];
    for (std::size_t i = 0; i < num_pixels; ++i) {
      const AxisResult result = Decode(settings, i);
      keep[i] *= result.keep;
      noise_ratios[i] = std::max(noise_ratios[i], result.noise_ratio);
      out.doubtful_ratio += result.doubtful / static_cast<double>(num_pixels);
      const double px_per_m = scene_.pixels[i].px_per_m[axis];
      if (result.variance > 0.0) {
        information[i] += px_per_m * px_per_m / (size_px * size_px * result.variance);
      }
    }
  }
  std::vector<double> sigma(num_pixels, kInfinity);
  double covered = 0.0;
  const double worth_limit = worth_m * unit_quantile_;
  for (std::size_t i = 0; i < num_pixels; ++i) {
    if (information[i] > 0.0) sigma[i] = 1.0 / std::sqrt(information[i]);
    if (!std::isfinite(sigma[i])) keep[i] = 0.0;
    out.valid_ratio += keep[i] / static_cast<double>(num_pixels);
    if (keep[i] > 0.0) covered += keep[i] * WithinProbability(worth_limit, sigma[i]);
  }
  out.sigma_depth_m = kInfinity;
  if (out.doubtful_ratio > config_.max_doubtful_ratio) return out;
  if (covered < config_.covered_ratio * static_cast<double>(num_pixels)) return out;
  out.sigma_depth_m = SolveQuantile(keep, sigma);
  const auto middle = noise_ratios.begin() + static_cast<std::ptrdiff_t>(num_pixels / 2);
  std::nth_element(noise_ratios.begin(), middle, noise_ratios.end());
  out.noise_ratio = *middle;
  return out;
}

}  // namespace fringe_fusion::diagnosis
