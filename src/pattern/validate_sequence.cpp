#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "axis_size.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"

namespace fringe_fusion {
namespace {

constexpr int kMaxBit = 20;
// A fringe of less needs the next one to look different, which pixels cannot [projector px].
constexpr double kMinFringePx = 2.0;
constexpr double kMaxExposureRatio = 1e4;
// Phases closer than this are told apart by no real sensor [fringes].
constexpr double kRepeatTolerance = 1e-3;

const char* AxisName(Axis axis) { return axis == Axis::kU ? "u" : "v"; }

Status ValidateGray(const Pattern& p, const std::string& owner) {
  if (p.bit < 0 || p.bit > kMaxBit) {
    return Fail("{}: bit {} is outside [0, {}]", owner, p.bit, kMaxBit);
  }
  if (!(p.cell_px >= 1.0) || !std::isfinite(p.cell_px)) {
    return Fail("{}: cell_px {} must be at least 1", owner, p.cell_px);
  }
  if (!std::isfinite(p.offset_px)) return Fail("{}: offset_px {} not finite", owner, p.offset_px);
  return {};
}

Status ValidateFringes(const Pattern& p, int size_px, const std::string& owner) {
  const int least_steps = p.kind == PatternKind::kMicro ? 1 : 3;
  if (p.steps < least_steps) {
    return Fail("{}: steps {} must be at least {}", owner, p.steps, least_steps);
  }
  if (p.step < 0 || p.step >= p.steps) {
    return Fail("{}: step {} is outside [0, {}]", owner, p.step, p.steps - 1);
  }
  const double max_fringes = size_px / kMinFringePx;
  if (!(p.fringes > 0.0 && p.fringes <= max_fringes)) {
    return Fail("{}: fringes {} is outside (0, {:g}]: a fringe needs {:g} of the {} px", owner,
                p.fringes, max_fringes, kMinFringePx, size_px);
  }
  if (!(std::abs(p.phase_sign) == 1.0)) {
    return Fail("{}: phase_sign {} must be 1 or -1", owner, p.phase_sign);
  }
  if (!std::isfinite(p.phase_offset_rad)) {
    return Fail("{}: phase_offset_rad {} not finite", owner, p.phase_offset_rad);
  }
  return {};
}

Status ValidateCarrier(const Pattern& p, const std::string& owner) {
  if (p.carrier_steps == 0) return {};
  if (p.kind != PatternKind::kPhase) return Fail("{}: only phase frames have a carrier", owner);
  if (p.carrier_steps < 3) {
    return Fail("{}: carrier_steps {} must be 0 or at least 3", owner, p.carrier_steps);
  }
  if (p.carrier_step < 0 || p.carrier_step >= p.carrier_steps) {
    return Fail("{}: carrier_step {} is outside [0, {}]", owner, p.carrier_step,
                p.carrier_steps - 1);
  }
  if (!(p.carrier_period_px >= 2.0) || !std::isfinite(p.carrier_period_px)) {
    return Fail("{}: carrier_period_px {} must be at least 2", owner, p.carrier_period_px);
  }
  return {};
}

Status ValidateFrame(const Pattern& p, int size_px, const std::string& owner) {
  if (!(p.exposure_ratio > 0.0 && p.exposure_ratio <= kMaxExposureRatio)) {
    return Fail("{}: exposure_ratio {} is outside (0, {:g}]", owner, p.exposure_ratio,
                kMaxExposureRatio);
  }
  if (p.kind == PatternKind::kGray) return ValidateGray(p, owner);
  if (p.kind == PatternKind::kPhase || p.kind == PatternKind::kMicro) {
    if (Status status = ValidateFringes(p, size_px, owner); !status) return status;
    return ValidateCarrier(p, owner);
  }
  return {};
}

/// What the frames of one axis amount to.
struct AxisCode {
  using SetKey = std::tuple<double, int, double, int>;  // fringes, steps, exposure, carrier steps
  std::map<SetKey, std::set<int>> phase_steps;
  std::map<double, std::set<int>> gray_bits;                      // by exposure
  std::map<double, std::map<double, std::set<int>>> micro_steps;  // by exposure and fringes
  double gray_cell_px = 0.0;

