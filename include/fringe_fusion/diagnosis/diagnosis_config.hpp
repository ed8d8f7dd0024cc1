#pragma once

#include "fringe_fusion/common/config.hpp"

namespace fringe_fusion {

/// When a stack counts as faulty. A limit says from where on the fault costs accuracy or points;
/// a ratio is of the projector's light (white minus black) unless said otherwise.
struct DiagnosisConfig {
  bool estimate_noise = false;  ///< sensor noise from each scan itself, not from phase.yaml
  int max_samples = 60000;      ///< pixels that are looked at

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("estimate_noise", estimate_noise);
    field("max_samples", max_samples, 1000, 10000000);
  }
};

}  // namespace fringe_fusion
