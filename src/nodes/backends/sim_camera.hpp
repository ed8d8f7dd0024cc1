#pragma once

#include <fringe_fusion/SimExpose.h>

#include <string>

#include "fringe_fusion/capture/devices.hpp"
#include "nodes/service_caller.hpp"

namespace fringe_fusion::nodes {

struct SimCameraConfig {
  std::string service = "cell_sim_node/expose";  ///< of cell_sim_node

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("service", service);
  }
};

/// The camera of the simulated cell.
class SimCamera : public Camera {
 public:
  SimCamera(const ros::NodeHandle& nh, const SimCameraConfig& config);
  [[nodiscard]] std::string Id() const override;
  [[nodiscard]] Status Configure(double exposure_s, double gain) override;
  [[nodiscard]] Result<CapturedFrame> Capture(double timeout_s) override;

 private:
  ServiceCaller<SimExpose> expose_;
  double exposure_s_ = 0.0;
  double gain_ = 1.0;
};

}  // namespace fringe_fusion::nodes
