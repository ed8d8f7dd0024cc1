#include "time_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "response_bins.hpp"
#include "step_residuals.hpp"

namespace fringe_fusion::diagnosis {
namespace {

constexpr std::size_t kMaxTimedPixels = 8000;
constexpr std::size_t kMinTimedPixels = 200;
constexpr double kMinSignificance = 5.0;  // of a fringe shift, in standard deviations
// A moving picture shifts edges by tens of times the gain that it feigns; changes of light feign
// half of their own ratio as a shift, by edges that do not balance.
constexpr double kMinShiftPerFactor = 4.0;
// Moving fringes feign gain in coarser sets that is smaller by the ratio of the fringes.
constexpr double kMinPhaseShiftPerGain = 3.0;

std::vector<Eigen::Index> AllRows(const StepSamples& samples) {
  std::vector<Eigen::Index> rows(samples.pixels.size());
  std::iota(rows.begin(), rows.end(), Eigen::Index{0});
  return rows;
}

// Sets that hardly see the part move: all but the finest of their axis, if there are others.
std::vector<std::size_t> CoarseSets(const SequencePlan& plan) {
  std::vector<std::size_t> coarse;
  for (std::size_t s = 0; s < plan.sets.size(); ++s) {
    if (!IsFinest(plan, s) || IsCoarsest(plan, s)) coarse.push_back(s);
  }
  return coarse;
}

bool HasResiduals(const SequencePlan& plan, const std::vector<std::size_t>& sets) {
  return sets.size() > 1 || std::any_of(sets.begin(), sets.end(), [&](std::size_t s) {
           return plan.sets[s].frame_of_step.size() > 3;
         });
}

// The harmonic of the set that knows it best; b = 2 low = (gamma - 1) / (gamma + 2).
// Ref: science section 2.2.
void MeasureResponse(const std::vector<ResidualFit>& fits, TimeMeasures& measures) {
  double least = std::numeric_limits<double>::infinity();
  for (const ResidualFit& fit : fits) {
    if (!(fit.variance_low < least)) continue;
    least = fit.variance_low;
    measures.harmonic = 2.0 * fit.low.real();
  }
  const double b = std::clamp(measures.harmonic, -0.4, 0.8);
  measures.gamma = (1.0 + 2.0 * b) / (1.0 - b);
}

// Three steps have no second harmonic of their own: there white and black tell the curve.
void MeasureCurve(const SampledStack& stack, const SequencePlan& plan, TimeMeasures& measures) {
  bool has_coarser = false;  // else the phase is the bent one of the set itself
  for (std::size_t s = 0; s < plan.sets.size(); ++s) has_coarser |= !IsFinest(plan, s);
  const Result<ResponseCurve> curve = FitResponse(CollectResponse(stack, plan));
  if (!has_coarser || !curve) {
    measures.response_skipped =
        "harmonics need a set of at least 4 phase steps, or white, black and a coarser set";
    return;
  }
  measures.gamma = curve->gamma;
  measures.harmonic = (curve->gamma - 1.0) / (curve->gamma + 2.0);
}

double PhaseShift(const ResidualFit& fit, double steps) {
  const double squares = std::norm(fit.plus) + std::norm(fit.minus);
  if (!(squares > kMinSignificance * kMinSignificance * fit.variance_shift)) return 0.0;
  // plus and minus are i / 2 times coefficients of independent shifts, of variance 1 / N each.
  return std::sqrt(2.0 * steps * (squares - fit.variance_shift));
}

}  // namespace

TimeMeasures MeasureTime(const SampledStack& stack, const SequencePlan& plan,
                         const LightRange& range, const Image<float>& mean_image) {
  TimeMeasures measures;
  const StepSamples lit = SelectStepSamples(stack, plan, range, true, kMaxTimedPixels);
  const StepSamples unlit = SelectStepSamples(stack, plan, range, false, kMaxTimedPixels);
  const bool few = lit.pixels.size() < kMinTimedPixels;
  if (plan.sets.empty() || few) {
    const std::string why = few && !plan.sets.empty()
                                ? fmt::format("{} unsaturated lit pixels inside, needs {}",
                                              lit.pixels.size(), kMinTimedPixels)
                                : std::string("no complete set of phase steps");
    measures.response_skipped = measures.factors_skipped = measures.motion_skipped = why;
    return measures;
  }
  const std::vector<std::size_t> coarse = CoarseSets(plan);
  if (HasResiduals(plan, coarse)) {
    measures.factors = FitFrameFactors(lit, unlit, coarse);
  } else {
    measures.factors_skipped = "one set of 3 steps fits any light";
  }
  std::vector<ResidualFit> fits;
  for (std::size_t s = 0; s < plan.sets.size(); ++s) {
    const std::size_t steps = plan.sets[s].frame_of_step.size();
    if (steps < 4) continue;
    fits.push_back(FitResidual(lit, s, AllRows(lit)));
    if (!IsFinest(plan, s)) continue;
    measures.phase_shift_rad =
        std::max(measures.phase_shift_rad, PhaseShift(fits.back(), static_cast<double>(steps)));
  }
  measures.edge_shift = MeasureEdgeShift(stack, plan, range, mean_image);
  if (fits.empty()) {
    MeasureCurve(stack, plan, measures);
  } else {
    MeasureResponse(fits, measures);
  }
  return measures;
}

namespace {

void CheckResponse(const TimeMeasures& measures, const DiagnosisConfig& config,
                   Findings& findings) {
  constexpr const char* kQuantity = "distance of the response's gamma from 1";
  if (!measures.response_skipped.empty()) {
    findings.Skip(FindingKind::kResponse, kQuantity, measures.response_skipped);
    return;
  }
  if (findings.Measure(FindingKind::kResponse, kQuantity, std::abs(measures.gamma - 1.0),
                       config.max_gamma_error, "")) {
    return;
  }
  findings.Explain(
      fmt::format("the fringes have a second harmonic of {:.3f}, gamma {:.2f}, limit 1 +- {:.2f}",
                  measures.harmonic, measures.gamma, config.max_gamma_error),
      fmt::format("switch off picture modes and automatic gamma of projector and camera, or undo "
                  "the response in the patterns (pattern.yaml: gamma: {:.2f}); more phase steps "
                  "also help",
                  measures.gamma));
}

bool HasEdges(const EdgeShift& edges) { return edges.sigma_px > 0.0; }

double CertainShiftPx(const EdgeShift& edges) {
  return edges.rms_px > kMinSignificance * edges.sigma_px ? edges.rms_px : 0.0;
}

// Which of the causes that look alike explains the residuals.
enum class Cause { kGain, kAmbient, kMotion };

Cause CauseOf(const TimeMeasures& measures) {
  const FrameFactors& factors = measures.factors;
  const double shift = CertainShiftPx(measures.edge_shift);
  const double light = std::max(factors.gain_rms, factors.ambient_rms);
  if (shift > kMinShiftPerFactor * light) return Cause::kMotion;
  if (!HasEdges(measures.edge_shift) &&
      measures.phase_shift_rad > kMinPhaseShiftPerGain * factors.gain_rms) {
    return Cause::kMotion;
  }
  return factors.gain_energy >= factors.ambient_energy ? Cause::kGain : Cause::kAmbient;
}

// @return whether there is a finding.
bool CheckExposure(const TimeMeasures& measures, const DiagnosisConfig& config,
                   Findings& findings) {
  constexpr const char* kQuantity = "variation of the projector's light between frames, rms";
  if (!measures.factors_skipped.empty()) {
    findings.Skip(FindingKind::kExposure, kQuantity, measures.factors_skipped);
    return false;
  }
  const double value = measures.factors.gain_rms;
  if (value > config.max_gain_ratio && CauseOf(measures) != Cause::kGain) {
    findings.Skip(FindingKind::kExposure, kQuantity,
                  "flicker or motion explains the changes between the frames better");
    return false;
  }
  if (findings.Measure(FindingKind::kExposure, kQuantity, value, config.max_gain_ratio, "")) {
    return false;
  }
  findings.Explain(
      fmt::format("the projector's light varies by {:.2f} % from frame to frame, limit {:.2f} %",
                  100.0 * value, 100.0 * config.max_gain_ratio),
      "set the exposure to a multiple of the projector's frame period (16.67 ms at 60 Hz), or "
      "trigger the camera from the projector");
  return true;
}

bool CheckFlicker(const TimeMeasures& measures, const DiagnosisConfig& config, Findings& findings) {
  constexpr const char* kQuantity = "variation of the ambient light between frames, rms";
  if (!measures.factors_skipped.empty()) {
    findings.Skip(FindingKind::kFlicker, kQuantity, measures.factors_skipped);
    return false;
  }
  const double value = measures.factors.ambient_rms;
  if (value > config.max_flicker_ratio && CauseOf(measures) != Cause::kAmbient) {
    findings.Skip(FindingKind::kFlicker, kQuantity,
                  "the exposure or motion explains the changes between the frames better");
    return false;
  }
  if (findings.Measure(FindingKind::kFlicker, kQuantity, value, config.max_flicker_ratio, "")) {
    return false;
  }
  findings.Explain(
      fmt::format("light that is not the projector's varies by {:.2f} % of the projector's from "
                  "frame to frame, limit {:.2f} %",
                  100.0 * value, 100.0 * config.max_flicker_ratio),
      "shade the lamps, or set the exposure to a multiple of their period (10 ms at 50 Hz mains, "
      "8.33 ms at 60 Hz)");
  return true;
}

void CheckMotion(const TimeMeasures& measures, const DiagnosisConfig& config, bool light_changes,
                 Findings& findings) {
  constexpr const char* kEdges = "shift of edges between frames, rms";
  constexpr const char* kFringes = "shift of the finest fringes between frames, rms";
  constexpr const char* kAdvice =
      "wait longer after a move, fix the part, keep off the table; a shorter sequence or fewer "
      "frequencies see less of it";
  if (!measures.motion_skipped.empty()) {
    findings.Skip(FindingKind::kMotion, kEdges, measures.motion_skipped);
    return;
  }
  const EdgeShift& edges = measures.edge_shift;
  const double shift_px = CertainShiftPx(edges);
  // Fringes also seem to move when the light changes; edges tell the two apart.
  const double shift_rad = light_changes || HasEdges(edges) ? 0.0 : measures.phase_shift_rad;
  if (shift_px <= config.max_motion_px && shift_rad > config.max_motion_rad) {
    findings.Measure(FindingKind::kMotion, kFringes, shift_rad, config.max_motion_rad, "rad");
    findings.Explain(fmt::format("the finest fringes move by {:.4f} rad from frame to frame, limit "
                                 "{:.4f} rad",
                                 shift_rad, config.max_motion_rad),
                     kAdvice);
    return;
  }
  // Edges that do not balance let a change of light look like a small shift.
  if (light_changes && CauseOf(measures) != Cause::kMotion && shift_px > config.max_motion_px) {
    findings.Skip(FindingKind::kMotion, kEdges, "changes of the light feign it");
    return;
  }
  if (findings.Measure(FindingKind::kMotion, kEdges, shift_px, config.max_motion_px, "px")) return;
  findings.Explain(fmt::format("edges move by {:.3f} camera px from frame to frame ({} edge "
                               "pixels), limit {:.3f} px",
                               shift_px, edges.num_edges, config.max_motion_px),
                   kAdvice);
}

}  // namespace

void CheckTime(const TimeMeasures& measures, const DiagnosisConfig& config, Findings& findings) {
  CheckResponse(measures, config, findings);
  const bool exposure = CheckExposure(measures, config, findings);
  const bool flicker = CheckFlicker(measures, config, findings);
  CheckMotion(measures, config, exposure || flicker, findings);
}

}  // namespace fringe_fusion::diagnosis
