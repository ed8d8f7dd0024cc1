#include "fringe_fusion/calibration/target_print.hpp"

#include <algorithm>

#include "charuco_marker.hpp"

namespace fringe_fusion {
namespace {

void AddSquares(const CalibrationTarget& target, TargetPrint& print) {
  const Eigen::Vector2d half = Eigen::Vector2d::Constant(0.5 * target.pitch_m);
  for (int row = 0; row <= target.num_rows; ++row) {
    for (int column = row % 2; column <= target.num_columns; column += 2) {
      const Eigen::Vector2d centre = target.pitch_m * Eigen::Vector2d(column - 0.5, row - 0.5);
      print.shapes.push_back({false, centre, half, target.print_ratio, 1.0});
    }
  }
}

void AddMarkers(const CalibrationTarget& target, TargetPrint& print) {
  const std::vector<Eigen::Vector2d> centres = CharucoMarkerCentres(target);
  for (std::size_t id = 0; id < centres.size(); ++id) {
    print.shapes.push_back({false, centres[id], Eigen::Vector2d::Constant(0.5 * target.marker_m),
                            target.print_ratio, 1.0});
    // The border of a marker is one module wide.
    const Image<std::uint8_t> bits =
        internal::MarkerModules(target.dictionary, static_cast<int>(id));
    const double module_m = target.marker_m / bits.width();
    const Eigen::Vector2d corner =
        centres[id] - Eigen::Vector2d::Constant(0.5 * (target.marker_m - module_m));
    for (int y = 0; y < bits.height(); ++y) {
      for (int x = 0; x < bits.width(); ++x) {
        if (bits(x, y) == 0) continue;
        print.shapes.push_back({false, corner + module_m * Eigen::Vector2d(x, y),
                                Eigen::Vector2d::Constant(0.5 * module_m), 1.0,
                                target.print_ratio});
      }
    }
  }
}

void AddDots(const CalibrationTarget& target, TargetPrint& print) {
  const bool has_rings = target.kind == TargetKind::kRingDots;
  const double below = has_rings ? 1.0 : print.ground_lightness;
  const double lightness = target.light_on_dark ? 1.0 : target.print_ratio;
  const std::vector<Eigen::Vector3d> points = TargetPoints(target);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d centre = points[i].head<2>();
    if (has_rings) {
      print.shapes.push_back({true, centre, Eigen::Vector2d::Constant(target.ring_radius_m), 1.0,
                              print.ground_lightness});
    }
    const double radius_m = DotRadius(target, static_cast<int>(i));
    print.shapes.push_back({true, centre, Eigen::Vector2d::Constant(radius_m), lightness, below});
  }
}

}  // namespace

std::vector<Eigen::Vector2d> CharucoMarkerCentres(const CalibrationTarget& target) {
  std::vector<Eigen::Vector2d> centres;
  if (target.kind != TargetKind::kCharuco) return centres;
  for (int row = 0; row <= target.num_rows; ++row) {
    for (int column = 1 - row % 2; column <= target.num_columns; column += 2) {
      centres.emplace_back(target.pitch_m * Eigen::Vector2d(column - 0.5, row - 0.5));
    }
  }
  return centres;
}

TargetPrint MakeTargetPrint(const CalibrationTarget& target) {
  TargetPrint print;
  const bool is_dark = target.light_on_dark || target.kind == TargetKind::kRingDots;
  print.ground_lightness = is_dark ? target.print_ratio : 1.0;
  if (HasDots(target.kind)) {
    AddDots(target, print);
  } else {
    AddSquares(target, print);
    if (target.kind == TargetKind::kCharuco) AddMarkers(target, print);
  }
  print.min_m = print.shapes.front().centre_m;
  print.max_m = print.min_m;
  for (const PrintShape& shape : print.shapes) {
    print.min_m = print.min_m.cwiseMin(shape.centre_m - shape.half_size_m);
    print.max_m = print.max_m.cwiseMax(shape.centre_m + shape.half_size_m);
  }
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(0.4 * target.pitch_m);
  print.min_m -= margin;
  print.max_m += margin;
  return print;
}

}  // namespace fringe_fusion
