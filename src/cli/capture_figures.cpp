#include "capture_figures.hpp"

#include <fmt/format.h>

namespace fringe_fusion::cli {
namespace {

std::string WithUnit(double value, const std::string& unit) {
  return unit.empty() ? fmt::format("{:.4g}", value) : fmt::format("{:.4g} {}", value, unit);
}

std::string Limit(const Check& check) {
  return fmt::format("{} {}", check.is_minimum ? ">=" : "<=", WithUnit(check.limit, check.unit));
}

Json FindingFigures(const Finding& finding) {
  return Json()
      .Set("name", FindingName(finding.kind))
      .Set("value", finding.value)
      .Set("limit", finding.limit)
      .Set("unit", finding.unit)
      .Set("evidence", finding.evidence)
      .Set("advice", finding.advice);
}

Json CheckFigures(const Check& check) {
  Json figures;
  figures.Set("name", FindingName(check.kind))
      .Set("state", CheckStateName(check.state))
      .Set("quantity", check.quantity);
  if (check.state == CheckState::kSkipped) return figures.Set("note", check.note);
  return figures.Set("value", check.value)
      .Set("limit", check.limit)
      .Set("is_minimum", check.is_minimum)
      .Set("unit", check.unit);
}

std::string CheckLine(const Check& check) {
  const bool skipped = check.state == CheckState::kSkipped;
  return fmt::format("  {:18} {:8} {:>12} {:>14}  {}\n", FindingName(check.kind),
                     CheckStateName(check.state), skipped ? "" : WithUnit(check.value, check.unit),
                     skipped ? "" : Limit(check), skipped ? check.note : check.quantity);
}

}  // namespace

std::size_t CountFindings(const std::vector<ViewDiagnosis>& views) {
  std::size_t count = 0;
  for (const ViewDiagnosis& view : views) {
    if (view.diagnosis) count += view.diagnosis->findings.size();
  }
  return count;
}

Json DiagnosisFigures(const ViewDiagnosis& view) {
  Json figures;
  figures.Set("view", view.view_id);
  if (!view.diagnosis) return figures.Set("not_examined", view.diagnosis.error().message);
  std::vector<Json> findings;
  for (const Finding& finding : view.diagnosis->findings) {
    findings.push_back(FindingFigures(finding));
  }
  std::vector<Json> checks;
  for (const Check& check : view.diagnosis->checks) checks.push_back(CheckFigures(check));
  return figures.Set("findings", findings).Set("checks", checks);
}

std::string DiagnosisText(const ViewDiagnosis& view) {
  if (!view.diagnosis) {
    return fmt::format("view {}: not examined: {}\n", view.view_id, view.diagnosis.error().message);
  }
  const Diagnosis& diagnosis = *view.diagnosis;
  std::string text = fmt::format("view {}: {} findings\n", view.view_id, diagnosis.findings.size());
  text += fmt::format("  {:18} {:8} {:>12} {:>14}  {}\n", "check", "state", "value", "limit",
                      "what was measured, or why it was not");
  for (const Check& check : diagnosis.checks) text += CheckLine(check);
  for (const Finding& finding : diagnosis.findings) {
    text += fmt::format("  {}: {}\n    do: {}\n", FindingName(finding.kind), finding.evidence,
                        finding.advice);
  }
  return text;
}

Report::Table CaptureTable(const std::vector<ViewDiagnosis>& views) {
  Report::Table table;
  table.title = "Capture";
  table.header = {"view", "finding", "evidence", "what to do"};
  for (const ViewDiagnosis& view : views) {
    const std::string name = fmt::format("{:03}", view.view_id);
    if (!view.diagnosis) {
      table.rows.push_back({name, "not examined", view.diagnosis.error().message, ""});
      continue;
    }
    for (const Finding& finding : view.diagnosis->findings) {
      table.rows.push_back({name, FindingName(finding.kind), finding.evidence, finding.advice});
    }
    if (view.diagnosis->findings.empty()) table.rows.push_back({name, "none", "", ""});
  }
  return table;
}

}  // namespace fringe_fusion::cli
