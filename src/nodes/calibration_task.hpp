#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/calibration/target.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

/// A target that was captured.
struct SightedTarget {
  TargetSighting sighting;    ///< with the name of the pose
  std::int64_t stamp_ns = 0;  ///< of the first frame
};

/// One kind of calibration that calibration_node does step by step. Calls never overlap.
class CalibrationTask {
 public:
  CalibrationTask() = default;
  CalibrationTask(const CalibrationTask&) = delete;
  CalibrationTask& operator=(const CalibrationTask&) = delete;
  virtual ~CalibrationTask() = default;

  /// Names of the poses that are kept.
  [[nodiscard]] virtual std::vector<std::string> Names() const = 0;
  /// @return what the poses give so far, in words.
  [[nodiscard]] virtual Result<std::string> Add(const SightedTarget& seen) = 0;
  /// @param name "": the pose that came last.
  [[nodiscard]] virtual Result<std::string> Remove(const std::string& name) = 0;
  virtual void Reset() = 0;
  /// @param report_folder "": no report. @return the verdict.
  [[nodiscard]] virtual Result<std::string> Solve(const std::string& report_folder) = 0;
  /// Puts the solution in force. @param force also one that the verdict rejects.
  [[nodiscard]] virtual Result<std::string> Accept(bool force) = 0;
};

}  // namespace fringe_fusion::nodes
