#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/file.hpp"
#include "yaml_fields.hpp"

namespace fringe_fusion {

Status WriteCameraInfo(const CameraModel& model, const std::string& name, const std::string& path) {
  if (Status status = Validate(model, path); !status) return status;
  const auto matrix = [](const char* key, int rows, int columns, const std::string& data) {
    return fmt::format("{}:\n  rows: {}\n  cols: {}\n  data: [{}]\n", key, rows, columns, data);
  };
  std::string text = fmt::format("image_width: {}\nimage_height: {}\ncamera_name: {}\n",
                                 model.width, model.height, internal::QuotedYaml(name));
  text +=
      matrix("camera_matrix", 3, 3,
             fmt::format("{}, 0, {}, 0, {}, {}, 0, 0, 1", model.fx, model.cx, model.fy, model.cy));
  text += "distortion_model: plumb_bob\n";
  text +=
      matrix("distortion_coefficients", 1, 5, fmt::format("{}", fmt::join(model.distortion, ", ")));
  text += matrix("rectification_matrix", 3, 3, "1, 0, 0, 0, 1, 0, 0, 0, 1");
  text += matrix("projection_matrix", 3, 4,
                 fmt::format("{}, 0, {}, 0, 0, {}, {}, 0, 0, 0, 1, 0", model.fx, model.cx, model.fy,
                             model.cy));
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << text;
    return {};
  });
}

}  // namespace fringe_fusion
