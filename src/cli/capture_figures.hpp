#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/diagnosis/diagnose_stack.hpp"
#include "fringe_fusion/inspection/report.hpp"
#include "json.hpp"

namespace fringe_fusion::cli {

/// What was found in the capture of one view.
struct ViewDiagnosis {
  int view_id = 0;
  Result<Diagnosis> diagnosis;  ///< error: why it could not be examined
};

/// How many findings all views have together.
[[nodiscard]] std::size_t CountFindings(const std::vector<ViewDiagnosis>& views);

/// Findings and checks of one view as --json states them.
[[nodiscard]] Json DiagnosisFigures(const ViewDiagnosis& view);

/// For people: every quantity with its limit, then what to do; several lines, the last one ended.
[[nodiscard]] std::string DiagnosisText(const ViewDiagnosis& view);

/// Section "Capture" of the report: the findings of every view, and the views without any.
[[nodiscard]] Report::Table CaptureTable(const std::vector<ViewDiagnosis>& views);

}  // namespace fringe_fusion::cli
