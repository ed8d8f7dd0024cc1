#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/capture/devices.hpp"

namespace fringe_fusion::nodes {

struct SimMotionConfig {
  double speed_rad_s = 3.0;           ///< of the joint with the longest way
  double acceleration_rad_s2 = 15.0;  ///< of that joint, also when stopping
  double settle_s = 0.1;              ///< at rest for so long: settled

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("speed_rad_s", speed_rad_s, 1e-3, 100.0);
    field("acceleration_rad_s2", acceleration_rad_s2, 1e-3, 10000.0);
    field("settle_s", settle_s, 0.0, 60.0);
  }
};

/// Simulated axes: all joints start and arrive together on a trapezoidal speed profile.
class SimMotion : public Motion {
 public:
  /// Steadily rising time [s].
  using Clock = std::function<double()>;

  /// @param joint_positions where the axes stand at first [rad].
  SimMotion(const SimMotionConfig& config, std::vector<double> joint_positions, Clock clock);

  [[nodiscard]] std::string Id() const override { return "simulated axes"; }
  /// @return error while moving, for another number of joints, or a position that is not finite.
  [[nodiscard]] Status MoveTo(const std::vector<double>& joint_positions) override;
  [[nodiscard]] Result<State> Poll() override;
  /// Brakes at the configured acceleration.
  [[nodiscard]] Status Stop() override;

 private:
  /// Way along the path of the leading joint [rad], its speed, and since when it rests.
  struct Progress {
    double way = 0.0;
    double speed = 0.0;
    std::optional<double> rests_since_s = std::nullopt;  // Nothing while it moves.
  };
  [[nodiscard]] Progress ProgressAt(double now_s) const;
  [[nodiscard]] std::vector<double> PositionsAt(double way) const;

  SimMotionConfig config_;
  Clock clock_;
  std::mutex mutex_;  // Guards what follows.
  std::vector<double> start_;
  std::vector<double> target_;
  double length_ = 0.0;  // of the leading joint's way [rad]
  double start_s_ = 0.0;
  bool stopping_ = false;
  Progress stop_;        // where braking began
  double stop_s_ = 0.0;  // when braking began
};

}  // namespace fringe_fusion::nodes
