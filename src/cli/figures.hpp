#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/inspection/compare.hpp"
#include "fringe_fusion/inspection/report.hpp"
#include "fringe_fusion/phase/phase_map.hpp"
#include "fringe_fusion/registration/register_views.hpp"
#include "fringe_fusion/surface/fill_holes.hpp"
#include "fringe_fusion/surface/mesh.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"
#include "json.hpp"

namespace fringe_fusion::cli {

/// Median of the finite values, NaN if there are none.
[[nodiscard]] double Median(const Image<float>& values);

/// How many pixels of a mask have each MaskReason.
using ReasonCount = std::array<std::size_t, kNumMaskReasons>;
[[nodiscard]] ReasonCount CountReasons(const Image<std::uint8_t>& mask);
/// The reasons that occur in words, e.g. "10 valid, 90 too dark".
[[nodiscard]] std::string ReasonCounts(const Image<std::uint8_t>& mask);

// The figures of one stage's result as --json states them.
[[nodiscard]] Json PhaseFigures(int view_id, const PhaseMap& phase);
[[nodiscard]] Json RangeFigures(int view_id, const TriangulationResult& result);
[[nodiscard]] Json RegistrationFigures(const RegistrationResult& result);
[[nodiscard]] Json MeshFigures(const Mesh& mesh);
[[nodiscard]] Json FillStageFigures(const FillFigures& figures);
[[nodiscard]] Json InspectionFigures(const InspectionResult& result);

// The same for people.
/// @param masks of the views, in their order. Columns are the reasons that occur in any of them.
[[nodiscard]] Report::Table MaskTable(const std::vector<std::string>& views,
                                      const std::vector<ReasonCount>& masks);
[[nodiscard]] Report::Table RegistrationTable(const RegistrationResult& result);
[[nodiscard]] Report::Table MeshTable(const Mesh& mesh);
[[nodiscard]] Report::Table InspectionTable(const InspectionResult& result);

}  // namespace fringe_fusion::cli
