#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "yaml_fields.hpp"

namespace fringe_fusion {
namespace {

using internal::QuotedYaml;
using internal::YamlFields;

void ReadModel(YamlFields& fields, CameraModel& model) {
  fields.Required("width", model.width);
  fields.Required("height", model.height);
  fields.Required("fx", model.fx);
  fields.Required("fy", model.fy);
  fields.Required("cx", model.cx);
  fields.Required("cy", model.cy);
  fields.Required("distortion", model.distortion);
}

std::string ModelYaml(const CameraModel& m) {
  return fmt::format(
      "{{width: {}, height: {}, fx: {}, fy: {}, cx: {}, cy: {},\n  distortion: [{}]}}", m.width,
      m.height, m.fx, m.fy, m.cx, m.cy, fmt::join(m.distortion, ", "));
}

}  // namespace

Result<CellCalibration> ReadCellCalibration(const std::string& path) {
  const Result<YAML::Node> root = internal::LoadYaml(path);
  if (!root) return Forward(root);
  CellCalibration calibration;
  YamlFields fields(*root, path);
  fields.Nested("camera", [&](YamlFields& camera) { ReadModel(camera, calibration.camera); });
  fields.Nested("projector",
                [&](YamlFields& projector) { ReadModel(projector, calibration.projector); });
  fields.Nested("T_projector_camera", [&](YamlFields& transform) {
    internal::ReadTransform(transform, calibration.T_projector_camera);
  });
  fields.Optional("camera_serial", calibration.camera_serial);
  fields.Optional("projector_serial", calibration.projector_serial);
  fields.Optional("date", calibration.date);
  fields.Optional("rms_px", calibration.rms_px);
  if (Status status = fields.Finish(); !status) return tl::unexpected<Error>(status.error());
  if (Status status = Validate(calibration, path); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return calibration;
}

Status WriteCellCalibration(const CellCalibration& calibration, const std::string& path) {
  if (Status status = Validate(calibration, path); !status) return status;
  std::string text =
      "# p_projector = T_projector_camera * p_camera [m]; distortion: k1 k2 p1 p2 k3\n";
  text += "camera: " + ModelYaml(calibration.camera) + "\n";
  text += "projector: " + ModelYaml(calibration.projector) + "\n";
  text += "T_projector_camera: " + internal::TransformYaml(calibration.T_projector_camera) + "\n";
  if (!calibration.camera_serial.empty()) {
    text += "camera_serial: " + QuotedYaml(calibration.camera_serial) + "\n";
  }
  if (!calibration.projector_serial.empty()) {
    text += "projector_serial: " + QuotedYaml(calibration.projector_serial) + "\n";
  }
  if (!calibration.date.empty()) text += "date: " + QuotedYaml(calibration.date) + "\n";
  if (calibration.rms_px != 0.0) text += fmt::format("rms_px: {}\n", calibration.rms_px);
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << text;
    return {};
  });
}

}  // namespace fringe_fusion
