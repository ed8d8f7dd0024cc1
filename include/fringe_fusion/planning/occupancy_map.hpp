#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion {

struct OccupancyConfig {
  double resolution_m = 0.005;
  int max_points_per_view = 50000;  ///< rays inserted per view, spread evenly over the image
  double max_range_m = 5.0;

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("resolution_m", resolution_m, 1e-5, 10.0);
    field("max_points_per_view", max_points_per_view, 1, 100000000);
    field("max_range_m", max_range_m, 1e-3, 1000.0);
  }
};

/// Occupied and free space of the object's surroundings, inserted by rays from both devices: what
/// the camera or the projector looked through is free.
/// Ref: Hornung et al., OctoMap, 2013.
class OccupancyMap {
 public:
  [[nodiscard]] static Result<OccupancyMap> Create(const OccupancyConfig& config);
  OccupancyMap(OccupancyMap&&) noexcept;
  OccupancyMap& operator=(OccupancyMap&&) noexcept;
  ~OccupancyMap();

  [[nodiscard]] Status AddView(const View& view);

  struct Cell {
    Eigen::Vector3f center;  ///< in `object` [m]
    float size_m = 0.0F;
    float occupancy = 0.0F;  ///< probability
  };
  [[nodiscard]] std::vector<Cell> OccupiedCells() const;
  [[nodiscard]] std::vector<Cell> FreeCells() const;
  [[nodiscard]] double resolution_m() const;

  /// Payload of octomap_msgs/Octomap with binary = true.
  [[nodiscard]] std::vector<std::int8_t> BinaryData() const;
  [[nodiscard]] std::string TreeType() const;
  /// Writes a .bt file. @return error naming the file.
  [[nodiscard]] Status WriteBinary(const std::string& path) const;

 private:
  struct Impl;
  explicit OccupancyMap(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace fringe_fusion
