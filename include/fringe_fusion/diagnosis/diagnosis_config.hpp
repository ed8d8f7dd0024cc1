#pragma once

#include "fringe_fusion/common/config.hpp"

namespace fringe_fusion {

/// When a stack counts as faulty. A limit says from where on the fault costs accuracy or points;
/// a ratio is of the projector's light (white minus black) unless said otherwise.
struct DiagnosisConfig {
  bool estimate_noise = false;        ///< sensor noise from each scan itself, not from phase.yaml
  int max_samples = 60000;            ///< pixels that are looked at
  double max_saturated_ratio = 0.01;  ///< share of the lit pixels that saturate in the white frame
  double min_signal_sigma = 12.0;     ///< median fringe amplitude of the lit pixels [noise sigma]

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("estimate_noise", estimate_noise);
    field("max_samples", max_samples, 1000, 10000000);
    field("max_saturated_ratio", max_saturated_ratio, 0.0, 1.0);
    field("min_signal_sigma", min_signal_sigma, 0.0, 1000.0);
  }
};

}  // namespace fringe_fusion
