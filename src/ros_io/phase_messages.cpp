#include "fringe_fusion/ros_io/phase_messages.hpp"

#include <utility>

#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/picture_messages.hpp"

namespace fringe_fusion::ros_io {
namespace {

/// The four pictures of one phase map, which must have one size or be absent.
Result<PhaseMap> PhaseOf(const DecodedView& message) {
  PhaseMap phase;
  phase.width = static_cast<int>(message.camera.width);
  phase.height = static_cast<int>(message.camera.height);
  struct Part {
    const char* name;
    const sensor_msgs::Image& picture;
    Image<float>& image;
  };
  for (const Part& part : {Part{"u", message.u, phase.u}, Part{"v", message.v, phase.v},
                           Part{"sigma_u", message.sigma_u, phase.sigma_u},
                           Part{"sigma_v", message.sigma_v, phase.sigma_v}}) {
    Result<Image<float>> image = FloatImageFromMessage(part.picture, part.name);
    if (!image) return Forward(image);
    if (!image->empty() && (image->width() != phase.width || image->height() != phase.height)) {
      return Fail("{} is {} x {} px, but the camera {} x {}", part.name, image->width(),
                  image->height(), phase.width, phase.height);
    }
    part.image = std::move(*image);
  }
  if (phase.u.empty() != phase.sigma_u.empty() || phase.v.empty() != phase.sigma_v.empty()) {
    return Fail("an axis has codes without sigmas, or the reverse");
  }
  phase.first_stamp_ns = FromRosTime(message.header.stamp);
  phase.last_stamp_ns = FromRosTime(message.last_stamp);
  return phase;
}

Result<CellCalibration> CalibrationOf(const DecodedView& message) {
  const Result<CameraModel> camera = FromMessage(message.camera, "camera");
  if (!camera) return Forward(camera);
  const Result<CameraModel> projector = FromMessage(message.projector, "projector");
  if (!projector) return Forward(projector);
  const Result<Transform> T_projector_camera = FromMessage(message.projector_camera);
  if (!T_projector_camera) return Forward(T_projector_camera);
  CellCalibration calibration;
  calibration.camera = *camera;
  calibration.projector = *projector;
  calibration.T_projector_camera = *T_projector_camera;
  if (Status status = Validate(calibration, "calibration"); !status) return Forward(status);
  return calibration;
}

}  // namespace

DecodedView ToMessage(const PhaseMap& phase, const DecodedCodes& codes) {
  DecodedView message;
  message.header.stamp = ToRosTime(phase.first_stamp_ns);
  message.header.frame_id = codes.camera_frame;
  message.last_stamp = ToRosTime(phase.last_stamp_ns);
  message.scan_id = codes.scan_id;
  message.view_id = static_cast<std::uint32_t>(codes.view_id);
  message.u = ToMessage(phase.u, message.header);
  message.v = ToMessage(phase.v, message.header);
  message.sigma_u = ToMessage(phase.sigma_u, message.header);
  message.sigma_v = ToMessage(phase.sigma_v, message.header);
  message.camera = ToMessage(codes.calibration.camera);
  message.camera.header = message.header;
  message.projector = ToMessage(codes.calibration.projector);
  message.projector.header.stamp = message.header.stamp;
  message.projector.header.frame_id = codes.projector_frame;
  message.projector_camera = ToTransformMessage(codes.calibration.T_projector_camera);
  return message;
}

Result<DecodedCodes> FromMessage(const DecodedView& message) {
  const auto fail = [&message](const Error& error) {
    return Fail("codes of view {} of scan '{}': {}", message.view_id, message.scan_id,
                error.message);
  };
  DecodedCodes codes;
  codes.scan_id = message.scan_id;
  codes.view_id = static_cast<int>(message.view_id);
  codes.camera_frame = message.header.frame_id;
  codes.projector_frame = message.projector.header.frame_id;
  Result<CellCalibration> calibration = CalibrationOf(message);
  if (!calibration) return fail(calibration.error());
  codes.calibration = std::move(*calibration);
  Result<PhaseMap> phase = PhaseOf(message);
  if (!phase) return fail(phase.error());
  codes.phase = std::move(*phase);
  return codes;
}

}  // namespace fringe_fusion::ros_io
