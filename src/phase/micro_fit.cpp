#include "micro_fit.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>

#include "common/constants.hpp"

namespace fringe_fusion::decode {
namespace {

constexpr std::size_t kNumRefined = 6;
constexpr int kNumSteps = 3;
constexpr double kNegligibleCost = 60.0;
constexpr double kImpossible = 1e30;

// The frequency with most frames gives the first estimate of offset and amplitude.
double ReferenceFringes(const std::vector<MicroSample>& samples) {
  std::map<double, int> counts;
  for (const MicroSample& sample : samples) ++counts[sample.fringes];
  const auto most =
      std::max_element(counts.begin(), counts.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  return most->first;
}

}  // namespace

MicroFit::MicroFit(const AxisPlan& plan, const DecodeContext& context)
    : plan_(plan), context_(context), reference_fringes_(ReferenceFringes(plan.micro)) {
  for (const MicroSample& sample : plan.micro) {
    const double exposure = context.plan.groups[static_cast<std::size_t>(sample.group)].ratio;
    frames_.push_back(sample.frame);
    samples_.push_back({nullptr, sample.fringes, sample.psi_rad, exposure, 0.0, 0.0});
  }
}

void MicroFit::Load(const FrameRows& rows) {
  for (std::size_t i = 0; i < samples_.size(); ++i) samples_[i].row = rows.frame(frames_[i]);
}

Unwrapped MicroFit::Run(std::size_t x) {
  Unwrapped out;
  Fitted reference;
  offset_dn_ = modulation_dn_ = 0.0;
  if (!ReadPixel(x) || !FitReference(reference)) {
    out.status = kRowSaturated;
    return out;
  }
  offset_dn_ = reference.offset;
  modulation_dn_ = reference.amplitude;
  const double noise = static_cast<double>(
      NoiseVariance(context_.config, static_cast<float>(std::max(0.0, reference.offset))));
  const double least = context_.config.min_modulation_sigma;
  if (!(reference.amplitude * reference.amplitude >= least * least * noise)) {
    out.status = kRowLowModulation;
    return out;
  }
  std::vector<Fitted> candidates;
  for (int k = -1; k <= static_cast<int>(std::ceil(reference_fringes_)); ++k) {
    Fitted candidate = reference;
    candidate.ratio = (reference.ratio + k) / reference_fringes_;
    if (candidate.ratio < -0.02 || candidate.ratio > 1.02) continue;
    candidate.chi2 = CostOf(reference, candidate.ratio);
    candidates.push_back(candidate);
  }
  const auto cheaper = [](const Fitted& a, const Fitted& b) { return a.chi2 < b.chi2; };
  const std::size_t count = std::min(kNumRefined, candidates.size());
  std::partial_sort(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(count),
                    candidates.end(), cheaper);
  candidates.resize(count);
  for (Fitted& candidate : candidates) candidate = Refine(candidate);
  std::sort(candidates.begin(), candidates.end(), cheaper);
  return Judge(candidates);
}

bool MicroFit::ReadPixel(std::size_t x) {
  used_.clear();
  const auto saturation = static_cast<double>(context_.saturation_dn());
  for (Sample sample : samples_) {
    sample.grey = static_cast<double>(sample.row[x]);
    if (!(sample.grey < saturation)) continue;
    sample.weight = 1.0 / static_cast<double>(NoiseVariance(context_.config, sample.row[x]));
    used_.push_back(sample);
  }
  return used_.size() >= 4;
}

// Least squares of A, a, b on the frames of one frequency; ratio holds its cycles.
bool MicroFit::FitReference(Fitted& out) const {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  int count = 0;
  for (const Sample& sample : used_) {
    if (sample.fringes != reference_fringes_) continue;
    // cos(theta + psi) = cos theta cos psi - sin theta sin psi.
    const Eigen::Vector3d row =
        sample.exposure * Eigen::Vector3d(1.0, std::cos(sample.psi_rad), -std::sin(sample.psi_rad));
    normal += sample.weight * row * row.transpose();
    right += sample.weight * sample.grey * row;
    ++count;
  }
  Eigen::Matrix3d inverse;
  bool invertible = false;
  normal.computeInverseWithCheck(inverse, invertible, 1e-12);
  if (count < 3 || !invertible) return false;
  const Eigen::Vector3d solution = inverse * right;
  const double cycles = std::atan2(solution[2], solution[1]) / kTwoPi;
  out.offset = solution[0];
  out.amplitude = std::hypot(solution[1], solution[2]);
  out.ratio = cycles - std::floor(cycles);
  return true;
}

double MicroFit::CostOf(const Fitted& fitted, double ratio) const {
  double cost = 0.0;
  for (const Sample& sample : used_) {
    const double light = std::cos(kTwoPi * sample.fringes * ratio + sample.psi_rad);
    const double error = sample.grey - sample.exposure * (fitted.offset + fitted.amplitude * light);
    cost += sample.weight * error * error;
  }
  return cost;
}

// Gauss-Newton on offset, amplitude and coordinate, within the candidate's own fringe.
MicroFit::Fitted MicroFit::Refine(Fitted start) const {
  Fitted fitted = start;
  const double reach = 0.5 / reference_fringes_;
  for (int step = 0; step < kNumSteps; ++step) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const Sample& sample : used_) {
      const double phase = kTwoPi * sample.fringes * fitted.ratio + sample.psi_rad;
      const double model = sample.exposure * (fitted.offset + fitted.amplitude * std::cos(phase));
      const double slope = -fitted.amplitude * kTwoPi * sample.fringes * std::sin(phase);
      const Eigen::Vector3d row = sample.exposure * Eigen::Vector3d(1.0, std::cos(phase), slope);
      const double weight = 1.0 / static_cast<double>(NoiseVariance(
                                      context_.config, static_cast<float>(std::max(0.0, model))));
      normal += weight * row * row.transpose();
      right += weight * (sample.grey - model) * row;
    }
    Eigen::Matrix3d inverse;
    bool invertible = false;
    normal.computeInverseWithCheck(inverse, invertible, 1e-30);
    if (!invertible) return start;
    const Eigen::Vector3d change = inverse * right;
    fitted.offset += change[0];
    fitted.amplitude += change[1];
    fitted.ratio = std::clamp(fitted.ratio + change[2], start.ratio - reach, start.ratio + reach);
    fitted.variance = inverse(2, 2);
  }
  // Half a fringe away a negative amplitude gives nearly the same light.
  fitted.chi2 = fitted.amplitude > 0.0 ? CostOf(fitted, fitted.ratio) : kImpossible;
  return fitted;
}

