#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calibration/coverage_grid.hpp"
#include "fringe_fusion/inspection/calibration_report.hpp"

namespace fringe_fusion {
namespace {

const cv::Scalar kInk(40, 40, 40);
const cv::Scalar kFaint(205, 210, 218);
const cv::Scalar kEmptyCell(238, 222, 214);

cv::Mat AsMat(Image<Rgb8>& picture) {
  return {picture.height(), picture.width(), CV_8UC3, picture.data()};
}

cv::Scalar PoseColor(int pose) {
  constexpr std::array<std::array<int, 3>, 10> kColors = {{{31, 119, 180},
                                                           {255, 127, 14},
                                                           {44, 160, 44},
                                                           {214, 39, 40},
                                                           {148, 103, 189},
                                                           {140, 86, 75},
                                                           {227, 119, 194},
                                                           {90, 90, 90},
                                                           {160, 165, 30},
                                                           {23, 170, 190}}};
  const auto& color = kColors[static_cast<std::size_t>(pose) % kColors.size()];
  // The same ones darker from the tenth on.
  constexpr std::array<double, 3> kShades = {1.0, 0.65, 0.4};
  const double shade = kShades[static_cast<std::size_t>(pose) / kColors.size() % kShades.size()];
  return {shade * color[0], shade * color[1], shade * color[2]};
}

void Write(cv::Mat& mat, const std::string& text, int x, int y) {
  cv::putText(mat, text, {x, y}, cv::FONT_HERSHEY_SIMPLEX, 0.42, kInk, 1, cv::LINE_AA);
}

/// Sub-pixel position for OpenCV's drawing with shift.
constexpr int kShift = 4;
cv::Point Fine(double x, double y) {
  return {static_cast<int>(std::lround(x * (1 << kShift))),
          static_cast<int>(std::lround(y * (1 << kShift)))};
}

/// Which colour is which pose; nothing for more poses than anyone tells apart.
class PoseLegend {
 public:
  PoseLegend(const CellCalibrationResult& result, int width) : num_columns_(width / kColumn) {
    if (result.poses.size() > 30U) return;
    for (std::size_t i = 0; i < result.poses.size(); ++i) {
      if (result.poses[i].used) entries_.push_back({static_cast<int>(i), result.poses[i].name});
    }
  }
  [[nodiscard]] int Height() const {
    const int num = static_cast<int>(entries_.size());
    return num == 0 ? 0 : kRow * ((num + num_columns_ - 1) / num_columns_) + 6;
  }
  void Draw(int left, int top, cv::Mat& mat) const {
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const int x = left + kColumn * (static_cast<int>(i) % num_columns_);
      const int y = top + kRow * (static_cast<int>(i) / num_columns_) + kRow / 2;
      cv::circle(mat, {x + 4, y}, 4, PoseColor(entries_[i].pose), cv::FILLED, cv::LINE_AA);
      Write(mat, entries_[i].name.substr(0, 13), x + 14, y + 4);
    }
  }

 private:
  static constexpr int kColumn = 124;
  static constexpr int kRow = 18;
  struct Entry {
    int pose;
    std::string name;
  };
  int num_columns_;
  std::vector<Entry> entries_;
};

double LargestResidual(const CellCalibrationResult& result, bool in_projector) {
  double largest = 1e-6;
  for (const CellResidual& residual : result.residuals) {
    if (residual.in_projector != in_projector) continue;
    largest = std::max(largest, residual.residual_px.cwiseAbs().maxCoeff());
  }
  return largest;
}

/// 1, 2 or 5 times a power of ten, not above `value`.
double RoundDown(double value) {
  const double decade = std::pow(10.0, std::floor(std::log10(value)));
  for (const double step : {5.0, 2.0}) {
    if (step * decade <= value) return step * decade;
  }
  return decade;
}

/// Cells of the grid that hold no point, filled, and the lines of the grid.
void DrawGrid(const CellCalibrationResult& result, bool in_projector, const CameraModel& model,
              double scale, cv::Mat& mat) {
  CoverageGrid grid(model.width, model.height);
  for (const CellResidual& residual : result.residuals) {
    if (residual.in_projector == in_projector) grid.Add(residual.pixel);
  }
  for (int row = 0; row < CoverageGrid::kRows; ++row) {
    for (int column = 0; column < CoverageGrid::kColumns; ++column) {
      const auto edge = [scale](int cell, int size, int count) {
        return static_cast<int>(std::lround(scale * size * cell / count));
      };
      const cv::Point low(edge(column, model.width, CoverageGrid::kColumns),
                          edge(row, model.height, CoverageGrid::kRows));
      const cv::Point high(edge(column + 1, model.width, CoverageGrid::kColumns) - 1,
                           edge(row + 1, model.height, CoverageGrid::kRows) - 1);
      if (!grid.Holds(column, row)) {
        cv::rectangle(mat, low, high, kEmptyCell, cv::FILLED);
      }
      cv::rectangle(mat, low, high, kFaint, 1);
    }
  }
}

/// Colours of [0, 1], dark blue to dark red.
class TurboScale {
 public:
  TurboScale() {
    cv::Mat ramp(1, 256, CV_8UC1);
    for (int i = 0; i < 256; ++i) ramp.at<std::uint8_t>(0, i) = static_cast<std::uint8_t>(i);
    cv::applyColorMap(ramp, table_, cv::COLORMAP_TURBO);
  }
  [[nodiscard]] cv::Scalar Color(double ratio) const {
    const auto bgr = table_.at<cv::Vec3b>(
        0, static_cast<int>(std::lround(255.0 * std::min(1.0, std::max(0.0, ratio)))));
    return {static_cast<double>(bgr[2]), static_cast<double>(bgr[1]), static_cast<double>(bgr[0])};
  }

