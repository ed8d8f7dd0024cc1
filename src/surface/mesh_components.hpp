#pragma once

#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::internal {

struct ComponentResult {
  Mesh mesh;
  int num_components = 0;  ///< before
  int num_removed = 0;
  int largest_faces = 0;  ///< of the largest component
};

/// Removes the components (faces joined by common vertices) with fewer faces than min_faces and all
/// vertices that no face uses any more. The order of what stays is kept.
[[nodiscard]] ComponentResult RemoveSmallComponents(const Mesh& mesh, int min_faces);

}  // namespace fringe_fusion::internal
