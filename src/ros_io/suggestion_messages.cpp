#include "fringe_fusion/ros_io/suggestion_messages.hpp"

#include <fmt/format.h>

namespace fringe_fusion::ros_io {

SuggestSettings::Response ToMessage(const CaptureProposal& proposal) {
  const CaptureSettings& settings = proposal.settings;
  SuggestSettings::Response response;
  response.success = 1;
  response.exposures = settings.exposures_s;
  response.fringes = settings.fringes;
  response.steps = static_cast<std::uint32_t>(settings.steps);
  response.axis_u = static_cast<std::uint8_t>(settings.axis_u);
  response.axis_v = static_cast<std::uint8_t>(settings.axis_v);
  response.num_frames = static_cast<std::uint32_t>(proposal.num_frames);
  response.duration = proposal.seconds;
  response.sigma_depth = proposal.prediction.sigma_depth_m;
  response.notes = proposal.notes;
  response.message = fmt::format(
      "exposures {:g} s, fringes {:g}, {} steps: {} frames, {:.3g} s, depth sigma {:.4f} mm",
      fmt::join(settings.exposures_s, " + "), fmt::join(settings.fringes, ","), settings.steps,
      proposal.num_frames, proposal.seconds, 1e3 * proposal.prediction.sigma_depth_m);
  return response;
}

}  // namespace fringe_fusion::ros_io
