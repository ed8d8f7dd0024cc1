#include "fringe_fusion/pattern/pattern_sequence.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <sstream>
#include <tuple>

namespace fringe_fusion {
namespace {

constexpr double kPi = 3.14159265358979323846;

int AxisSize(const PatternSequence& sequence, Axis axis) {
  return axis == Axis::kU ? sequence.width : sequence.height;
}

int NumGrayBits(int size) {
  int bits = 0;
  while ((1 << bits) < size) ++bits;
  return bits;
}

Result<std::vector<double>> ParseFringes(const std::string& list) {
  std::vector<double> fringes;
  std::istringstream stream(list);
  std::string item;
  while (std::getline(stream, item, ',')) {
    std::istringstream number(item);
    double value = 0.0;
    if (!(number >> value) || !(number >> std::ws).eof() || !(value > 0.0) ||
        !std::isfinite(value)) {
      return Fail("pattern: fringes = '{}' has the item '{}', must be positive numbers like 1,8,64",
                  list, item);
    }
    if (!fringes.empty() && !(value > fringes.back())) {
      return Fail("pattern: fringes = '{}' must rise", list);
    }
    fringes.push_back(value);
  }
  return fringes;
}

Pattern GrayPattern(Axis axis, int bit, bool inverse) {
  Pattern pattern;
  pattern.kind = PatternKind::kGray;
  pattern.axis = axis;
  pattern.bit = bit;
  pattern.inverse = inverse;
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

// Light of one pattern at one projector coordinate, 0..1, before gamma correction.
double Light(const Pattern& pattern, int coordinate, int size) {
  switch (pattern.kind) {
    case PatternKind::kWhite:
      return 1.0;
    case PatternKind::kBlack:
      return 0.0;
    case PatternKind::kGray: {
      const double cell = (coordinate - pattern.offset_px + 0.5) / pattern.cell_px;
      const auto code = static_cast<unsigned>(std::max(0.0, std::floor(cell)));
      const bool on = (((code ^ (code >> 1U)) >> static_cast<unsigned>(pattern.bit)) & 1U) != 0U;
      return on != pattern.inverse ? 1.0 : 0.0;
    }
    case PatternKind::kPhase: {
      const double phase =
          pattern.phase_sign *
          (2.0 * kPi * pattern.fringes * (coordinate + 0.5) / size + pattern.phase_offset_rad);
      return 0.5 + 0.5 * std::cos(phase - 2.0 * kPi * pattern.step / pattern.steps);
    }
  }
  return 0.0;
}

Status ValidateFrame(const Pattern& p, const std::string& owner) {
  if (p.kind == PatternKind::kGray) {
    if (p.bit < 0 || p.bit > 20) return Fail("{}: bit {} is outside [0, 20]", owner, p.bit);
    if (p.cell_px < 1) return Fail("{}: cell_px {} must be at least 1", owner, p.cell_px);
    if (!std::isfinite(p.offset_px)) return Fail("{}: offset_px {} not finite", owner, p.offset_px);
  }
  if (p.kind == PatternKind::kPhase) {
    if (p.steps < 3) return Fail("{}: steps {} must be at least 3", owner, p.steps);
    if (p.step < 0 || p.step >= p.steps) {
      return Fail("{}: step {} is outside [0, {}]", owner, p.step, p.steps - 1);
    }
    if (!(p.fringes > 0.0) || !std::isfinite(p.fringes)) {
      return Fail("{}: fringes {} must be positive", owner, p.fringes);
    }
    if (!(std::abs(p.phase_sign) == 1.0)) {
      return Fail("{}: phase_sign {} must be 1 or -1", owner, p.phase_sign);
    }
    if (!std::isfinite(p.phase_offset_rad)) {
      return Fail("{}: phase_offset_rad {} not finite", owner, p.phase_offset_rad);
    }
  }
  return {};
}

}  // namespace

std::string PatternName(const Pattern& pattern) {
  const char axis = pattern.axis == Axis::kU ? 'u' : 'v';
  switch (pattern.kind) {
    case PatternKind::kWhite:
      return "white";
    case PatternKind::kBlack:
      return "black";
    case PatternKind::kGray:
      return fmt::format("gray_{}_b{}{}", axis, pattern.bit, pattern.inverse ? "_inv" : "");
    case PatternKind::kPhase:
      return fmt::format("phase_{}_f{:g}_{}of{}", axis, pattern.fringes, pattern.step,
                         pattern.steps);
  }
  return "unknown";
}

Status Validate(const PatternSequence& sequence, const std::string& owner) {
  if (sequence.width < 1 || sequence.height < 1) {
    return Fail("{}: projector size {} x {} must be at least 1 x 1", owner, sequence.width,
                sequence.height);
  }
  if (sequence.frames.empty()) return Fail("{}: no frames", owner);
  std::map<std::tuple<Axis, double, int>, std::set<int>> phase_steps;
  std::map<Axis, std::set<int>> gray_bits;
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const Pattern& p = sequence.frames[i];
    const std::string frame = fmt::format("{}: frame {} ({})", owner, i, PatternName(p));
    if (Status status = ValidateFrame(p, frame); !status) return status;
    if (p.kind == PatternKind::kGray) gray_bits[p.axis].insert(p.bit);
    if (p.kind == PatternKind::kPhase &&
        !phase_steps[{p.axis, p.fringes, p.steps}].insert(p.step).second) {
      return Fail("{}: the same step occurs twice", frame);
    }
  }
  for (const auto& [key, steps] : phase_steps) {
    if (static_cast<int>(steps.size()) != std::get<2>(key)) {
      return Fail("{}: the phase set of {:g} fringes has {} of {} steps", owner, std::get<1>(key),
                  steps.size(), std::get<2>(key));
    }
  }
  for (const auto& [axis, bits] : gray_bits) {
    if (*bits.begin() != 0 || *bits.rbegin() + 1 != static_cast<int>(bits.size())) {
      return Fail("{}: the Gray code of axis {} has {} bits with gaps up to bit {}", owner,
                  axis == Axis::kU ? "u" : "v", bits.size(), *bits.rbegin());
    }
  }
  return {};
}

Result<PatternSequence> MakeSequence(const PatternConfig& config, int width, int height) {
  if (Status status = CheckBounds(config, "pattern"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const Result<std::vector<double>> fringes = ParseFringes(config.fringes);
  if (!fringes) return Forward(fringes);
  if (!config.axis_u && !config.axis_v) return Fail("pattern: neither axis_u nor axis_v is coded");
  if (!config.gray && fringes->empty()) return Fail("pattern: neither Gray code nor fringes");
  PatternSequence sequence;
  sequence.width = width;
  sequence.height = height;
  sequence.frames.resize(2);
  sequence.frames[1].kind = PatternKind::kBlack;
  for (const Axis axis : {Axis::kU, Axis::kV}) {
    if (!(axis == Axis::kU ? config.axis_u : config.axis_v)) continue;
    if (config.gray) {
      for (int bit = NumGrayBits(AxisSize(sequence, axis)) - 1; bit >= 0; --bit) {
        sequence.frames.push_back(GrayPattern(axis, bit, false));
        sequence.frames.push_back(GrayPattern(axis, bit, true));
      }
    }
    for (const double f : *fringes) {
      for (int step = 0; step < config.steps; ++step) {
        sequence.frames.push_back(PhasePattern(axis, f, step, config.steps));
      }
    }
  }
  if (Status status = Validate(sequence, "pattern"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return sequence;
}

Image<std::uint8_t> RenderPattern(const Pattern& pattern, int width, int height, double gamma) {
  Image<std::uint8_t> picture(width, height);
  const bool along_u = pattern.axis == Axis::kU;
  const int size = along_u ? width : height;
  std::vector<std::uint8_t> line(static_cast<std::size_t>(size));
  for (int i = 0; i < size; ++i) {
    const double light = Light(pattern, i, size);
    line[static_cast<std::size_t>(i)] =
        static_cast<std::uint8_t>(std::lround(255.0 * std::pow(light, 1.0 / gamma)));
  }
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      picture(x, y) = line[static_cast<std::size_t>(along_u ? x : y)];
    }
  }
  return picture;
}

}  // namespace fringe_fusion
