#include "nodes/calibration_reload.hpp"

#include <ros/console.h>

#include <utility>

#include "fringe_fusion/io/scan_folder.hpp"

namespace fringe_fusion::nodes {

Result<CellCalibration> RereadCalibration(const std::string& file,
                                          const CellCalibration& in_force) {
  Result<CellCalibration> calibration = ReadCellCalibration(file);
  if (!calibration) return calibration;
  const auto differs = [](const CameraModel& a, const CameraModel& b) {
    return a.width != b.width || a.height != b.height;
  };
  const bool of_projector = !differs(calibration->camera, in_force.camera);
  if (!of_projector || differs(calibration->projector, in_force.projector)) {
    const CameraModel& now = of_projector ? calibration->projector : calibration->camera;
    const CameraModel& before = of_projector ? in_force.projector : in_force.camera;
    return Fail("{}: {} of {} x {} px, but the node runs with {} x {} px: start it anew", file,
                of_projector ? "projector" : "camera", now.width, now.height, before.width,
                before.height);
  }
  if (calibration->camera_serial != in_force.camera_serial ||
      calibration->projector_serial != in_force.projector_serial) {
    return Fail("{}: devices '{}' and '{}', but the node runs with '{}' and '{}': start it anew",
                file, calibration->camera_serial, calibration->projector_serial,
                in_force.camera_serial, in_force.projector_serial);
  }
  return calibration;
}

ros::ServiceServer AdvertiseReload(ros::NodeHandle private_nh, std::function<Status()> reload) {
  using Callback = boost::function<bool(std_srvs::Trigger::Request&, std_srvs::Trigger::Response&)>;
  const Callback callback = [reload = std::move(reload)](std_srvs::Trigger::Request& /*request*/,
                                                         std_srvs::Trigger::Response& response) {
    const Status status = reload();
    response.success = static_cast<std::uint8_t>(status.has_value());
    if (!status) {
      response.message = status.error().message;
      ROS_ERROR("the calibration stays as it was: %s", response.message.c_str());
    }
    return true;
  };
  return private_nh.advertiseService("reload_calibration", callback);
}

}  // namespace fringe_fusion::nodes
