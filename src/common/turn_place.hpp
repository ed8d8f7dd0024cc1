#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "common/constants.hpp"

namespace fringe_fusion {

/// Where an angle lies between two entries of a table that goes once around.
class TurnPlace {
 public:
  TurnPlace(double angle_rad, std::size_t size) {
    const double turns = angle_rad / kTwoPi;
    const double place = (turns - std::floor(turns)) * static_cast<double>(size);
    low_ = std::min(static_cast<std::size_t>(place), size - 1);
    high_ = low_ + 1 == size ? 0 : low_ + 1;
    part_ = place - static_cast<double>(low_);
  }

  /// The value there, by straight lines. @param table of the size given.
  [[nodiscard]] double In(const std::vector<double>& table) const {
    return table[low_] + part_ * (table[high_] - table[low_]);
  }

 private:
  std::size_t low_ = 0;
  std::size_t high_ = 0;
  double part_ = 0.0;
};

}  // namespace fringe_fusion
