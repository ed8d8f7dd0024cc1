#pragma once

#include <memory>
#include <string>

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

// The three interfaces that a cell is made of. Hardware, replay and simulation implement them; a
// new device is one class. All calls block, all failures are words, none aborts.

/// A camera that takes one picture when asked.
class Camera {
 public:
  virtual ~Camera() = default;
  /// Model and serial number for messages and for the calibration check.
  [[nodiscard]] virtual std::string Id() const = 0;
  /// Opens the device if it is not open; every Capture does so as well. Called early, it tells
  /// whether there is one. @return error naming the device.
  [[nodiscard]] virtual Status Connect() { return {}; }
  /// @param exposure_s > 0. @param gain >= 0, device units.
  [[nodiscard]] virtual Status Configure(double exposure_s, double gain) = 0;
  /// What the next picture is for. Only a recording has to know, to give that very frame.
  virtual void Announce(int /*view_id*/, int /*frame_index*/) {}
  /// Exposes once after the call and returns that very frame.
  /// @return error naming the device when no complete frame came within timeout_s.
  [[nodiscard]] virtual Result<CapturedFrame> Capture(double timeout_s) = 0;
};

/// A projector that shows 8-bit pictures of its own pixel size.
class Projector {
 public:
  virtual ~Projector() = default;
  [[nodiscard]] virtual std::string Id() const = 0;
  [[nodiscard]] virtual int Width() const = 0;
  [[nodiscard]] virtual int Height() const = 0;
  /// Returns once the picture is on the screen.
  [[nodiscard]] virtual Status Show(const Image<std::uint8_t>& picture) = 0;
};

/// A turntable or an arm: joints that move to a position and settle.
class Motion {
 public:
  virtual ~Motion() = default;
  [[nodiscard]] virtual std::string Id() const = 0;
  /// Starts moving; Poll tells when it is done.
  [[nodiscard]] virtual Status MoveTo(const std::vector<double>& joint_positions) = 0;
  /// @return positions now [rad or m], velocities, and whether the motion has settled.
  struct State {
    std::vector<double> joint_positions;
    std::vector<double> joint_velocities;  ///< [rad/s or m/s]
    bool settled = false;
  };
  [[nodiscard]] virtual Result<State> Poll() = 0;
  [[nodiscard]] virtual Status Stop() = 0;
};

}  // namespace fringe_fusion
