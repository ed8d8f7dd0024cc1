#include "nodes/backends/sim_projector.hpp"

#include "fringe_fusion/ros_io/frame_messages.hpp"

namespace fringe_fusion::nodes {

SimProjector::SimProjector(const ros::NodeHandle& nh, const SimProjectorConfig& config, int width,
                           int height, double timeout_s)
    : project_(nh, config.service), width_(width), height_(height), timeout_s_(timeout_s) {}

std::string SimProjector::Id() const { return "simulated projector sim-projector"; }

Status SimProjector::Show(const Image<std::uint8_t>& picture) {
  CapturedFrame frame;
  frame.pixels = picture;
  SimProject::Request request;
  request.picture = ros_io::ToMessage(frame, "");
  const Result<SimProject::Response> response = project_.Call(request, timeout_s_);
  if (!response) return Fail("{}: {}", Id(), response.error().message);
  return {};
}

}  // namespace fringe_fusion::nodes
