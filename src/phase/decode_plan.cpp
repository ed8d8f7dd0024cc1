#include "decode_plan.hpp"

#include <algorithm>
#include <cstddef>

namespace fringe_fusion::decode {
namespace {

const char* AxisName(Axis axis) { return axis == Axis::kU ? "u" : "v"; }

Status AddGrayFrame(const Pattern& pattern, int frame, AxisPlan& plan) {
  if (!plan.gray) {
    plan.gray = GrayCode{pattern.cell_px, pattern.offset_px, {}};
  }
  GrayCode& code = *plan.gray;
  if (pattern.cell_px != code.cell_px || pattern.offset_px != code.offset_px) {
    return Fail("pattern: frame {} ({}) has cell_px {} offset_px {}, but its code has {} and {}",
                frame, PatternName(pattern), pattern.cell_px, pattern.offset_px, code.cell_px,
                code.offset_px);
  }
  const auto bit = static_cast<std::size_t>(pattern.bit);
  if (code.bits.size() <= bit) code.bits.resize(bit + 1);
  int& slot = pattern.inverse ? code.bits[bit].inverse_frame : code.bits[bit].frame;
  if (slot >= 0) {
    return Fail("pattern: frames {} and {} are both {}", slot, frame, PatternName(pattern));
  }
  slot = frame;
  return {};
}

Status AddPhaseFrame(const Pattern& pattern, int frame, AxisPlan& plan) {
  const auto same_set = [&](const PhaseSet& set) {
    return set.fringes == pattern.fringes &&
           static_cast<int>(set.frame_of_step.size()) == pattern.steps;
  };
  auto set = std::find_if(plan.sets.begin(), plan.sets.end(), same_set);
  if (set == plan.sets.end()) {
    PhaseSet fresh;
    fresh.fringes = pattern.fringes;
    fresh.sign = pattern.phase_sign;
    fresh.offset_rad = pattern.phase_offset_rad;
    fresh.frame_of_step.assign(static_cast<std::size_t>(pattern.steps), -1);
    set = plan.sets.insert(plan.sets.end(), fresh);
  }
  if (pattern.phase_sign != set->sign || pattern.phase_offset_rad != set->offset_rad) {
    return Fail(
        "pattern: frame {} ({}) has phase_sign {} phase_offset_rad {}, but its set has {} and {}",
        frame, PatternName(pattern), pattern.phase_sign, pattern.phase_offset_rad, set->sign,
        set->offset_rad);
  }
  set->frame_of_step[static_cast<std::size_t>(pattern.step)] = frame;
  return {};
}

Status CheckUnwrapping(const AxisPlan& plan, Axis axis) {
  if (plan.gray || plan.sets.empty() || plan.sets.front().fringes <= 1.0) return {};
  return Fail(
      "pattern: axis {} starts with {:g} fringes; unwrapping needs a set of at most 1 fringe or a "
      "Gray code",
      AxisName(axis), plan.sets.front().fringes);
}

}  // namespace

Result<DecodePlan> MakeDecodePlan(const PatternSequence& sequence) {
  if (Status status = Validate(sequence, "pattern"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  DecodePlan plan;
  plan.num_frames = static_cast<int>(sequence.frames.size());
  plan.u.size_px = sequence.width;
  plan.v.size_px = sequence.height;
  for (int i = 0; i < plan.num_frames; ++i) {
    const Pattern& pattern = sequence.frames[static_cast<std::size_t>(i)];
    AxisPlan& axis = pattern.axis == Axis::kU ? plan.u : plan.v;
    Status status;
    if (pattern.kind == PatternKind::kWhite) plan.white_frames.push_back(i);
    if (pattern.kind == PatternKind::kBlack) plan.black_frames.push_back(i);
    if (pattern.kind == PatternKind::kGray) status = AddGrayFrame(pattern, i, axis);
    if (pattern.kind == PatternKind::kPhase) status = AddPhaseFrame(pattern, i, axis);
    if (!status) return tl::unexpected<Error>(status.error());
  }
  if (!plan.u.IsCoded() && !plan.v.IsCoded()) {
    return Fail("pattern: none of the {} frames codes a projector axis", plan.num_frames);
  }
  for (const Axis axis : {Axis::kU, Axis::kV}) {
    AxisPlan& axis_plan = axis == Axis::kU ? plan.u : plan.v;
    std::stable_sort(axis_plan.sets.begin(), axis_plan.sets.end(),
                     [](const PhaseSet& a, const PhaseSet& b) { return a.fringes < b.fringes; });
    if (Status status = CheckUnwrapping(axis_plan, axis); !status) {
      return tl::unexpected<Error>(status.error());
    }
  }
  return plan;
}

}  // namespace fringe_fusion::decode
