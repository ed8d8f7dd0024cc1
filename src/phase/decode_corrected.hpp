#pragma once

#include "frame_rows.hpp"
#include "fringe_fusion/phase/phase_correction.hpp"

namespace fringe_fusion::decode {

/// CheckCorrectable of a sequence that has been sorted.
[[nodiscard]] Status CheckCorrectable(const DecodePlan& plan);

/// Whether every phase set has its table.
/// @return error naming the set that has none, or whose table is for another number of steps.
[[nodiscard]] Status CheckTables(const DecodePlan& plan, const PhaseCorrection& correction);

/// The table of a phase set; null where phases are as measured.
[[nodiscard]] const PhaseLut* LutOf(const DecodeContext& context, Axis axis, const PhaseSet& set);

}  // namespace fringe_fusion::decode
