#include "fringe_fusion/pattern/pattern_sequence.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "axis_size.hpp"

namespace fringe_fusion {
namespace {

constexpr double kQuarterTurn = 1.57079632679489661923;

// Positive numbers between commas.
Result<std::vector<double>> ParseList(const char* name, const std::string& list) {
  std::vector<double> values;
  std::istringstream stream(list);
  std::string item;
  while (std::getline(stream, item, ',')) {
    std::istringstream number(item);
    double value = 0.0;
    if (!(number >> value) || !(number >> std::ws).eof() || !(value > 0.0) ||
        !std::isfinite(value)) {
      return Fail("pattern: {} = '{}' has the item '{}', must be positive numbers like 1,8,64",
                  name, list, item);
    }
    values.push_back(value);
  }
  return values;
}

/// The lists of a PatternConfig.
struct Lists {
  std::vector<double> fringes;
  std::vector<double> periods_px;
  std::vector<double> exposures;

  [[nodiscard]] std::vector<double> FringesOver(int size_px) const {
    std::vector<double> out = fringes;
    for (const double period : periods_px) out.push_back(size_px / period);
    return out;
  }
};

Result<Lists> ParseLists(const PatternConfig& config) {
  const auto fringes = ParseList("fringes", config.periods_px.empty() ? config.fringes : "");
  if (!fringes) return Forward(fringes);
  const auto periods = ParseList("periods_px", config.periods_px);
  if (!periods) return Forward(periods);
  const auto exposures = ParseList("exposures", config.exposures);
  if (!exposures) return Forward(exposures);
  if (std::adjacent_find(fringes->begin(), fringes->end(), std::greater_equal<>()) !=
      fringes->end()) {
    return Fail("pattern: fringes = '{}' must rise", config.fringes);
  }
  if (std::adjacent_find(periods->begin(), periods->end(), std::less_equal<>()) != periods->end()) {
    return Fail("pattern: periods_px = '{}' must fall", config.periods_px);
  }
  if (exposures->empty()) return Fail("pattern: exposures = '' needs at least one ratio");
  return Lists{*fringes, *periods, *exposures};
}

Pattern GrayPattern(Axis axis, int bit, bool inverse, double cell_px) {
  Pattern pattern;
  pattern.kind = PatternKind::kGray;
  pattern.axis = axis;
  pattern.bit = bit;
  pattern.inverse = inverse;
  pattern.cell_px = cell_px;
  return pattern;
}

Pattern PhasePattern(Axis axis, double fringes, int step, int steps) {
  Pattern pattern;
  pattern.kind = PatternKind::kPhase;
  pattern.axis = axis;
  pattern.fringes = fringes;
  pattern.step = step;
  pattern.steps = steps;
  return pattern;
}

void AddGray(const PatternConfig& config, Axis axis, double cell_px, PatternSequence& sequence) {
  int bits = 0;
  while (cell_px * (1 << bits) < AxisSize(sequence, axis)) ++bits;
  for (int bit = bits - 1; bit >= 0; --bit) {
    sequence.frames.push_back(GrayPattern(axis, bit, false, cell_px));
    if (config.gray_inverse) sequence.frames.push_back(GrayPattern(axis, bit, true, cell_px));
  }
}

void AddPhaseSet(const PatternConfig& config, Axis axis, double fringes,
                 PatternSequence& sequence) {
  for (int step = 0; step < config.steps; ++step) {
    Pattern pattern = PhasePattern(axis, fringes, step, config.steps);
    if (!(config.carrier_period_px > 0.0)) {
      sequence.frames.push_back(pattern);
      continue;
    }
    pattern.carrier_period_px = config.carrier_period_px;
    pattern.carrier_steps = config.carrier_steps;
    for (int carrier = 0; carrier < config.carrier_steps; ++carrier) {
      pattern.carrier_step = carrier;
      sequence.frames.push_back(pattern);
    }
  }
}

// The first frequency has three steps and so gives A and B; the others add one frame each. Cosines
// of whole fringes are the same at X and 1 - X, so every second one is shifted by a quarter.
void AddMicro(Axis axis, const std::vector<double>& fringes, PatternSequence& sequence) {
  for (std::size_t i = 0; i < fringes.size(); ++i) {
    const int steps = i == 0 ? 3 : 1;
    for (int step = 0; step < steps; ++step) {
      sequence.frames.push_back(PhasePattern(axis, fringes[i], step, steps));
      sequence.frames.back().kind = PatternKind::kMicro;
      sequence.frames.back().phase_offset_rad = i % 2 == 1 ? kQuarterTurn : 0.0;
    }
  }
}

PatternSequence BuildSequence(const PatternConfig& config, const Lists& lists, int width,
                              int height) {
  PatternSequence sequence;
  sequence.width = width;
  sequence.height = height;
  sequence.frames.resize(2);
  sequence.frames[1].kind = PatternKind::kBlack;
  for (const Axis axis : {Axis::kU, Axis::kV}) {
    if (!(axis == Axis::kU ? config.axis_u : config.axis_v)) continue;
    const int size_px = AxisSize(sequence, axis);
    const std::vector<double> fringes = lists.FringesOver(size_px);
    if (config.gray) {
      const bool half = config.gray_half_period && !fringes.empty();
      AddGray(config, axis, half ? 0.5 * size_px / fringes.front() : 1.0, sequence);
    }
    if (config.micro) {
      AddMicro(axis, fringes, sequence);
    } else {
      for (const double f : fringes) AddPhaseSet(config, axis, f, sequence);
    }
  }
  return sequence;
}

}  // namespace

std::string PatternName(const Pattern& pattern) {
  const char axis = pattern.axis == Axis::kU ? 'u' : 'v';
  std::string name = "unknown";
  switch (pattern.kind) {
    case PatternKind::kWhite:
      name = "white";
      break;
    case PatternKind::kBlack:
      name = "black";
      break;
    case PatternKind::kGray:
      name = fmt::format("gray_{}_b{}{}", axis, pattern.bit, pattern.inverse ? "_inv" : "");
      break;
    case PatternKind::kPhase:
    case PatternKind::kMicro:
      name =
          fmt::format("{}_{}_f{:g}_{}of{}", pattern.kind == PatternKind::kPhase ? "phase" : "micro",
                      axis, pattern.fringes, pattern.step, pattern.steps);
      if (pattern.kind == PatternKind::kPhase && pattern.carrier_steps > 0) {
        name += fmt::format("_c{}of{}", pattern.carrier_step, pattern.carrier_steps);
      }
      break;
  }
  return pattern.exposure_ratio == 1.0 ? name
                                       : name + fmt::format("_e{:g}", pattern.exposure_ratio);
}

Result<PatternSequence> MakeSequence(const PatternConfig& config, int width, int height) {
  if (Status status = CheckBounds(config, "pattern"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const Result<Lists> lists = ParseLists(config);
  if (!lists) return Forward(lists);
  if (!config.axis_u && !config.axis_v) return Fail("pattern: neither axis_u nor axis_v is coded");
  if (!config.gray && lists->FringesOver(1).empty()) {
    return Fail("pattern: neither Gray code nor fringes");
  }
  PatternSequence sequence = BuildSequence(config, *lists, width, height);
  const std::vector<Pattern> once = sequence.frames;
  sequence.frames.clear();
  for (const double exposure : lists->exposures) {
    for (Pattern pattern : once) {
      pattern.exposure_ratio = exposure;
      sequence.frames.push_back(pattern);
    }
  }
  if (Status status = Validate(sequence, "pattern"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return sequence;
}

}  // namespace fringe_fusion
