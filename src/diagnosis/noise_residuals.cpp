#include "noise_residuals.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "common/constants.hpp"
#include "common/dense.hpp"

namespace fringe_fusion::diagnosis {
namespace {

constexpr int kNumHarmonics = 6;        // of the response, taken out of the residuals
constexpr double kMinLevelSigma = 4.0;  // of a fitted grey value from both ends of the scale
// Harmonics of a strong response are taken out with the noise of phase and amplitude in them.
constexpr double kMaxOwnHarmonics = 0.03;  // [of B]

double At(const Image<float>& image, std::size_t i) { return static_cast<double>(image[i]); }

// Phase and amplitude of a set by other frames than its own, as far as there are any.
struct Reference {
  Image<float> phase_rad;
  Image<float> modulation_dn;
  bool own_phase = true;
};

// B times the harmonics of the phase: what a response curve, and errors common to a whole frame,
// leave in residuals.
Eigen::VectorXd HarmonicRow(double phase_rad, double b_dn) {
  Eigen::VectorXd row(2 * kNumHarmonics + 1);
  row[0] = b_dn;
  for (Eigen::Index k = 1; k <= kNumHarmonics; ++k) {
    row[2 * k - 1] = b_dn * std::cos(static_cast<double>(k) * phase_rad);
    row[2 * k] = b_dn * std::sin(static_cast<double>(k) * phase_rad);
  }
  return row;
}

// Subtracts from each column of `residuals` its least-squares fit by the harmonic basis.
// @return the largest coefficient [of B].
double RemoveHarmonics(const Reference& reference, const std::vector<std::size_t>& samples,
                       Eigen::MatrixXd& residuals) {
  constexpr Eigen::Index kSize = 2 * kNumHarmonics + 1;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(kSize, kSize);
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(kSize, residuals.cols());
  const auto row = [&](std::size_t k) {
    return HarmonicRow(At(reference.phase_rad, samples[k]),
                       At(reference.modulation_dn, samples[k]));
  };
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const Eigen::VectorXd x = row(k);
    normal.noalias() += x * x.transpose();
    right.noalias() += x * residuals.row(static_cast<Eigen::Index>(k));
  }
  // A camera that sees part of a fringe only leaves some harmonics undetermined.
  normal.diagonal().array() += 1e-9 * normal.trace() + 1e-300;
  const Eigen::MatrixXd coefficients = dense::SolveSymmetric(normal, right);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    residuals.row(static_cast<Eigen::Index>(k)) -= row(k).transpose() * coefficients;
  }
  return coefficients.size() > 0 ? coefficients.cwiseAbs().maxCoeff() : 0.0;
}

class Collector {
 public:
  Collector(const SampledStack& stack, const SequencePlan& plan, const SensorNoise& guess)
      : stack_(stack), plan_(plan), guess_(guess) {
    for (const StepSet& set : plan.sets) fits_.push_back(FitSteps(stack, set));
    u_ = FineCoordinate(plan, fits_, Axis::kU);
    v_ = FineCoordinate(plan, fits_, Axis::kV);
  }

  NoiseResiduals Collect() {
    const std::vector<StepSet>& sets = plan_.sets;
    bool any = false;
    for (std::size_t s = 0; s < sets.size(); ++s) {
      any = any || sets[s].frame_of_step.size() >= 4;
      if (sets[s].frame_of_step.size() >= 4) AddStepResiduals(s);
    }
    for (std::size_t s = 0; !any && s + 1 < sets.size(); s += 2) AddLevelDifference(s, s + 1);
    if (sets.empty()) return std::move(result_);
    // Different sets for the two, so that their errors are independent.
    std::size_t other = 0;
    while (other + 1 < sets.size() && sets[other].axis == sets.front().axis) ++other;
    AddLevelFrame(plan_.black_frames, -1.0, 0);
    AddLevelFrame(plan_.white_frames, 1.0, other);
    return std::move(result_);
  }

