#include "nodes/pattern_capture.hpp"

#include <fmt/format.h>
#include <fringe_fusion/Capture.h>
#include <fringe_fusion/LoadSequence.h>
#include <fringe_fusion/ShowPattern.h>
#include <ros/console.h>

#include <utility>

#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/pattern_messages.hpp"
#include "fringe_fusion/ros_io/service_call.hpp"

namespace fringe_fusion::nodes {

Result<ImageStack> PatternCapture::CaptureSequence(const Request& request, const OnFrame& on_frame,
                                                   const std::function<bool()>& cancelled) {
  if (Status status = LoadSequence(request.sequence); !status) {
    return tl::unexpected<Error>(status.error());
  }
  ImageStack stack;
  stack.scan_id = request.scan_id;
  stack.view_id = request.view_id;
  stack.camera_id = calibration_.camera_serial;
  stack.sequence = request.sequence;
  std::int64_t previous_ns = 0;
  for (std::size_t i = 0; i < stack.sequence.frames.size(); ++i) {
    if (cancelled()) return Fail("{}", kCancelled);
    Result<CapturedFrame> frame = TakeFrame(request, i, previous_ns, cancelled);
    if (!frame) return Forward(frame);
    previous_ns = frame->stamp_ns;
    stack.frames.push_back(std::move(*frame));
    on_frame(stack);
  }
  if (Status status = Validate(stack, fmt::format("view {}", request.view_id)); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return stack;
}

Status PatternCapture::LoadSequence(const PatternSequence& sequence) {
  fringe_fusion::LoadSequence::Request request;
  request.sequence = ros_io::ToMessage(sequence);
  const auto loaded = ros_io::CallService<fringe_fusion::LoadSequence>(
      nh_, config_.projector_node + "/load_sequence", request, config_.service_timeout_s);
  if (!loaded) return tl::unexpected<Error>(loaded.error());
  return {};
}

Result<CapturedFrame> PatternCapture::TakeFrame(const Request& request, std::size_t index,
                                                std::int64_t previous_ns,
                                                const std::function<bool()>& cancelled) {
  Result<CapturedFrame> frame = TryFrame(request, index, previous_ns);
  for (int retry = 1; !frame && retry <= config_.max_retries && !cancelled(); ++retry) {
    ROS_WARN_THROTTLE(5.0, "frame %zu, attempt %d of %d: %s", index, retry, config_.max_retries + 1,
                      frame.error().message.c_str());
    frame = TryFrame(request, index, previous_ns);
  }
  if (cancelled()) return Fail("{}", kCancelled);
  if (!frame) {
    return Fail("frame {} of {} failed {} times: {}", index, request.sequence.frames.size(),
                config_.max_retries + 1, frame.error().message);
  }
  return frame;
}

Result<CapturedFrame> PatternCapture::TryFrame(const Request& request, std::size_t index,
                                               std::int64_t previous_ns) {
  ShowPattern::Request show;
  show.index = static_cast<std::uint32_t>(index);
  const auto shown = ros_io::CallService<ShowPattern>(nh_, config_.projector_node + "/show_pattern",
                                                      show, config_.show_timeout_s);
  if (!shown) return Forward(shown);
  const std::int64_t shown_ns = ros_io::FromRosTime(ros::Time::now());
  Capture::Request capture;
  capture.exposure = config_.exposure_s * request.sequence.frames[index].exposure_ratio;
  capture.gain = config_.gain;
  capture.timeout = ros::Duration(config_.capture_timeout_s);
  capture.view_id = static_cast<std::uint32_t>(request.view_id);
  capture.frame_index = static_cast<std::uint32_t>(index);
  const auto captured =
      ros_io::CallService<Capture>(nh_, config_.camera_node + "/capture", capture,
                                   config_.capture_timeout_s + config_.service_timeout_s);
  if (!captured) return Forward(captured);
  ros_io::ExposureInfo exposure;
  exposure.bit_depth = captured->bit_depth <= 16 ? static_cast<int>(captured->bit_depth) : 0;
  exposure.exposure_s = captured->exposure;
  exposure.gain = captured->gain;
  Result<CapturedFrame> frame = ros_io::FromMessage(captured->image, exposure);
  if (!frame) return frame;
  if (Status status = CheckFrame(*frame, shown_ns, previous_ns); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return frame;
}

Status PatternCapture::CheckFrame(const CapturedFrame& frame, std::int64_t earliest_ns,
                                  std::int64_t previous_ns) const {
  const CameraModel& camera = calibration_.camera;
  if (Width(frame) != camera.width || Height(frame) != camera.height) {
    return Fail("the camera's image of {} x {} px must be {} x {} px as calibrated", Width(frame),
                Height(frame), camera.width, camera.height);
  }
  if (frame.stamp_ns <= previous_ns) {
    return Fail("the frame's stamp is not later than that of the frame before: a repeated frame");
  }
  const double early_s = 1e-9 * static_cast<double>(earliest_ns - frame.stamp_ns);
  if (early_s > config_.stamp_tolerance_s) {
    return Fail("the frame was exposed {:.6f} s before its pattern was shown (limit {:.6f} s)",
                early_s, config_.stamp_tolerance_s);
  }
  return {};
}

}  // namespace fringe_fusion::nodes
