#pragma once

#include <Eigen/Core>
#include <vector>

#include "fringe_fusion/fusion/implicit_model.hpp"

namespace fringe_fusion {

/// How well one view agrees with the surface that the others measured at the same places.
struct ViewAgreement {
  int view_id = 0;
  int num_points = 0;     ///< places of the view where other views measured as well
  double offset_m = 0.0;  ///< median distance of the view's points to the others' surface
  /// Robust standard deviation of these distances over what noise and poses explain: about 1 for a
  /// view in its place. NaN with too few common places.
  double ratio = 0.0;
  /// Translation in `object` that would bring the view onto the others [m]; zero where the common
  /// places do not fix it.
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();
  bool displaced = false;
};

/// Compares each view of a model with the others, by up to 400 places of each view. The worst view
/// that stands out by a factor of two and beyond three standard deviations is named displaced and
/// leaves the comparison of the others, until none stands out. Of two views alone none is named.
/// @return one entry per view, ascending id.
[[nodiscard]] std::vector<ViewAgreement> CompareViews(const ImplicitModel& model);

}  // namespace fringe_fusion
