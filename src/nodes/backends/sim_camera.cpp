#include "nodes/backends/sim_camera.hpp"

#include "fringe_fusion/ros_io/frame_messages.hpp"

namespace fringe_fusion::nodes {

SimCamera::SimCamera(const ros::NodeHandle& nh, const SimCameraConfig& config)
    : expose_(nh, config.service) {}

std::string SimCamera::Id() const { return "simulated camera sim-camera"; }

Status SimCamera::Configure(double exposure_s, double gain) {
  if (!(exposure_s > 0.0)) return Fail("{}: exposure {} s must be positive", Id(), exposure_s);
  if (!(gain >= 0.0)) return Fail("{}: gain {} must not be negative", Id(), gain);
  exposure_s_ = exposure_s;
  gain_ = gain;
  return {};
}

Result<CapturedFrame> SimCamera::Capture(double timeout_s) {
  SimExpose::Request request;
  request.exposure = exposure_s_;
  const Result<SimExpose::Response> response = expose_.Call(request, timeout_s);
  if (!response) return Fail("{}: {}", Id(), response.error().message);
  const int bit_depth = static_cast<int>(response->bit_depth);
  return ros_io::FromMessage(response->image, {bit_depth, exposure_s_, gain_});
}

}  // namespace fringe_fusion::nodes