  Status Add(const Pattern& p, const std::string& frame) {
    bool fresh = true;
    if (p.kind == PatternKind::kPhase) {
      const SetKey key{p.fringes, p.steps, p.exposure_ratio, p.carrier_steps};
      const int number = p.step * std::max(1, p.carrier_steps) + p.carrier_step;
      fresh = phase_steps[key].insert(number).second;
    } else if (p.kind == PatternKind::kMicro) {
      fresh = micro_steps[p.exposure_ratio][p.fringes].insert(p.step).second;
    } else if (p.kind == PatternKind::kGray) {
      gray_bits[p.exposure_ratio].insert(p.bit);
      gray_cell_px = p.cell_px;
    }
    if (!fresh) return Fail("{}: the same step occurs twice", frame);
    return {};
  }
};

Status CheckSetsComplete(const AxisCode& code, const std::string& owner) {
  for (const auto& [key, steps] : code.phase_steps) {
    const auto& [fringes, num_steps, exposure, carrier_steps] = key;
    const int wanted = num_steps * std::max(1, carrier_steps);
    if (static_cast<int>(steps.size()) != wanted) {
      return Fail("{}: the phase set of {:g} fringes has {} of {} steps", owner, fringes,
                  steps.size(), wanted);
    }
  }
  for (const auto& [exposure, bits] : code.gray_bits) {
    if (*bits.begin() != 0 || *bits.rbegin() + 1 != static_cast<int>(bits.size())) {
      return Fail("{}: the Gray code has {} bits with gaps up to bit {}", owner, bits.size(),
                  *bits.rbegin());
    }
  }
  return {};
}

// F frequencies need F + 2 frames: A, B and the coordinate are common to all of them.
Status CheckMicroComplete(const AxisCode& code, const std::string& owner) {
  for (const auto& [exposure, frequencies] : code.micro_steps) {
    std::size_t most_steps = 0;
    for (const auto& [fringes, steps] : frequencies)
      most_steps = std::max(most_steps, steps.size());
    if (frequencies.size() < 2 || most_steps < 3) {
      return Fail(
          "{}: micro phase shifting has {} frequencies and {} steps of one, needs at least 2 and 3",
          owner, frequencies.size(), most_steps);
    }
  }
  return {};
}

std::vector<double> FringesOf(const AxisCode& code) {
  std::set<double> fringes;
  for (const auto& [key, steps] : code.phase_steps) fringes.insert(std::get<0>(key));
  return {fringes.begin(), fringes.end()};
}

Status CheckUnwrapping(const AxisCode& code, int size_px, const std::string& owner) {
  if (!code.micro_steps.empty() && (!code.phase_steps.empty() || !code.gray_bits.empty())) {
    return Fail("{}: micro phase shifting stands alone, but there are other codes", owner);
  }
  std::vector<double> fringes = FringesOf(code);
  if (!code.gray_bits.empty()) {
    if (fringes.empty()) return {};
    const double period_px = size_px / fringes.front();
    if (!(code.gray_cell_px <= period_px * (1.0 + 1e-9))) {
      return Fail("{}: Gray cells of {:g} px leave the order of fringes of {:g} px open", owner,
                  code.gray_cell_px, period_px);
    }
    return {};
  }
  if (!code.micro_steps.empty()) {
    for (const auto& [f, steps] : code.micro_steps.begin()->second) fringes.push_back(f);
  } else if (fringes.size() < 2) {
    return {};  // a single frequency is unwrapped over the image: relative coordinates
  }
  const double repeat = RepeatRatio(fringes, kRepeatTolerance);
  if (repeat < 1.0) {
    return Fail("{}: the {} frequencies repeat together after {:.6g} of {} px", owner,
                fringes.size(), repeat * size_px, size_px);
  }
  return {};
}

}  // namespace

double RepeatRatio(const std::vector<double>& fringes, double tolerance_ratio) {
  const double finest = *std::max_element(fringes.begin(), fringes.end());
  for (int k = 1; k < finest - tolerance_ratio; ++k) {
    const double distance = k / finest;
    const bool repeats = std::all_of(fringes.begin(), fringes.end(), [&](double f) {
      return std::abs(f * distance - std::round(f * distance)) < tolerance_ratio;
    });
    // Fringes of less than half the axis in this distance are no repetition.
    const bool moves =
        std::all_of(fringes.begin(), fringes.end(), [&](double f) { return f * distance > 0.5; });
    if (repeats && moves) return distance;
  }
  return 1.0;
}

Status Validate(const PatternSequence& sequence, const std::string& owner) {
  constexpr int kMaxSizePx = 16384;  // No projector has more; pictures beyond eat the memory.
  if (sequence.width < 1 || sequence.height < 1 || sequence.width > kMaxSizePx ||
      sequence.height > kMaxSizePx) {
    return Fail("{}: projector size {} x {} px must be from 1 x 1 to {} x {}", owner,
                sequence.width, sequence.height, kMaxSizePx, kMaxSizePx);
  }
  if (sequence.frames.empty()) return Fail("{}: no frames", owner);
  std::map<Axis, AxisCode> codes;
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const Pattern& p = sequence.frames[i];
    const std::string frame = fmt::format("{}: frame {} ({})", owner, i, PatternName(p));
    if (Status status = ValidateFrame(p, AxisSize(sequence, p.axis), frame); !status) return status;
    if (Status status = codes[p.axis].Add(p, frame); !status) return status;
  }
  for (const auto& [axis, code] : codes) {
    const int size_px = AxisSize(sequence, axis);
    const std::string axis_owner = fmt::format("{}: axis {}", owner, AxisName(axis));
    if (Status status = CheckSetsComplete(code, axis_owner); !status) return status;
    if (Status status = CheckMicroComplete(code, axis_owner); !status) return status;
    if (Status status = CheckUnwrapping(code, size_px, axis_owner); !status) return status;
  }
  return {};
}

}  // namespace fringe_fusion
