#include "decode_plan.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <tuple>

#include "common/constants.hpp"

namespace fringe_fusion::decode {
namespace {

// Exposures closer than this are one group: timers of cameras are not exact.
constexpr double kSameExposureRatio = 1e-3;

Status AddGrayFrame(const Pattern& pattern, int frame, int group, AxisPlan& plan) {
  if (!plan.gray) plan.gray = GrayCode{pattern.cell_px, pattern.offset_px, {}};
  GrayCode& code = *plan.gray;
  if (pattern.cell_px != code.cell_px || pattern.offset_px != code.offset_px) {
    return Fail("pattern: frame {} ({}) has cell_px {} offset_px {}, but its code has {} and {}",
                frame, PatternName(pattern), pattern.cell_px, pattern.offset_px, code.cell_px,
                code.offset_px);
  }
  const auto bit = static_cast<std::size_t>(pattern.bit);
  if (code.bits.size() <= bit) code.bits.resize(bit + 1);
  std::vector<GrayRead>& reads = code.bits[bit].reads;
  auto read = std::find_if(reads.begin(), reads.end(),
                           [&](const GrayRead& other) { return other.group == group; });
  if (read == reads.end()) read = reads.insert(reads.end(), GrayRead{-1, -1, group});
  int& slot = pattern.inverse ? read->inverse_frame : read->frame;
  if (slot >= 0) {
    return Fail("pattern: frames {} and {} are both {}", slot, frame, PatternName(pattern));
  }
  slot = frame;
  return {};
}

Status AddPhaseFrame(const Pattern& pattern, int frame, int group, AxisPlan& plan) {
  const auto same_set = [&](const PhaseSet& set) {
    return set.fringes == pattern.fringes && set.carrier_steps == pattern.carrier_steps;
  };
  auto set = std::find_if(plan.sets.begin(), plan.sets.end(), same_set);
  if (set == plan.sets.end()) {
    PhaseSet fresh;
    fresh.fringes = pattern.fringes;
    fresh.sign = pattern.phase_sign;
    fresh.steps = pattern.steps;
    fresh.carrier_steps = pattern.carrier_steps;
    set = plan.sets.insert(plan.sets.end(), fresh);
  }
  if (pattern.phase_sign != set->sign) {
    return Fail("pattern: frame {} ({}) has phase_sign {}, but its set has {}", frame,
                PatternName(pattern), pattern.phase_sign, set->sign);
  }
  set->even = set->even && pattern.steps == set->steps;
  // cos(s (theta + o) - d) = cos(s theta - (d - s o)): an offset of one frame is a shift of it.
  const double delta_rad =
      kTwoPi * pattern.step / pattern.steps - pattern.phase_sign * pattern.phase_offset_rad;
  set->samples.push_back({frame, delta_rad, pattern.step, pattern.carrier_step, group});
  return {};
}

void AddMicroFrame(const Pattern& pattern, int frame, int group, AxisPlan& plan) {
  // cos(s (theta + o) - d) = cos(theta + o - s d) for s = +-1.
  const double psi_rad =
      pattern.phase_offset_rad - pattern.phase_sign * kTwoPi * pattern.step / pattern.steps;
  plan.micro.push_back({frame, pattern.fringes, psi_rad, group});
}

// Takes the common part of the shifts out as the offset of the set, so that even steps show.
Status FinishSet(PhaseSet& set) {
  std::sort(set.samples.begin(), set.samples.end(), [](const PhaseSample& a, const PhaseSample& b) {
    return std::tie(a.group, a.step, a.carrier_step) < std::tie(b.group, b.step, b.carrier_step);
  });
  const PhaseSample first = set.samples.front();
  const double base_rad = first.delta_rad - kTwoPi * first.step / set.steps;
  set.offset_rad = -set.sign * base_rad;
  set.even = set.even && first.group == set.samples.back().group;
  for (PhaseSample& sample : set.samples) {
    sample.delta_rad -= base_rad;
    const double even_rad = kTwoPi * sample.step / set.steps;
    set.even = set.even && std::abs(sample.delta_rad - even_rad) < 1e-9;
  }
  if (set.carrier_steps > 0 && !set.even) {
    return Fail("pattern: the modulated set of {:g} fringes needs even steps at one exposure",
                set.fringes);
  }
  return {};
}

Unwrapping UnwrappingOf(const AxisPlan& plan) {
  if (plan.gray || plan.sets.empty() || plan.sets.front().fringes <= 1.0) {
    return Unwrapping::kNested;
  }
  return plan.sets.size() == 1 ? Unwrapping::kRelative : Unwrapping::kJoint;
}

Status FinishAxis(AxisPlan& plan) {
  for (PhaseSet& set : plan.sets) {
    if (Status status = FinishSet(set); !status) return status;
  }
  std::stable_sort(plan.sets.begin(), plan.sets.end(), [](const PhaseSet& a, const PhaseSet& b) {
    return std::tie(a.fringes, a.carrier_steps) < std::tie(b.fringes, b.carrier_steps);
  });
  std::sort(plan.micro.begin(), plan.micro.end(), [](const MicroSample& a, const MicroSample& b) {
    return std::tie(a.group, a.fringes, a.psi_rad) < std::tie(b.group, b.fringes, b.psi_rad);
  });
  if (plan.gray) {
    for (GrayBit& bit : plan.gray->bits) {
      std::sort(bit.reads.begin(), bit.reads.end(),
                [](const GrayRead& a, const GrayRead& b) { return a.group < b.group; });
    }
  }
  plan.unwrapping = UnwrappingOf(plan);
  return {};
}

std::vector<ExposureGroup> GroupByExposure(const std::vector<double>& exposures) {
  std::vector<double> sorted = exposures;
  std::sort(sorted.begin(), sorted.end());
  std::vector<ExposureGroup> groups;
  for (const double ratio : sorted) {
    if (groups.empty() || ratio > groups.back().ratio * (1.0 + kSameExposureRatio)) {
      groups.push_back({ratio, {}, {}, {}});
    }
  }
  return groups;
}

int GroupOf(const std::vector<ExposureGroup>& groups, double ratio) {
  int group = 0;
  while (group + 1 < static_cast<int>(groups.size()) &&
         ratio >= groups[static_cast<std::size_t>(group) + 1].ratio) {
    ++group;
  }
  return group;
}

Status AddFrame(const Pattern& pattern, int frame, int group, DecodePlan& plan) {
  AxisPlan& axis = pattern.axis == Axis::kU ? plan.u : plan.v;
  ExposureGroup& exposure = plan.groups[static_cast<std::size_t>(group)];
  exposure.frames.push_back(frame);
  switch (pattern.kind) {
    case PatternKind::kWhite:
      exposure.white_frames.push_back(frame);
      return {};
    case PatternKind::kBlack:
      exposure.black_frames.push_back(frame);
      return {};
    case PatternKind::kGray:
      return AddGrayFrame(pattern, frame, group, axis);
    case PatternKind::kPhase:
      return AddPhaseFrame(pattern, frame, group, axis);
    case PatternKind::kMicro:
      AddMicroFrame(pattern, frame, group, axis);
      return {};
  }
  return {};
}

}  // namespace

Result<DecodePlan> MakeDecodePlan(const PatternSequence& sequence,
                                  const std::vector<double>& exposures) {
  if (Status status = Validate(sequence, "pattern"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  std::vector<double> ratios = exposures;
  if (ratios.empty()) {
    for (const Pattern& pattern : sequence.frames) ratios.push_back(pattern.exposure_ratio);
  }
  DecodePlan plan;
  plan.num_frames = static_cast<int>(sequence.frames.size());
  plan.u.size_px = sequence.width;
  plan.v.size_px = sequence.height;
  plan.groups = GroupByExposure(ratios);
  for (int i = 0; i < plan.num_frames; ++i) {
    const auto index = static_cast<std::size_t>(i);
    const int group = GroupOf(plan.groups, ratios[index]);
    if (Status status = AddFrame(sequence.frames[index], i, group, plan); !status) {
      return tl::unexpected<Error>(status.error());
    }
  }
  const auto distance = [](const ExposureGroup& group) { return std::abs(std::log(group.ratio)); };
  const auto nearest = std::min_element(
      plan.groups.begin(), plan.groups.end(),
      [&](const ExposureGroup& a, const ExposureGroup& b) { return distance(a) < distance(b); });
  plan.reference_group = static_cast<int>(nearest - plan.groups.begin());
  const double reference_ratio = nearest->ratio;
  for (ExposureGroup& group : plan.groups) group.ratio /= reference_ratio;
  if (!plan.u.IsCoded() && !plan.v.IsCoded()) {
    return Fail("pattern: none of the {} frames codes a projector axis", plan.num_frames);
  }
  for (AxisPlan* axis : {&plan.u, &plan.v}) {
    if (Status status = FinishAxis(*axis); !status) return tl::unexpected<Error>(status.error());
  }
  return plan;
}

std::vector<double> TakenExposures(const ImageStack& stack) {
  std::vector<double> taken;
  std::size_t reference = 0;
  const auto distance = [&](std::size_t i) {
    return std::abs(std::log(stack.sequence.frames[i].exposure_ratio));
  };
  for (std::size_t i = 0; i < stack.frames.size(); ++i) {
    const CapturedFrame& frame = stack.frames[i];
    if (!(frame.exposure_s > 0.0) || !(frame.gain > 0.0)) return {};
    taken.push_back(frame.exposure_s * frame.gain);
    if (distance(i) < distance(reference)) reference = i;
  }
  const double unit = taken[reference];
  for (double& value : taken) value /= unit;
  return taken;
}

}  // namespace fringe_fusion::decode
