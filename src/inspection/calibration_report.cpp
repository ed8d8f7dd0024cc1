#include "fringe_fusion/inspection/calibration_report.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "fringe_fusion/io/image_io.hpp"

namespace fringe_fusion {
namespace {

/// Three slices: the nearest, the middle and the farthest of the calibrated volume.
const Eigen::Vector3i kFieldPoints(24, 24, 3);

/// Of both lenses: four in pixels, then the distortion, which has none; then the pose.
std::string UnitOf(int parameter) {
  constexpr int kNumModel = 9;
  if (parameter < 2 * kNumModel) return parameter % kNumModel < 4 ? "px" : "";
  return parameter < 2 * kNumModel + 3 ? "rad" : "m";
}

Report::Table ParameterTable(const CellCalibrationResult& result) {
  Report::Table table{"Parameters", {"parameter", "value", "standard deviation", "unit"}, {}};
  const std::array<double, kNumCellParameters> values = CellParameterValues(result.calibration);
  for (int k = 0; k < kNumCellParameters; ++k) {
    const double value = values[static_cast<std::size_t>(k)];
    const double sigma = std::sqrt(result.covariance(k, k));
    std::vector<std::string> row{CellParameterName(k), fmt::format("{:.8g}", value),
                                 "not estimated", UnitOf(k)};
    if (sigma > 0.0) {
      // To the second digit of the standard deviation.
      const int decimals = std::max(0, 1 - static_cast<int>(std::floor(std::log10(sigma))));
      row[1] = fmt::format("{:.{}f}", value, decimals);
      row[2] = fmt::format("{:.{}f}", sigma, decimals);
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

Report::Table DeviceTable(const CellCalibrationResult& result) {
  const auto row = [](const std::string& device, double rms_px, double scale, double covered,
                      DistortionLevel level) {
    return std::vector<std::string>{
        device, fmt::format("{:.4f}", rms_px), fmt::format("{:.2f}", scale),
        fmt::format("{:.0f} %", 100.0 * covered), DistortionName(level)};
  };
  return {
      "Devices",
      {"device", "rms [px]", "residuals / stated noise", "image cells with points", "distortion"},
      {row("camera", result.rms_camera_px, result.sigma_scale_camera, result.coverage.camera_ratio,
           result.distortion_camera),
       row("projector", result.rms_projector_px, result.sigma_scale_projector,
           result.coverage.projector_ratio, result.distortion_projector)}};
}

Report::Table PoseTable(const CellCalibrationResult& result,
                        const std::vector<std::string>& skipped) {
  Report::Table table{"Poses of the target",
                      {"pose", "camera points", "rms [px]", "projector points", "rms [px]",
                       "rms when held out [sigma]", "left out because"},
                      {}};
  for (const PoseOutcome& pose : result.poses) {
    const auto figure = [&pose](const std::string& text) { return pose.used ? text : ""; };
    table.rows.push_back({pose.name, figure(fmt::format("{}", pose.num_points_camera)),
                          figure(fmt::format("{:.4f}", pose.rms_camera_px)),
                          figure(fmt::format("{}", pose.num_points_projector)),
                          figure(fmt::format("{:.4f}", pose.rms_projector_px)),
                          fmt::format("{:.2f}", pose.held_out_ratio), pose.reason});
  }
  for (const std::string& reason : skipped) {
    table.rows.push_back({"not found", "", "", "", "", "", reason});
  }
  return table;
}

Report::Table RejectedTable(const CellCalibrationResult& result) {
  Report::Table table{"Detections left out",
                      {"pose", "point", "device", "distance [px]", "in standard deviations"},
                      {}};
  for (const RejectedPoint& point : result.rejected) {
    table.rows.push_back(
        {result.poses[static_cast<std::size_t>(point.sighting)].name,
         fmt::format("{}", point.point), point.in_projector ? "projector" : "camera",
         fmt::format("{:.3f}", point.distance_px), fmt::format("{:.1f}", point.sigma)});
  }
  return table;
}

Report::Table TrialTable(const CellCalibrationResult& result) {
  Report::Table table{
      "Distortion models tried",
      {"camera", "projector", "rms of the fit [px]", "rms of poses held out [px]", ""},
      {}};
  for (const ModelTrial& trial : result.trials) {
    const bool chosen =
        trial.camera == result.distortion_camera && trial.projector == result.distortion_projector;
    table.rows.push_back({DistortionName(trial.camera), DistortionName(trial.projector),
                          fmt::format("{:.4f}", trial.rms_px),
                          fmt::format("{:.4f}", trial.held_out_rms_px), chosen ? "chosen" : ""});
  }
  return table;
}

/// rms and largest predicted standard deviation of a slice, per axis [mm].
std::vector<std::string> ErrorRow(const ErrorField& field, int slice) {
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  Eigen::Vector3d largest = Eigen::Vector3d::Zero();
  int count = 0;
  for (int y = 0; y < field.num.y(); ++y) {
    for (int x = 0; x < field.num.x(); ++x) {
      const auto& error = field.At(x, y, slice);
      if (!error) continue;
      const Eigen::Vector3d variance = error->calibration.diagonal();
      squares += variance;
      largest = largest.cwiseMax(variance);
      ++count;
    }
  }
  std::vector<std::string> row{fmt::format("{:.3f}", field.Point(0, 0, slice).z())};
  for (int axis = 0; axis < 3; ++axis) {
    row.push_back(count > 0 ? fmt::format("{:.4f} (at most {:.4f})",
                                          1e3 * std::sqrt(squares[axis] / count),
                                          1e3 * std::sqrt(largest[axis]))
                            : "not seen");
  }
  return row;
}

Report::Table ErrorTable(const ErrorField& field) {
  Report::Table table{"Predicted error of a point from the calibration alone, rms over a slice",
                      {"z [m]", "X [mm]", "Y [mm]", "Z [mm]"},
                      {}};
  for (int slice = 0; slice < field.num.z(); ++slice) table.rows.push_back(ErrorRow(field, slice));
  return table;
}

}  // namespace

Report MakeCalibrationReport(const CellCalibrationResult& result,
                             const std::vector<std::string>& skipped, const ErrorField& field) {
  Report report;
  report.title = "Calibration of camera and projector";
  report.paragraphs.push_back(result.verdict.words);
  // The advice of the verdict may have them.
  const auto is_said = [&](const std::string& words) {
    return result.verdict.words.find(words) != std::string::npos;
  };
  if (!is_said(result.coverage.gaps)) report.paragraphs.push_back(result.coverage.gaps + ".");
  if (!is_said(result.next.words)) {
    report.paragraphs.push_back(fmt::format("Next useful pose: {}.", result.next.words));
  }
  report.paragraphs.push_back(fmt::format(
      "Calibration {}; poses differ by up to {:.1f} deg, the points cover {:.1f} % of their "
      "distance in depth; condition of the normal equations {:.2g}.",
      CalibrationId(result.calibration), result.coverage.max_tilt_deg,
      100.0 * result.coverage.depth_ratio, result.condition));
  report.tables = {DeviceTable(result), ErrorTable(field), PoseTable(result, skipped)};
  report.details = {ParameterTable(result)};
  if (!result.rejected.empty()) report.details.push_back(RejectedTable(result));
  if (!result.trials.empty()) report.details.push_back(TrialTable(result));
  return report;
}

Status WriteCalibrationReport(const CellCalibrationResult& result,
                              const std::vector<std::string>& skipped, const std::string& folder) {
  const ErrorField field = PredictErrorField(result.calibration, result.covariance,
                                             CalibratedVolume(result), kFieldPoints, {});
  Report report = MakeCalibrationReport(result, skipped, field);
  const auto add = [&](const Image<Rgb8>& picture, const std::string& file,
                       const std::string& caption) {
    report.pictures.push_back({caption, file});
    return WriteImage(picture, folder + "/" + file);
  };
  for (const bool in_projector : {false, true}) {
    const std::string device = in_projector ? "projector" : "camera";
    Status status =
        add(DrawResidualScatter(result, in_projector), "residuals_" + device + ".png",
            "Residuals in the " + device + ", measured minus predicted, a colour a pose");
    if (status) {
      status = add(DrawResidualField(result, in_projector), "coverage_" + device + ".png",
                   "Points over the image of the " + device + "; shaded cells hold none");
    }
    if (!status) return status;
  }
  if (Status status = add(DrawErrorSlices(field), "error_field.png",
                          "Predicted standard deviation of a point from the calibration, camera "
                          "frame, over the calibrated volume");
      !status) {
    return status;
  }
  return WriteReport(report, folder + "/report.html");
}

}  // namespace fringe_fusion
