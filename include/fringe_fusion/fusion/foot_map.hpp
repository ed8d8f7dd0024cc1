#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/fusion/voxel_field.hpp"
#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion {

/// Which point of a view's surface answers for a point x of space.
enum class FootRule {
  kLineOfSight,   ///< where the ray of the sensor through x meets the surface (Curless and Levoy)
  kNearestPoint,  ///< the measured point nearest to x (Masuda; Wheeler)
  kNormalFoot,    ///< the foot of x on the plane of that point (Hilton)
  kVariational,   ///< x - D grad D of a variational surface of the view
};

/// The foot pi(x) on the surface of one view.
struct Foot {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< in `object` [m]
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();    ///< of the surface there, unit, outwards
  double variance = 0.0;  ///< along the normal, of range, lateral position and pose [m^2]
  double taper = 1.0;     ///< 0 at a border of what the view measured, 1 well inside
};

class FootMap {
 public:
  virtual ~FootMap() = default;
  FootMap(const FootMap&) = delete;
  FootMap& operator=(const FootMap&) = delete;

  /// @return nothing where the view measured nothing within the reach of x.
  [[nodiscard]] virtual std::optional<Foot> At(const Eigen::Vector3d& point_object) const = 0;
  [[nodiscard]] virtual int view_id() const = 0;

 protected:
  FootMap() = default;
};

/// @param view borrowed for as long as the foot map lives. @param reach_m of a foot from its point.
/// @return error when the view is invalid, has no usable point, states no sigma, is not organised
/// (line of sight) or cannot be fitted (variational).
[[nodiscard]] Result<std::unique_ptr<FootMap>> MakeFootMap(const View& view, FootRule rule,
                                                           double reach_m);

struct ConsensusDistance {
  FieldSample field;          ///< distance, gradient (the consensus normal), sigma, weight
  std::vector<int> view_ids;  ///< of the views that agree, in the order of the foot maps
};

/// The generalised implicit equation itself, at one point:
///   D(x) = sum w_i n . v_i / sum w_i,  v_i = x - pi_i(x),  w_i = taper_i / sigma_i^2,
/// over the largest set of views that agree with one of them: normals within 45 deg, distances
/// along n within four standard deviations. n is the weighted mean of their normals.
/// To the order of kappa |v|^2 tan^2 of the angle between v and n all rules give the same D: this
/// is the reference of ImplicitModel, which sums normal feet on a grid.
[[nodiscard]] ConsensusDistance DistanceByFeet(const std::vector<const FootMap*>& views,
                                               const Eigen::Vector3d& point_object);

}  // namespace fringe_fusion
