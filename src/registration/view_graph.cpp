#include "fringe_fusion/registration/view_graph.hpp"

#include <cmath>
#include <set>

#include "common/dense.hpp"

namespace fringe_fusion {
namespace {

Status CheckTransform(const Transform& T, const std::string& owner) {
  if (!T.matrix().allFinite()) return Fail("{}: a value is not finite", owner);
  const double off = (T.linear().transpose() * T.linear() - Eigen::Matrix3d::Identity()).norm();
  if (!(off < 1e-3) || !(T.linear().determinant() > 0.0)) {
    return Fail("{}: rotation is off by {} from orthonormal, limit 0.001", owner, off);
  }
  return {};
}

Status CheckCovariance(const Matrix6d& covariance, const std::string& owner) {
  if (!covariance.allFinite()) return Fail("{}: covariance is not finite", owner);
  const Vector6d values = dense::SymmetricEigenvalues(covariance);
  if (!(values[5] > 0.0)) return Fail("{}: covariance is zero", owner);
  if (!(values[0] >= -1e-9 * values[5])) {
    return Fail("{}: covariance has the negative eigenvalue {}", owner, values[0]);
  }
  return {};
}

Status CheckTie(const ViewTie& tie, const std::set<int>& ids) {
  const std::string owner = fmt::format("tie of views {} and {}", tie.first, tie.second);
  for (const int id : {tie.first, tie.second}) {
    if (ids.count(id) == 0) return Fail("{}: there is no view {}", owner, id);
  }
  if (tie.first == tie.second) return Fail("{}: a view cannot be tied to itself", owner);
  if (Status status = CheckTransform(tie.T_first_second, owner); !status) return status;
  return CheckCovariance(tie.covariance, owner);
}

Status CheckChain(const DeviceChain& chain, const std::set<int>& ids) {
  std::set<int> seen;
  for (const DeviceChain::Reading& reading : chain.readings) {
    const std::string owner = fmt::format("{} at view {}", chain.name, reading.view);
    if (ids.count(reading.view) == 0) return Fail("{}: there is no such view", owner);
    if (!seen.insert(reading.view).second) return Fail("{}: a second reading", owner);
    if (Status status = CheckTransform(reading.T_base_flange, owner); !status) return status;
  }
  if (seen.size() < 3) {
    return Fail("{}: {} readings given, at least 3 needed to solve for its mounting", chain.name,
                seen.size());
  }
  for (const Mounting* mounting : {&chain.object_base, &chain.flange_camera}) {
    if (!mounting->known) continue;
    const std::string owner = chain.name + ": mounting";
    if (Status status = CheckTransform(mounting->T, owner); !status) return status;
    if (Status status = CheckCovariance(mounting->covariance, owner); !status) return status;
  }
  return CheckCovariance(chain.covariance, chain.name);
}

}  // namespace

DeviceChain TurntableChain(const std::vector<int>& view_ids, const std::vector<double>& angles_rad,
                           double sigma_angle_rad, double sigma_m) {
  DeviceChain chain;
  for (std::size_t i = 0; i < view_ids.size() && i < angles_rad.size(); ++i) {
    Transform T = Transform::Identity();
    // The table turns the object by +angle, hence the camera, seen from the object, by -angle.
    T.linear() = ExpRotation(Eigen::Vector3d(0.0, 0.0, -angles_rad[i]));
    chain.readings.push_back({view_ids[i], T});
  }
  // Axial wobble tilts by as much as the bearing shifts over about 0.1 m.
  chain.covariance = PoseCovariance(10.0 * sigma_m, sigma_m);
  chain.covariance(2, 2) = sigma_angle_rad * sigma_angle_rad;
  return chain;
}

Status Validate(const ViewGraph& graph) {
  if (graph.views.size() < 2) {
    return Fail("registration: {} view(s) given, at least 2 needed", graph.views.size());
  }
  std::set<int> ids;
  for (const View& view : graph.views) {
    if (Status status = Validate(view); !status) return status;
    if (!ids.insert(view.id).second)
      return Fail("view {} ({}): its id is used twice", view.id, view.name);
  }
  for (const ViewTie& tie : graph.ties) {
    if (Status status = CheckTie(tie, ids); !status) return status;
  }
  return graph.chain ? CheckChain(*graph.chain, ids) : Status{};
}

AxisLine TurntableAxis(const SolvedChain& chain) {
  AxisLine axis;
  const Transform& T = chain.T_object_base;
  axis.direction = T.linear().col(2);
  const Eigen::Vector3d origin = T.translation();
  axis.point = origin - axis.direction * axis.direction.dot(origin);
  // Turning about z and sliding along it do not move the axis.
  const Matrix6d& covariance = chain.covariance_object_base;
  axis.sigma_direction_rad = std::sqrt(0.5 * (covariance(0, 0) + covariance(1, 1)));
  axis.sigma_point_m = std::sqrt(0.5 * (covariance(3, 3) + covariance(4, 4)));
  return axis;
}

}  // namespace fringe_fusion
