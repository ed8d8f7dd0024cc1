#include "fringe_fusion/ros_io/marker_messages.hpp"

#include <array>
#include <cmath>
#include <map>

namespace fringe_fusion::ros_io {
namespace {

visualization_msgs::Marker EmptyMarker(const std_msgs::Header& header, int type) {
  visualization_msgs::Marker marker;
  marker.header = header;
  marker.ns = "fringe_fusion";
  marker.type = type;
  marker.action = visualization_msgs::Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.scale.x = marker.scale.y = marker.scale.z = 1.0;
  marker.color.r = marker.color.g = marker.color.b = 0.7F;
  marker.color.a = 1.0F;
  return marker;
}

geometry_msgs::Point ToPoint(const Eigen::Vector3f& p) {
  geometry_msgs::Point point;
  point.x = static_cast<double>(p.x());
  point.y = static_cast<double>(p.y());
  point.z = static_cast<double>(p.z());
  return point;
}

std_msgs::ColorRGBA ToColor(const Rgb8& rgb) {
  std_msgs::ColorRGBA color;
  color.r = static_cast<float>(rgb.r) / 255.0F;
  color.g = static_cast<float>(rgb.g) / 255.0F;
  color.b = static_cast<float>(rgb.b) / 255.0F;
  color.a = 1.0F;
  return color;
}

// Faces whose corners lie in three different cells of the grid, each cell shown by its first
// vertex.
std::vector<Eigen::Vector3i> ThinFaces(const Mesh& mesh, float cell_m) {
  std::map<std::array<int, 3>, int> first_vertex;
  std::vector<int> representative(mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3f cell = (mesh.vertices[i] / cell_m).array().floor();
    const std::array<int, 3> key{static_cast<int>(cell.x()), static_cast<int>(cell.y()),
                                 static_cast<int>(cell.z())};
    representative[i] = first_vertex.emplace(key, static_cast<int>(i)).first->second;
  }
  std::vector<Eigen::Vector3i> faces;
  for (const Eigen::Vector3i& face : mesh.faces) {
    const Eigen::Vector3i thin(representative[static_cast<std::size_t>(face[0])],
                               representative[static_cast<std::size_t>(face[1])],
                               representative[static_cast<std::size_t>(face[2])]);
    if (thin[0] != thin[1] && thin[1] != thin[2] && thin[2] != thin[0]) faces.push_back(thin);
  }
  return faces;
}

}  // namespace

visualization_msgs::Marker ToMarker(const Mesh& mesh, const std_msgs::Header& header,
                                    std::size_t max_faces) {
  std::vector<Eigen::Vector3i> faces = mesh.faces;
  // Two triangles a cell cover the area when cell^2 = 2 area / faces.
  double cell_m = std::sqrt(2.0 * Area(mesh) / static_cast<double>(max_faces));
  while (faces.size() > max_faces && cell_m > 0.0) {
    faces = ThinFaces(mesh, static_cast<float>(cell_m));
    cell_m *= 1.3;
  }
  visualization_msgs::Marker marker =
      EmptyMarker(header, visualization_msgs::Marker::TRIANGLE_LIST);
  if (faces.empty()) return DeleteMarker(header);
  const bool has_colors = mesh.colors.size() == mesh.vertices.size();
  marker.points.reserve(3 * faces.size());
  for (const Eigen::Vector3i& face : faces) {
    for (int corner = 0; corner < 3; ++corner) {
      const auto index = static_cast<std::size_t>(face[corner]);
      marker.points.push_back(ToPoint(mesh.vertices[index]));
      if (has_colors) marker.colors.push_back(ToColor(mesh.colors[index]));
    }
  }
  return marker;
}

visualization_msgs::Marker ToMarker(const std::vector<OccupancyMap::Cell>& cells,
                                    const std_msgs::Header& header,
                                    const std_msgs::ColorRGBA& color) {
  if (cells.empty()) return DeleteMarker(header);
  visualization_msgs::Marker marker = EmptyMarker(header, visualization_msgs::Marker::CUBE_LIST);
  marker.color = color;
  // A marker has one size for all cubes; a pruned large cell is shown as its smallest parts.
  float size_m = cells.front().size_m;
  for (const OccupancyMap::Cell& cell : cells) size_m = std::min(size_m, cell.size_m);
  marker.scale.x = marker.scale.y = marker.scale.z = static_cast<double>(size_m);
  for (const OccupancyMap::Cell& cell : cells) {
    const int parts = static_cast<int>(std::lround(cell.size_m / size_m));
    const Eigen::Vector3f first =
        cell.center - Eigen::Vector3f::Constant(0.5F * (cell.size_m - size_m));
    for (int i = 0; i < parts * parts * parts; ++i) {
      const Eigen::Vector3f step(static_cast<float>(i % parts),
                                 static_cast<float>(i / parts % parts),
                                 static_cast<float>(i / (parts * parts)));
      marker.points.push_back(ToPoint(first + size_m * step));
    }
  }
  return marker;
}

visualization_msgs::Marker DeleteMarker(const std_msgs::Header& header) {
  visualization_msgs::Marker marker = EmptyMarker(header, visualization_msgs::Marker::CUBE_LIST);
  marker.action = visualization_msgs::Marker::DELETE;
  return marker;
}

}  // namespace fringe_fusion::ros_io
