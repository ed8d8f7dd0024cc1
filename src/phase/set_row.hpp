#pragma once

#include <cstdint>
#include <vector>

#include "frame_rows.hpp"

namespace fringe_fusion::decode {

/// What a phase set says about every pixel of a row.
struct SetRow {
  explicit SetRow(std::size_t size)
      : cycles(size), variance(size), offset(size), amplitude2(size), status(size) {}

  std::vector<float> cycles;         ///< phase / 2 pi, sign and offset undone, 0..1
  std::vector<float> variance;       ///< of cycles
  std::vector<float> offset;         ///< A [DN]
  std::vector<float> amplitude2;     ///< B^2 [DN^2]
  std::vector<std::int32_t> status;  ///< RowStatus

  [[nodiscard]] FitOut out() {
    return {cycles.data(), variance.data(), offset.data(), amplitude2.data(), status.data()};
  }
};

}  // namespace fringe_fusion::decode