 private:
  [[nodiscard]] double Sigma(double level_dn) const {
    return std::sqrt(guess_.read_noise_dn * guess_.read_noise_dn + 1.0 / 12.0 +
                     guess_.gain_dn * std::max(level_dn, 0.0));
  }
  [[nodiscard]] bool IsClear(double level_dn) const {
    const double margin = kMinLevelSigma * Sigma(level_dn);
    return level_dn > margin && level_dn < static_cast<double>(stack_.full_scale_dn) - margin;
  }
  [[nodiscard]] double Steps(std::size_t s) const {
    return static_cast<double>(plan_.sets[s].frame_of_step.size());
  }
  // Cosine of step n at a sample, and the grey value that the fit gives there.
  [[nodiscard]] double Cosine(std::size_t s, std::size_t i, double n) const {
    return std::cos(At(fits_[s].phase_rad, i) - kTwoPi * n / Steps(s));
  }
  [[nodiscard]] double Fitted(std::size_t s, std::size_t i, double n) const {
    return At(fits_[s].offset_dn, i) + At(fits_[s].modulation_dn, i) * Cosine(s, i, n);
  }

  // Samples whose fitted grey values keep away from both ends of the scale.
  [[nodiscard]] std::vector<std::size_t> UsableSamples(std::size_t s) const {
    std::vector<std::size_t> usable;
    for (std::size_t i = 0; i < stack_.size(); ++i) {
      bool all = true;
      for (double n = 0.0; all && n < Steps(s); n += 1.0) all = IsClear(Fitted(s, i, n));
      if (all) usable.push_back(i);
    }
    return usable;
  }

  [[nodiscard]] Reference MakeReference(std::size_t s) const {
    Reference reference{fits_[s].phase_rad, fits_[s].modulation_dn, true};
    if (plan_.sets.size() > 1) {
      const auto others = static_cast<float>(plan_.sets.size() - 1);
      for (std::size_t i = 0; i < stack_.size(); ++i) {
        float sum = 0.0F;
        for (std::size_t t = 0; t < fits_.size(); ++t) {
          if (t != s) sum += fits_[t].modulation_dn[i];
        }
        reference.modulation_dn[i] = sum / others;
      }
    }
    const Image<float>& coordinate = plan_.sets[s].axis == Axis::kU ? u_ : v_;
    if (IsFinest(plan_, s) || coordinate.empty()) return reference;
    reference.own_phase = false;
    reference.phase_rad = PhaseAt(plan_.sets[s], coordinate);
    return reference;
  }

  void AddStepResiduals(std::size_t s) {
    const std::vector<int>& frames = plan_.sets[s].frame_of_step;
    const std::vector<std::size_t> samples = UsableSamples(s);
    Eigen::MatrixXd residuals(samples.size(), frames.size());
    for (std::size_t n = 0; n < frames.size(); ++n) {
      const Image<float>& frame = stack_.frames[static_cast<std::size_t>(frames[n])];
      for (std::size_t k = 0; k < samples.size(); ++k) {
        residuals(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(n)) =
            At(frame, samples[k]) - Fitted(s, samples[k], static_cast<double>(n));
      }
    }
    const Reference reference = MakeReference(s);
    const double harmonics = RemoveHarmonics(reference, samples, residuals);
    if (reference.own_phase && harmonics > kMaxOwnHarmonics) return;
    const double dof = Steps(s) - 3.0;
    for (std::size_t k = 0; k < samples.size(); ++k) {
      NoiseResidual value;
      value.dof = dof;
      value.variance_dn2 = residuals.row(static_cast<Eigen::Index>(k)).squaredNorm() / dof;
      // The design is orthogonal: each step gives (N - 3) / N of its variance, so A is the level.
      value.level_dn = At(fits_[s].offset_dn, samples[k]);
      Append(value, s, samples[k]);
    }
    CloseGroup(IsFinest(plan_, s));
  }

