#pragma once

#include <Eigen/Core>
#include <vector>

#include "feature.hpp"

namespace fringe_fusion::internal {

/// A feature with its place in a lattice that was grown in the picture.
struct LatticeNode {
  Eigen::Vector2i place = Eigen::Vector2i::Zero();
  int feature = 0;
};

/// Features that form one lattice. The second base vector lies clockwise of the first, as y of x in
/// a picture.
struct Lattice {
  std::vector<LatticeNode> nodes;
};

/// The largest lattice of dots, or one with `enough` nodes.
[[nodiscard]] Lattice GrowDotLattice(const std::vector<Feature>& dots, int enough);

/// The same of chessboard corners, whose bright sectors alternate from node to node.
[[nodiscard]] Lattice GrowCornerLattice(const std::vector<Feature>& corners, int enough);

}  // namespace fringe_fusion::internal
