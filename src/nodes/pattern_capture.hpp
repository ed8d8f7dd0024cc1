#pragma once

#include <ros/node_handle.h>

#include <cstdint>
#include <functional>
#include <string>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/result.hpp"
#include "nodes/scanner_config.hpp"

namespace fringe_fusion::nodes {

/// Steps the projector through a sequence and takes one frame of each pattern, by the services of
/// projector_node and camera_node.
class PatternCapture {
 public:
  /// What to capture.
  struct Request {
    std::string scan_id;
    int view_id = 0;
    PatternSequence sequence;
  };
  /// Called after every frame with the stack so far, whose last frame is new.
  using OnFrame = std::function<void(const ImageStack& stack)>;

  /// @param config, calibration kept by the caller, longer than this object.
  PatternCapture(const ros::NodeHandle& nh, const ScannerNodeConfig& config,
                 const CellCalibration& calibration)
      : nh_(nh), config_(config), calibration_(calibration) {}

  /// @return error in the words of the device, or kCancelled.
  [[nodiscard]] Result<ImageStack> CaptureSequence(const Request& request, const OnFrame& on_frame,
                                                   const std::function<bool()>& cancelled);

 private:
  [[nodiscard]] Status LoadSequence(const PatternSequence& sequence);
  [[nodiscard]] Result<CapturedFrame> TakeFrame(const Request& request, std::size_t index,
                                                std::int64_t previous_ns,
                                                const std::function<bool()>& cancelled);
  [[nodiscard]] Result<CapturedFrame> TryFrame(const Request& request, std::size_t index,
                                               std::int64_t previous_ns);
  [[nodiscard]] Status CheckFrame(const CapturedFrame& frame, std::int64_t earliest_ns,
                                  std::int64_t previous_ns) const;

  ros::NodeHandle nh_;
  const ScannerNodeConfig& config_;
  const CellCalibration& calibration_;
};

}  // namespace fringe_fusion::nodes