  // White is A + B and black A - B of any set that neither blur nor response changes.
  void AddLevelFrame(const std::vector<int>& frames, double side, std::size_t s) {
    if (frames.empty()) return;
    const Image<float> level = MeanOfFrames(stack_, frames);
    const auto predicted = [&](std::size_t i) {
      return At(fits_[s].offset_dn, i) + side * At(fits_[s].modulation_dn, i);
    };
    std::vector<std::size_t> samples;
    for (const std::size_t i : UsableSamples(s)) {
      // A fringe amplitude within its noise is biased: it cannot be negative.
      const double sigma_b = std::sqrt(2.0 / Steps(s)) * Sigma(At(fits_[s].offset_dn, i));
      if (IsClear(predicted(i)) && At(fits_[s].modulation_dn, i) > 8.0 * sigma_b) {
        samples.push_back(i);
      }
    }
    Eigen::MatrixXd residuals(samples.size(), 1);
    for (std::size_t k = 0; k < samples.size(); ++k) {
      residuals(static_cast<Eigen::Index>(k), 0) = At(level, samples[k]) - predicted(samples[k]);
    }
    if (RemoveHarmonics(MakeReference(s), samples, residuals) > kMaxOwnHarmonics) return;
    const auto count = static_cast<double>(frames.size());
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const std::size_t i = samples[k];
      NoiseResidual value;
      value.variance_dn2 = std::pow(residuals(static_cast<Eigen::Index>(k), 0), 2);
      value.constant = 1.0 / count;
      value.level_dn = predicted(i) / count;
      // A +- B is a weighted mean of the steps.
      for (double n = 0.0; n < Steps(s); n += 1.0) {
        const double weight = (1.0 + side * 2.0 * Cosine(s, i, n)) / Steps(s);
        value.constant += weight * weight;
        value.level_dn += weight * weight * Fitted(s, i, n);
      }
      Append(value, s, i);
    }
    CloseGroup(false);
  }

  // The mean level of a set does not depend on its frequency.
  void AddLevelDifference(std::size_t s, std::size_t t) {
    const std::vector<std::size_t> samples = UsableSamples(s);
    Eigen::MatrixXd residuals(samples.size(), 1);
    for (std::size_t k = 0; k < samples.size(); ++k) {
      residuals(static_cast<Eigen::Index>(k), 0) =
          At(fits_[s].offset_dn, samples[k]) - At(fits_[t].offset_dn, samples[k]);
    }
    double harmonics = RemoveHarmonics(MakeReference(s), samples, residuals);
    harmonics = std::max(harmonics, RemoveHarmonics(MakeReference(t), samples, residuals));
    if (harmonics > kMaxOwnHarmonics) return;
    const double constant = 1.0 / Steps(s) + 1.0 / Steps(t);
    for (std::size_t k = 0; k < samples.size(); ++k) {
      NoiseResidual value;
      value.variance_dn2 = std::pow(residuals(static_cast<Eigen::Index>(k), 0), 2);
      value.constant = constant;
      value.level_dn = constant * At(fits_[s].offset_dn, samples[k]);
      Append(value, s, samples[k]);
    }
    CloseGroup(false);
  }

  void Append(NoiseResidual& value, std::size_t s, std::size_t i) {
    value.b2_dn2 = std::pow(At(fits_[s].modulation_dn, i), 2);
    value.group = result_.num_groups;
    result_.values.push_back(value);
  }

  void CloseGroup(bool finest) {
    if (result_.values.empty() || result_.values.back().group != result_.num_groups) return;
    if (finest) result_.finest_groups.push_back(result_.num_groups);
    ++result_.num_groups;
  }

  const SampledStack& stack_;
  const SequencePlan& plan_;
  const SensorNoise& guess_;
  std::vector<StepFit> fits_;
  Image<float> u_;
  Image<float> v_;
  NoiseResiduals result_;
};

}  // namespace

NoiseResiduals CollectNoiseResiduals(const SampledStack& stack, const SequencePlan& plan,
                                     const SensorNoise& guess) {
  return Collector(stack, plan, guess).Collect();
}

}  // namespace fringe_fusion::diagnosis
