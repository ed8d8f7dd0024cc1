#include "cell_yaml.hpp"

#include <array>
#include <ctime>

#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "yaml_fields.hpp"

namespace fringe_fusion {
namespace internal {

void ReadModel(YamlFields& fields, CameraModel& model) {
  fields.Required("width", model.width);
  fields.Required("height", model.height);
  fields.Required("fx", model.fx);
  fields.Required("fy", model.fy);
  fields.Required("cx", model.cx);
  fields.Required("cy", model.cy);
  fields.Required("distortion", model.distortion);
}

std::string ModelYaml(const CameraModel& model) {
  return fmt::format(
      "{{width: {}, height: {}, fx: {}, fy: {}, cx: {}, cy: {},\n  distortion: [{}]}}", model.width,
      model.height, model.fx, model.fy, model.cx, model.cy, fmt::join(model.distortion, ", "));
}

}  // namespace internal

namespace {

using internal::QuotedYaml;
using internal::YamlFields;

/// The lower triangle of a covariance, row after row.
constexpr std::size_t kNumTriangle = kNumCellParameters * (kNumCellParameters + 1) / 2;

std::string CovarianceYaml(const CellCovariance& covariance) {
  std::string text =
      "# Of fx fy cx cy k1 k2 p1 p2 k3 of the camera, the same of the projector, rotation [rad] "
      "and\n"
      "# translation [m] of T_projector_camera Exp(xi): lower triangle, row after "
      "row.\ncovariance: [";
  for (int row = 0; row < kNumCellParameters; ++row) {
    text += row > 0 ? ",\n  " : "";
    for (int column = 0; column <= row; ++column) {
      text += fmt::format("{}{}", column > 0 ? ", " : "", covariance(row, column));
    }
  }
  return text + "]\n";
}

std::string CellYaml(const CellCalibration& calibration) {
  std::string text =
      "# p_projector = T_projector_camera * p_camera [m]; distortion: k1 k2 p1 p2 k3\n";
  text += "camera: " + internal::ModelYaml(calibration.camera) + "\n";
  text += "projector: " + internal::ModelYaml(calibration.projector) + "\n";
  text += "T_projector_camera: " + internal::TransformYaml(calibration.T_projector_camera) + "\n";
  if (!calibration.camera_serial.empty()) {
    text += "camera_serial: " + QuotedYaml(calibration.camera_serial) + "\n";
  }
  if (!calibration.projector_serial.empty()) {
    text += "projector_serial: " + QuotedYaml(calibration.projector_serial) + "\n";
  }
  if (!calibration.date.empty()) text += "date: " + QuotedYaml(calibration.date) + "\n";
  if (calibration.rms_px != 0.0) text += fmt::format("rms_px: {}\n", calibration.rms_px);
  return text;
}

Status WriteText(const std::string& text, const std::string& path) {
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << text;
    return {};
  });
}

}  // namespace

Result<CellCalibration> ReadCellCalibration(const std::string& path) {
  const Result<YAML::Node> root = internal::LoadYaml(path);
  if (!root) return Forward(root);
  CellCalibration calibration;
  YamlFields fields(*root, path);
  fields.Nested("camera",
                [&](YamlFields& camera) { internal::ReadModel(camera, calibration.camera); });
  fields.Nested("projector", [&](YamlFields& projector) {
    internal::ReadModel(projector, calibration.projector);
  });
  fields.Nested("T_projector_camera", [&](YamlFields& transform) {
    internal::ReadTransform(transform, calibration.T_projector_camera);
  });
  fields.Optional("camera_serial", calibration.camera_serial);
  fields.Optional("projector_serial", calibration.projector_serial);
  fields.Optional("date", calibration.date);
  fields.Optional("rms_px", calibration.rms_px);
  // ReadCellCovariance hands them out; here they are only checked.
  std::vector<double> covariance(kNumTriangle, 0.0);
  std::string verdict;
  fields.Optional("covariance", covariance);
  fields.Optional("verdict", verdict);
  if (covariance.size() != kNumTriangle) {
    fields.Reject(
        fmt::format("covariance has {} numbers, must have {}", covariance.size(), kNumTriangle));
  }
  if (Status status = fields.Finish(); !status) return tl::unexpected<Error>(status.error());
  if (Status status = Validate(calibration, path); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return calibration;
}

Status WriteCellCalibration(const CellCalibration& calibration, const std::string& path) {
  if (Status status = Validate(calibration, path); !status) return status;
  return WriteText(CellYaml(calibration), path);
}

std::string UtcDate(std::int64_t stamp_ns) {
  if (stamp_ns <= 0) return {};
  const std::time_t seconds = stamp_ns / 1'000'000'000;
  std::tm utc{};
  std::array<char, 32> text{};
  if (gmtime_r(&seconds, &utc) == nullptr) return {};
  (void)std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text.data();
}

Status WriteCalibratedCell(const CellCalibrationResult& result, const std::string& path) {
  if (Status status = Validate(result.calibration, path); !status) return status;
  if (!result.covariance.allFinite()) return Fail("{}: the covariance is not finite", path);
  return WriteText(CellYaml(result.calibration) + "verdict: " + QuotedYaml(result.verdict.words) +
                       "\n" + CovarianceYaml(result.covariance),
                   path);
}

Result<CellCovariance> ReadCellCovariance(const std::string& path) {
  if (const auto cell = ReadCellCalibration(path); !cell) return Forward(cell);
  const Result<YAML::Node> root = internal::LoadYaml(path);
  if (!root) return Forward(root);
  const YAML::Node node = (*root)["covariance"];
  if (!node) return Fail("{}: states no covariance", path);
  const auto numbers = node.as<std::vector<double>>();
  CellCovariance covariance;
  std::size_t i = 0;
  for (int row = 0; row < kNumCellParameters; ++row) {
    for (int column = 0; column <= row; ++column) {
      covariance(row, column) = covariance(column, row) = numbers[i++];
    }
  }
  return covariance;
}

}  // namespace fringe_fusion
