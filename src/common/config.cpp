#include "fringe_fusion/common/config.hpp"

namespace fringe_fusion::internal {

void BoundsCheck::operator()(const char* name, int value, int low, int high) {
  if (status_ && (value < low || value > high)) {
    status_ = Fail("{}: {} = {} is outside [{}, {}]", owner_, name, value, low, high);
  }
}

void BoundsCheck::operator()(const char* name, double value, double low, double high) {
  // Negated so that NaN fails.
  if (status_ && !(value >= low && value <= high)) {
    status_ = Fail("{}: {} = {} is outside [{}, {}]", owner_, name, value, low, high);
  }
}

}  // namespace fringe_fusion::internal