 private:
  cv::Mat table_;
};

double SigmaOf(const PointError& error, int axis) {
  return std::sqrt(error.calibration(axis, axis));
}

double LargestSigma(const ErrorField& field) {
  double largest = 0.0;
  for (const auto& error : field.errors) {
    if (!error) continue;
    for (int axis = 0; axis < 3; ++axis) largest = std::max(largest, SigmaOf(*error, axis));
  }
  return largest > 0.0 ? largest : 1e-9;
}

/// Where the panels of the slices lie.
struct SliceLayout {
  int panel_width = 220;
  int panel_height = 220;
  int gap = 12;
  int left = 84;
  int top = 28;

  [[nodiscard]] cv::Point Corner(int axis, int slice) const {
    return {left + axis * (panel_width + gap), top + slice * (panel_height + gap)};
  }
};

void DrawSlice(const ErrorField& field, int slice, int axis, const SliceLayout& layout,
               cv::Mat& mat) {
  const TurboScale scale;
  const double largest_m = LargestSigma(field);
  const cv::Point corner = layout.Corner(axis, slice);
  for (int y = 0; y < field.num.y(); ++y) {
    for (int x = 0; x < field.num.x(); ++x) {
      const cv::Point low(corner.x + layout.panel_width * x / field.num.x(),
                          corner.y + layout.panel_height * y / field.num.y());
      const cv::Point high(corner.x + layout.panel_width * (x + 1) / field.num.x() - 1,
                           corner.y + layout.panel_height * (y + 1) / field.num.y() - 1);
      const auto& error = field.At(x, y, slice);
      const cv::Scalar color =
          error ? scale.Color(SigmaOf(*error, axis) / largest_m) : cv::Scalar(150, 150, 150);
      cv::rectangle(mat, low, high, color, cv::FILLED);
    }
  }
}

void DrawSigmaBar(double largest_m, const cv::Point& corner, int length, cv::Mat& mat) {
  const TurboScale scale;
  for (int i = 0; i < length; ++i) {
    const cv::Scalar color = scale.Color(1.0 - (i + 0.5) / length);
    cv::line(mat, {corner.x, corner.y + i}, {corner.x + 20, corner.y + i}, color);
  }
  constexpr int kNumLabels = 5;
  for (int label = 0; label < kNumLabels; ++label) {
    const double ratio = 1.0 - static_cast<double>(label) / (kNumLabels - 1);
    const std::string text = largest_m < 1e-3 ? fmt::format("{:.3g} um", 1e6 * largest_m * ratio)
                                              : fmt::format("{:.3g} mm", 1e3 * largest_m * ratio);
    Write(mat, text, corner.x + 26, corner.y + length * label / (kNumLabels - 1) + 4);
  }
}

}  // namespace

