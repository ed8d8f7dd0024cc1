#include "print_texture.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace fringe_fusion::sim {
namespace {

/// Share of an area of this width that lies on the inner side of an edge at `depth` inside.
double Share(double depth, double width, double softness) {
  if (softness > 0.0) {
    const double sigma = std::sqrt(softness * softness + width * width / 12.0);
    return 0.5 * std::erfc(-depth / (std::sqrt(2.0) * sigma));
  }
  if (!(width > 0.0)) return depth > 0.0 ? 1.0 : 0.0;
  return std::clamp(0.5 + depth / width, 0.0, 1.0);
}

/// Share of an area about `d` from the middle of a shape that the shape covers.
double Coverage(const PrintShape& shape, double softness, const Eigen::Vector2d& d,
                const Eigen::Vector2d& across, const Eigen::Vector2d& down) {
  if (shape.is_disc) {
    const double norm = d.norm();
    const Eigen::Vector2d outwards = d / std::max(norm, 1e-12);
    const double width = std::abs(outwards.dot(across)) + std::abs(outwards.dot(down));
    return Share(shape.half_size_m.x() - norm, width, softness);
  }
  const Eigen::Vector2d width = across.cwiseAbs() + down.cwiseAbs();
  const auto along = [&](Eigen::Index axis) {
    const double half = shape.half_size_m[axis];
    return Share(half - d[axis], width[axis], softness) -
           Share(-half - d[axis], width[axis], softness);
  };
  return along(0) * along(1);
}

}  // namespace

PrintTexture::PrintTexture(const SurfacePrint& print)
    : print_(print), T_target_object_(print.T_object_target.inverse()) {
  const Eigen::Vector2d size = print.print.max_m - print.print.min_m;
  cell_m_ = std::max(1e-6, std::sqrt(size.prod() / static_cast<double>(std::max<std::size_t>(
                                                       1, print.print.shapes.size()))));
  for (std::size_t i = 0; i < print.print.shapes.size(); ++i) {
    const PrintShape& shape = print.print.shapes[i];
    // Areas of up to half a cell reach over the edge of their cell.
    const Eigen::Vector2d reach = shape.half_size_m + Eigen::Vector2d::Constant(0.5 * cell_m_);
    const auto [x0, y0] = Cell(shape.centre_m - reach);
    const auto [x1, y1] = Cell(shape.centre_m + reach);
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) shapes_[{x, y}].push_back(static_cast<int>(i));
    }
  }
}

std::pair<int, int> PrintTexture::Cell(const Eigen::Vector2d& point) const {
  return {static_cast<int>(std::floor(point.x() / cell_m_)),
          static_cast<int>(std::floor(point.y() / cell_m_))};
}

double PrintTexture::Lightness(const Eigen::Vector3d& point_object,
                               const Eigen::Vector3d& across_object,
                               const Eigen::Vector3d& down_object) const {
  const Eigen::Vector3d point = T_target_object_ * point_object;
  constexpr double kThickness = 1e-4;
  if (!(std::abs(point.z()) < kThickness)) return 1.0;
  const Eigen::Vector2d at = point.head<2>();
  if ((at.array() < print_.print.min_m.array()).any() ||
      (at.array() > print_.print.max_m.array()).any()) {
    return 1.0;
  }
  double lightness = print_.print.ground_lightness;
  const auto cell = shapes_.find(Cell(at));
  if (cell == shapes_.end()) return lightness;
  const Eigen::Vector2d across = (T_target_object_.linear() * across_object).head<2>();
  const Eigen::Vector2d down = (T_target_object_.linear() * down_object).head<2>();
  for (const int i : cell->second) {
    const PrintShape& shape = print_.print.shapes[static_cast<std::size_t>(i)];
    lightness += Coverage(shape, print_.softness_m, at - shape.centre_m, across, down) *
                 (shape.lightness - shape.lightness_below);
  }
  return lightness;
}

Mesh MakeTargetPlate(const SurfacePrint& print) {
  const Eigen::Vector2d& low = print.print.min_m;
  const Eigen::Vector2d& high = print.print.max_m;
  Mesh mesh;
  for (const Eigen::Vector3d& corner :
       {Eigen::Vector3d(low.x(), low.y(), 0.0), Eigen::Vector3d(high.x(), low.y(), 0.0),
        Eigen::Vector3d(high.x(), high.y(), 0.0), Eigen::Vector3d(low.x(), high.y(), 0.0)}) {
    mesh.vertices.push_back((print.T_object_target * corner).cast<float>());
  }
  mesh.faces = {Eigen::Vector3i(0, 2, 1), Eigen::Vector3i(0, 3, 2)};
  return mesh;
}

Transform TargetView(const TargetPrint& print, double distance_m, double tilt_y_rad,
                     double tilt_x_rad, double roll_rad) {
  const Eigen::Vector2d middle = 0.5 * (print.min_m + print.max_m);
  Transform T_camera_target = Transform::Identity();
  T_camera_target.linear() = (Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitZ()) *
                              Eigen::AngleAxisd(tilt_y_rad, Eigen::Vector3d::UnitY()) *
                              Eigen::AngleAxisd(tilt_x_rad, Eigen::Vector3d::UnitX()))
                                 .toRotationMatrix();
  T_camera_target.translation() =
      Eigen::Vector3d(0.0, 0.0, distance_m) -
      T_camera_target.linear() * Eigen::Vector3d(middle.x(), middle.y(), 0.0);
  return T_camera_target.inverse();
}

}  // namespace fringe_fusion::sim
