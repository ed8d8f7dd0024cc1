#pragma once

#include <limits>
#include <string>
#include <utility>

#include "fringe_fusion/diagnosis/diagnose_stack.hpp"

namespace fringe_fusion::diagnosis {

/// The checks of a stack, put down one after the other in the order of FindingKind.
class Findings {
 public:
  /// Puts down a measured quantity. @return whether it keeps its limit; NaN does not.
  bool Measure(FindingKind kind, std::string quantity, double value, double limit, std::string unit,
               bool is_minimum = false) {
    const bool kept = is_minimum ? value >= limit : value <= limit;
    result_.checks.push_back({kind, kept ? CheckState::kPassed : CheckState::kFailed,
                              std::move(quantity), value, limit, is_minimum, std::move(unit), ""});
    return kept;
  }

  /// Explains the quantity put down last, which misses its limit.
  void Explain(std::string evidence, std::string advice) {
    const Check& check = result_.checks.back();
    result_.findings.push_back(
        {check.kind, check.value, check.limit, check.unit, std::move(evidence), std::move(advice)});
  }

  void Skip(FindingKind kind, std::string quantity, std::string why) {
    result_.checks.push_back({kind, CheckState::kSkipped, std::move(quantity),
                              std::numeric_limits<double>::quiet_NaN(), 0.0, false, "",
                              std::move(why)});
  }

  [[nodiscard]] bool Any() const { return !result_.findings.empty(); }
  [[nodiscard]] Diagnosis Take() { return std::move(result_); }

 private:
  Diagnosis result_;
};

}  // namespace fringe_fusion::diagnosis