Unwrapped MicroFit::Judge(const std::vector<Fitted>& refined) {
  Unwrapped out;
  const Fitted& best = refined.front();
  double others = 0.0;
  for (const Fitted& other : refined) {
    // Two starts may run into the same minimum.
    if (std::abs(other.ratio - best.ratio) < 0.25 / reference_fringes_) continue;
    const double above = other.chi2 - best.chi2;
    if (above < 2.0 * kNegligibleCost) others += std::exp(-0.5 * above);
  }
  out.log_odds = others > 0.0 ? -std::log(others) : kNegligibleCost;
  out.coordinate_px = plan_.size_px * best.ratio - 0.5;
  out.variance_px2 = static_cast<double>(plan_.size_px) * plan_.size_px * best.variance;
  offset_dn_ = best.offset;
  modulation_dn_ = std::abs(best.amplitude);
  const double dof = static_cast<double>(used_.size()) - 3.0;
  const double limit = context_.config.max_residual_sigma;
  double information = 0.0;
  for (const Sample& sample : used_)
    information += sample.weight * sample.exposure * sample.exposure;
  const double harmonic = context_.config.max_harmonic_ratio * best.amplitude;
  if (!(best.chi2 <= limit * limit * dof + harmonic * harmonic * information)) {
    out.status = kRowResidual;
  }
  return out;
}

}  // namespace fringe_fusion::decode
