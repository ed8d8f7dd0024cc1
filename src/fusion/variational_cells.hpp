#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "variational_fit.hpp"

namespace fringe_fusion::internal {

/// The cells of an octree and their functions, blended to one:
///   f = sum w_k f_k / sum w_k,  w_k the product of Wendland's functions along the axes.
class CellTree {
 public:
  struct Settings {
    int max_cell_centers = 120;
    double overlap = 1.4;
    double margin = 0.0;  ///< centres beyond the reach of a cell that its function still hears
    FitSettings fit;
  };

  /// Cells are divided until their overlapping boxes and the margin hold few enough centres, or
  /// the margin is wider than the cell.
  CellTree(const std::vector<Center>& centers, const Settings& settings);

  /// Fits the function of every cell. @return standard deviation of f at each centre, of the cell
  /// in which it lies.
  [[nodiscard]] std::vector<float> Fit(const std::vector<Center>& centers);

  /// Cells whose overlapping boxes meet a box, in a fixed order.
  [[nodiscard]] std::vector<int> Touching(const Eigen::AlignedBox3f& box) const;

  /// The blend of some cells at a point; none where no cell reaches.
  [[nodiscard]] std::optional<FitValue> At(const Eigen::Vector3f& point,
                                           const std::vector<int>& cells) const;

  [[nodiscard]] std::size_t num_cells() const { return cells_.size(); }
  [[nodiscard]] std::size_t MemoryBytes() const;
  [[nodiscard]] double max_alpha() const { return max_alpha_; }

 private:
  struct Node {
    Eigen::Vector3f middle;
    float half = 0.0F;
    int first_child = -1;  // of up to eight that follow each other
    int num_children = 0;
    int cell = -1;
  };
  struct Cell {
    Eigen::Vector3f middle;
    float half = 0.0F;         // of the cell itself
    std::vector<int> centers;  // of the system; empty after the fit
    std::optional<LocalFit> fit;
  };
  void Divide(const std::vector<Center>& centers, std::size_t node, const std::vector<int>& within,
              int depth);
  void MakeCell(const std::vector<Center>& centers, std::size_t node,
                const std::vector<int>& within, const std::vector<int>& around);
  [[nodiscard]] float Reach(float half) const {
    return half * static_cast<float>(settings_.overlap);
  }
  [[nodiscard]] float Hearing(float half) const {
    return Reach(half) + static_cast<float>(settings_.margin);
  }

  Settings settings_;
  std::vector<Node> nodes_;
  std::vector<Cell> cells_;
  double max_alpha_ = 0.0;
};

}  // namespace fringe_fusion::internal
