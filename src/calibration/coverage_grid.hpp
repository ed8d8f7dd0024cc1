#pragma once

#include <Eigen/Core>
#include <array>
#include <string>

namespace fringe_fusion {

/// Which cells of a device's image hold a point.
class CoverageGrid {
 public:
  static constexpr int kColumns = 8;
  static constexpr int kRows = 6;

  CoverageGrid(int width, int height) : width_(width), height_(height) {}

  /// A pixel outside the image counts nowhere.
  void Add(const Eigen::Vector2d& pixel);
  [[nodiscard]] bool Holds(int column, int row) const {
    return filled_[static_cast<std::size_t>(row * kColumns + column)];
  }
  /// Share of the cells that hold a point.
  [[nodiscard]] double Ratio() const;
  /// Quarters of the image of which most cells are empty, in words; empty: none.
  [[nodiscard]] std::string EmptyQuarters(const std::string& device) const;

 private:
  int width_;
  int height_;
  std::array<bool, static_cast<std::size_t>(kColumns* kRows)> filled_{};
};

}  // namespace fringe_fusion
