#pragma once

#include <fringe_fusion/SimProject.h>

#include <string>

#include "fringe_fusion/capture/devices.hpp"
#include "nodes/service_caller.hpp"

namespace fringe_fusion::nodes {

struct SimProjectorConfig {
  std::string service = "cell_sim_node/project";  ///< of cell_sim_node

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("service", service);
  }
};

/// The projector of the simulated cell.
class SimProjector : public Projector {
 public:
  /// @param width and height of the projector [px]. @param timeout_s of one picture.
  SimProjector(const ros::NodeHandle& nh, const SimProjectorConfig& config, int width, int height,
               double timeout_s);
  [[nodiscard]] std::string Id() const override;
  [[nodiscard]] int Width() const override { return width_; }
  [[nodiscard]] int Height() const override { return height_; }
  [[nodiscard]] Status Show(const Image<std::uint8_t>& picture) override;

 private:
  ServiceCaller<SimProject> project_;
  int width_;
  int height_;
  double timeout_s_;
};

}  // namespace fringe_fusion::nodes