Image<Rgb8> DrawResidualScatter(const CellCalibrationResult& result, bool in_projector) {
  constexpr int kSize = 520;
  constexpr int kMargin = 20;
  const PoseLegend legend(result, kSize - kMargin);
  Image<Rgb8> picture(kSize, kSize + 24 + legend.Height(), Rgb8{255, 255, 255});
  cv::Mat mat = AsMat(picture);
  const double limit_px = 1.05 * LargestResidual(result, in_projector);
  const double scale = (0.5 * kSize - kMargin) / limit_px;
  const double middle = 0.5 * kSize;
  cv::line(mat, {kMargin, kSize / 2}, {kSize - kMargin, kSize / 2}, kFaint);
  cv::line(mat, {kSize / 2, kMargin}, {kSize / 2, kSize - kMargin}, kFaint);
  const double tick_px = RoundDown(limit_px / 2.0);
  for (int k = -4; k <= 4; ++k) {
    const auto at = static_cast<int>(std::lround(middle + k * tick_px * scale));
    if (at < kMargin || at > kSize - kMargin) continue;
    cv::line(mat, {at, kSize / 2 - 3}, {at, kSize / 2 + 3}, kInk);
    cv::line(mat, {kSize / 2 - 3, at}, {kSize / 2 + 3, at}, kInk);
  }
  for (const CellResidual& residual : result.residuals) {
    if (residual.in_projector != in_projector) continue;
    cv::circle(
        mat,
        Fine(middle + scale * residual.residual_px.x(), middle + scale * residual.residual_px.y()),
        5 << (kShift - 1), PoseColor(residual.sighting), cv::FILLED, cv::LINE_AA, kShift);
  }
  const double rms_px = in_projector ? result.rms_projector_px : result.rms_camera_px;
  cv::circle(mat, Fine(middle, middle), static_cast<int>(std::lround(rms_px * scale)) << kShift,
             kInk, 1, cv::LINE_AA, kShift);
  Write(mat, fmt::format("circle: rms {:.4f} px, ticks every {:g} px", rms_px, tick_px), kMargin,
        kSize + 12);
  legend.Draw(kMargin, kSize + 24, mat);
  return picture;
}

Image<Rgb8> DrawResidualField(const CellCalibrationResult& result, bool in_projector) {
  constexpr int kWidth = 720;
  const CameraModel& model =
      in_projector ? result.calibration.projector : result.calibration.camera;
  const double scale = static_cast<double>(kWidth) / std::max(1, model.width);
  const int height = std::max(1, static_cast<int>(std::lround(scale * model.height)));
  Image<Rgb8> picture(kWidth, height + 24, Rgb8{255, 255, 255});
  cv::Mat mat = AsMat(picture);
  DrawGrid(result, in_projector, model, scale, mat);
  // The longest line is a sixteenth of the image.
  const double enlarge = RoundDown(model.width / 16.0 / LargestResidual(result, in_projector));
  for (const CellResidual& residual : result.residuals) {
    if (residual.in_projector != in_projector) continue;
    const Eigen::Vector2d from = scale * (residual.pixel + Eigen::Vector2d(0.5, 0.5));
    const Eigen::Vector2d to = from + scale * enlarge * residual.residual_px;
    const cv::Scalar color = PoseColor(residual.sighting);
    cv::line(mat, Fine(from.x(), from.y()), Fine(to.x(), to.y()), color, 1, cv::LINE_AA, kShift);
    cv::circle(mat, Fine(from.x(), from.y()), 3 << (kShift - 1), color, cv::FILLED, cv::LINE_AA,
               kShift);
  }
  const double ratio =
      in_projector ? result.coverage.projector_ratio : result.coverage.camera_ratio;
  Write(mat,
        fmt::format("{:.0f} % of the cells hold points; residuals {:g} times enlarged",
                    100.0 * ratio, enlarge),
        6, height + 16);
  return picture;
}

Image<Rgb8> DrawErrorSlices(const ErrorField& field) {
  SliceLayout layout;
  const Eigen::Vector3d size = field.volume.high - field.volume.low;
  if (size.x() > 0.0 && size.y() > 0.0) {
    layout.panel_height = static_cast<int>(
        std::lround(std::min(3.0, std::max(0.2, size.y() / size.x())) * layout.panel_width));
  }
  const cv::Point end = layout.Corner(3, field.num.z());
  Image<Rgb8> picture(end.x + 100, end.y + 20, Rgb8{255, 255, 255});
  cv::Mat mat = AsMat(picture);
  for (int slice = 0; slice < field.num.z(); ++slice) {
    Write(mat, fmt::format("z {:.3f} m", field.Point(0, 0, slice).z()), 2,
          layout.Corner(0, slice).y + layout.panel_height / 2);
    for (int axis = 0; axis < 3; ++axis) {
      DrawSlice(field, slice, axis, layout, mat);
    }
  }
  constexpr std::array<const char*, 3> kAxes = {"sigma X", "sigma Y", "sigma Z"};
  for (int axis = 0; axis < 3; ++axis) {
    Write(mat, kAxes[static_cast<std::size_t>(axis)], layout.Corner(axis, 0).x, layout.top - 8);
  }
  const Eigen::Vector3d& low = field.volume.low;
  const Eigen::Vector3d& high = field.volume.high;
  Write(mat,
        fmt::format("x {:.3f} to {:.3f} m, y {:.3f} to {:.3f} m downwards; grey: not seen by both",
                    low.x(), high.x(), low.y(), high.y()),
        layout.left, end.y + 6);
  DrawSigmaBar(LargestSigma(field), {end.x + 4, layout.top},
               std::max(1, end.y - layout.top - layout.gap), mat);
  return picture;
}

}  // namespace fringe_fusion
