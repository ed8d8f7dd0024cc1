#include "decode_corrected.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "common/constants.hpp"
#include "decode_with.hpp"

namespace fringe_fusion {
namespace {

using decode::AxisPlan;
using decode::DecodePlan;
using decode::PhaseSet;

const char* NameOf(Axis axis) { return axis == Axis::kU ? "u" : "v"; }

// Every step once, at its place, at every exposure. Samples are sorted by exposure, then step.
bool IsEvenAtEveryExposure(const PhaseSet& set) {
  if (set.carrier_steps > 0 || set.samples.size() % static_cast<std::size_t>(set.steps) != 0) {
    return false;
  }
  for (std::size_t i = 0; i < set.samples.size(); ++i) {
    const decode::PhaseSample& sample = set.samples[i];
    const auto step = static_cast<int>(i % static_cast<std::size_t>(set.steps));
    if (sample.step != step ||
        sample.group != set.samples[i - static_cast<std::size_t>(step)].group)
      return false;
    if (!(std::abs(sample.delta_rad - kTwoPi * step / set.steps) < 1e-9)) return false;
  }
  return true;
}

Status CheckAxis(const AxisPlan& plan, Axis axis) {
  if (!plan.IsCoded()) return {};
  const std::string none =
      fmt::format("phase: the code of {} has no step fits to correct: ", NameOf(axis));
  if (!plan.micro.empty()) return Fail("{}it is micro phase shifting", none);
  if (plan.IsGrayAlone()) return Fail("{}it is a Gray code", none);
  for (const PhaseSet& set : plan.sets) {
    if (set.carrier_steps > 0) {
      return Fail("{}its set of {:g} fringes is modulated by a carrier", none, set.fringes);
    }
    if (!IsEvenAtEveryExposure(set)) {
      return Fail("{}the {} steps of its set of {:g} fringes are not even", none, set.steps,
                  set.fringes);
    }
  }
  return {};
}

const PhaseLut* Find(const PhaseCorrection& correction, Axis axis, double fringes) {
  const auto found = std::find_if(
      correction.sets.begin(), correction.sets.end(),
      [&](const PhaseCorrection::Set& set) { return set.axis == axis && set.fringes == fringes; });
  return found == correction.sets.end() ? nullptr : &found->lut;
}

}  // namespace

Status CheckCorrectable(const PatternSequence& sequence) {
  const Result<DecodePlan> plan = decode::MakeDecodePlan(sequence);
  if (!plan) return tl::unexpected<Error>(plan.error());
  return decode::CheckCorrectable(*plan);
}

Status decode::CheckCorrectable(const DecodePlan& plan) {
  Status status = CheckAxis(plan.u, Axis::kU);
  return status ? CheckAxis(plan.v, Axis::kV) : status;
}

Status decode::CheckTables(const DecodePlan& plan, const PhaseCorrection& correction) {
  for (const Axis axis : {Axis::kU, Axis::kV}) {
    for (const PhaseSet& set : (axis == Axis::kU ? plan.u : plan.v).sets) {
      const PhaseLut* lut = Find(correction, axis, set.fringes);
      if (lut == nullptr || lut->steps != set.steps) {
        return Fail("phase: no table of {} steps for the set of {:g} fringes of {}", set.steps,
                    set.fringes, NameOf(axis));
      }
    }
  }
  return {};
}

const PhaseLut* decode::LutOf(const DecodeContext& context, Axis axis, const PhaseSet& set) {
  return context.correction == nullptr ? nullptr : Find(*context.correction, axis, set.fringes);
}

Result<PhaseMap> DecodeCorrectedPhase(const ImageStack& stack, const PhaseConfig& config,
                                      const PhaseCorrection& correction, const Progress& progress,
                                      PhaseMap recycled) {
  return decode::DecodeWith(decode::BestKernels(), stack, config, progress, std::move(recycled),
                            &correction);
}

}  // namespace fringe_fusion
