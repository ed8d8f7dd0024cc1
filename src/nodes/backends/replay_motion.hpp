#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/capture/devices.hpp"

namespace fringe_fusion::nodes {

struct ReplayMotionConfig {
  std::string scan;             ///< scan folder
  double tolerance_rad = 1e-3;  ///< a goal farther from every recorded stop is refused

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("scan", scan);
    field("tolerance_rad", tolerance_rad, 0.0, 10.0);
  }
};

/// The axes of a recording: they jump to where they stood then, and go nowhere else.
class ReplayMotion : public Motion {
 public:
  /// @param joint_positions where the axes stand before the first goal [rad].
  ReplayMotion(ReplayMotionConfig config, std::vector<double> joint_positions);
  [[nodiscard]] std::string Id() const override;
  /// @return error naming the goal when no recorded view was taken there.
  [[nodiscard]] Status MoveTo(const std::vector<double>& joint_positions) override;
  [[nodiscard]] Result<State> Poll() override;
  [[nodiscard]] Status Stop() override { return {}; }

 private:
  ReplayMotionConfig config_;
  std::mutex mutex_;  // Guards what follows.
  std::vector<double> joint_positions_;
  std::optional<std::vector<std::vector<double>>> stops_;  // Read when first asked.
};

}  // namespace fringe_fusion::nodes
