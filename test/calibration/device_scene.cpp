#include "device_scene.hpp"

#include <cmath>

namespace fringe_fusion::test_support {

Transform TransformOf(const Eigen::Vector3d& rotation_deg, const Eigen::Vector3d& translation_m) {
  const double angle = rotation_deg.norm() * kRadPerDeg;
  Transform T = Transform::Identity();
  if (angle > 0.0) {
    T.linear() = Eigen::AngleAxisd(angle, rotation_deg.normalized()).toRotationMatrix();
  }
  T.translation() = translation_m;
  return T;
}

Transform DrawPerturbation(std::mt19937& random, double sigma_rotation_rad,
                           double sigma_translation_m) {
  std::normal_distribution<double> normal;
  Eigen::Vector3d rotation;
  Eigen::Vector3d translation;
  for (int i = 0; i < 3; ++i) rotation[i] = sigma_rotation_rad * normal(random);
  for (int i = 0; i < 3; ++i) translation[i] = sigma_translation_m * normal(random);
  return TransformOf(rotation / kRadPerDeg, translation);
}

std::vector<Transform> HandEyeViews(const CalibrationTarget& target, int num, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::vector<Transform> views;
  for (int k = 0; k < num; ++k) {
    const Eigen::Vector3d middle(0.03 * uniform(random), 0.03 * uniform(random),
                                 0.62 + 0.05 * uniform(random));
    const double tilt = (20.0 + 10.0 * uniform(random)) * kRadPerDeg;
    const double axis = 2.4 * k + 0.3 * uniform(random);
    const double roll = (k % 2 == 0 ? 1.0 : -1.0) * (45.0 + 15.0 * uniform(random)) * kRadPerDeg;
    views.push_back(ScenePose(target, middle, tilt, axis, roll));
  }
  return views;
}

Transform RobotScene::FlangeFor(const Transform& T_camera_target) const {
  const Transform T_carrier_target = T_carrier_camera * T_camera_target;
  if (mount == HandEyeMount::kEyeInHand) return T_other_target * T_carrier_target.inverse();
  return T_carrier_target * T_other_target.inverse();
}

std::vector<DevicePose> ReadRobot(const RobotScene& scene,
                                  const std::vector<Transform>& T_camera_target,
                                  const DeviceNoise& noise, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<DevicePose> poses;
  for (std::size_t k = 0; k < T_camera_target.size(); ++k) {
    DevicePose pose;
    pose.name = "pose " + std::to_string(k);
    pose.T_base_flange =
        scene.FlangeFor(T_camera_target[k]) *
        DrawPerturbation(random, noise.sigma_rotation_rad, noise.sigma_translation_m);
    pose.covariance = PoseCovariance(noise.sigma_rotation_rad, noise.sigma_translation_m);
    poses.push_back(pose);
  }
  return poses;
}

std::vector<TargetPose> ReadTargets(const std::vector<Transform>& T_camera_target,
                                    const DeviceNoise& noise, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<TargetPose> poses;
  for (const Transform& T : T_camera_target) {
    poses.push_back(
        {T * DrawPerturbation(random, noise.sigma_rotation_rad, noise.sigma_translation_m),
         PoseCovariance(noise.sigma_rotation_rad, noise.sigma_translation_m)});
  }
  return poses;
}

Vector6d PerturbationTo(const Transform& truth, const Transform& found) {
  return Log(truth.inverse() * found);
}

std::vector<Transform> TableScene::TargetsAt(const std::vector<double>& angles_rad,
                                             double sigma_wobble_rad, double sigma_runout_m,
                                             double sigma_angle_rad, unsigned seed) const {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Transform> targets;
  for (const double angle : angles_rad) {
    const double off = sigma_angle_rad * normal(random);
    const Transform turn(Eigen::AngleAxisd(angle + off, Eigen::Vector3d::UnitZ()));
    Transform wobble = DrawPerturbation(random, sigma_wobble_rad, sigma_runout_m);
    targets.push_back(T_camera_base * turn * wobble * T_table_target);
  }
  return targets;
}

std::vector<TurntableStop> TableStops(int num, double arc_deg) {
  std::vector<TurntableStop> stops;
  const int num_steps = arc_deg < 360.0 ? num - 1 : num;
  for (int k = 0; k < num; ++k) {
    stops.push_back({"stop " + std::to_string(k), kRadPerDeg * arc_deg * k / num_steps, 0.0});
  }
  return stops;
}

std::vector<double> AnglesOfStops(const std::vector<TurntableStop>& stops) {
  std::vector<double> angles;
  for (const TurntableStop& stop : stops) angles.push_back(stop.angle_rad);
  return angles;
}

AxisError ErrorOfAxis(const TableScene& scene, const TurntableResult& result) {
  const Eigen::Vector3d axis = scene.T_camera_base.linear().col(2);
  const Eigen::Vector3d offset = result.point_camera - scene.T_camera_base.translation();
  AxisError error;
  error.direction_rad =
      std::atan2(axis.cross(result.direction_camera).norm(), axis.dot(result.direction_camera));
  error.distance_m = (offset - axis * axis.dot(offset)).norm();
  return error;
}

}  // namespace fringe_fusion::test_support
