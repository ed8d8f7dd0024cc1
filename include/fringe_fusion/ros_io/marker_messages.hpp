#pragma once

#include <std_msgs/ColorRGBA.h>
#include <std_msgs/Header.h>
#include <visualization_msgs/Marker.h>

#include <cstddef>
#include <vector>

#include "fringe_fusion/planning/occupancy_map.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::ros_io {

/// TRIANGLE_LIST in the vertex colours (grey without). A mesh of more than max_faces is thinned for
/// display by merging vertices on a grid; the mesh itself stays as it is.
[[nodiscard]] visualization_msgs::Marker ToMarker(const Mesh& mesh, const std_msgs::Header& header,
                                                  std::size_t max_faces);

/// CUBE_LIST of cells of one colour; an empty list deletes the marker.
[[nodiscard]] visualization_msgs::Marker ToMarker(const std::vector<OccupancyMap::Cell>& cells,
                                                  const std_msgs::Header& header,
                                                  const std_msgs::ColorRGBA& color);

/// Takes a marker away again.
[[nodiscard]] visualization_msgs::Marker DeleteMarker(const std_msgs::Header& header);

}  // namespace fringe_fusion::ros_io
