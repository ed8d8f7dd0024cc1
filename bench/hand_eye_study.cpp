// Hand-eye and turntable: error against truth, bound and statement, beside OpenCV's
// calibrateHandEye on the same input: hand_eye_study nees [RUNS] | lever [RUNS] | table [RUNS] |
// real FOLDER
#include <time.h>

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <stdexcept>

#include "fringe_fusion/calibration/detect_target.hpp"
#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/device_files.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "src/common/dense.hpp"
#include "test/calibration/device_scene.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

constexpr double kSigmaRobotRad = 0.005 * kRadPerDeg;
constexpr double kSigmaRobotM = 2e-5;
constexpr int kNumRobotPoses = 20;

double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

template <typename T>
T Value(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(*result);
}

double Normalized(const Matrix6d& covariance, const Vector6d& error) {
  return error.dot(Vector6d(dense::SolveSymmetric(covariance, error)));
}

struct Method {
  const char* name;
  cv::HandEyeCalibrationMethod method;
};
constexpr std::array<Method, 5> kMethods = {{{"Tsai", cv::CALIB_HAND_EYE_TSAI},
                                             {"Park", cv::CALIB_HAND_EYE_PARK},
                                             {"Horaud", cv::CALIB_HAND_EYE_HORAUD},
                                             {"Andreff", cv::CALIB_HAND_EYE_ANDREFF},
                                             {"Daniilidis", cv::CALIB_HAND_EYE_DANIILIDIS}}};

cv::Mat MatOf(const Eigen::Ref<const Eigen::MatrixXd>& m) {
  cv::Mat out(static_cast<int>(m.rows()), static_cast<int>(m.cols()), CV_64F);
  for (int i = 0; i < out.rows; ++i) {
    for (int j = 0; j < out.cols; ++j) out.at<double>(i, j) = m(i, j);
  }
  return out;
}

Transform TransformOfMats(const cv::Mat& R, const cv::Mat& t) {
  Transform T = Transform::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) T.linear()(i, j) = R.at<double>(i, j);
    T.translation()[i] = t.at<double>(i, 0);
  }
  return T;
}

/// T_carrier_camera by OpenCV; @param T_base_carrier of an eye in hand.
Transform ByOpenCv(const std::vector<Transform>& T_base_flange,
                   const std::vector<Transform>& T_camera_target,
                   cv::HandEyeCalibrationMethod method) {
  std::vector<cv::Mat> robot_R;
  std::vector<cv::Mat> robot_t;
  std::vector<cv::Mat> target_R;
  std::vector<cv::Mat> target_t;
  for (std::size_t k = 0; k < T_base_flange.size(); ++k) {
    robot_R.push_back(MatOf(T_base_flange[k].linear()));
    robot_t.push_back(MatOf(T_base_flange[k].translation()));
    target_R.push_back(MatOf(T_camera_target[k].linear()));
    target_t.push_back(MatOf(T_camera_target[k].translation()));
  }
  cv::Mat R;
  cv::Mat t;
  cv::calibrateHandEye(robot_R, robot_t, target_R, target_t, R, t, method);
  return TransformOfMats(R, t);
}

/// Squared distance between where two transforms put the middle of the target [m^2], mean of views.
double LeverSquared(const Transform& found, const Transform& truth,
                    const std::vector<Transform>& views, const Eigen::Vector3d& middle) {
  double sum = 0.0;
  for (const Transform& view : views) {
    sum += (found * (view * middle) - truth * (view * middle)).squaredNorm();
  }
  return sum / static_cast<double>(views.size());
}

Eigen::Vector3d Middle(const CalibrationTarget& target) {
  const auto points = TargetPoints(target);
  return 0.5 * (points.front() + points.back());
}

/// Largest and smallest of the largest rotations between the poses of one run.
double LargestRotationDeg(const std::vector<Transform>& views) {
  double largest = 0.0;
  for (const Transform& a : views) {
    for (const Transform& b : views) {
      largest = std::max(largest, LogRotation(a.linear().transpose() * b.linear()).norm());
    }
  }
  return largest / kRadPerDeg;
}

/// Target poses with covariance: many runs, both mounts.
void StudyNees(int num_runs) {
  double squared_camera = 0.0;
  double squared_target = 0.0;
  double lever = 0.0;
  double predicted = 0.0;
  int num_left_out = 0;
  const double begin = CpuSeconds();
  for (int run = 0; run < num_runs; ++run) {
    RobotScene scene;
    scene.mount = run % 2 == 0 ? HandEyeMount::kEyeInHand : HandEyeMount::kEyeToHand;
    const auto seed = static_cast<unsigned>(10 * run);
    const auto views = HandEyeViews(SceneTarget(), kNumRobotPoses, seed + 1U);
    const auto robot = ReadRobot(scene, views, {kSigmaRobotRad, kSigmaRobotM}, seed + 2U);
    const auto targets = ReadTargets(views, {0.003 * kRadPerDeg, 1e-5}, seed + 3U);
    const auto result = Value(CalibrateHandEye(robot, targets, scene.mount, {}));
    squared_camera += Normalized(result.covariance_camera,
                                 PerturbationTo(scene.T_carrier_camera, result.T_carrier_camera));
    squared_target += Normalized(result.covariance_target,
                                 PerturbationTo(scene.T_other_target, result.T_other_target));
    lever += LeverSquared(result.T_carrier_camera, scene.T_carrier_camera, views,
                          Eigen::Vector3d::Zero());
    predicted += 3.0 * result.predicted_error_m * result.predicted_error_m;
    for (const DevicePoseOutcome& pose : result.poses) num_left_out += pose.used ? 0 : 1;
  }
  fmt::print(
      "hand-eye from target poses, {} runs x 6: squared error over stated {:.3f} (camera), {:.3f} "
      "(target); through the lever {:.4f} mm, over predicted {:.3f}; {} of {} poses left out; "
      "{:.2f} s of CPU a run\n",
      num_runs, squared_camera / (6.0 * num_runs), squared_target / (6.0 * num_runs),
      1e3 * std::sqrt(lever / num_runs), std::sqrt(lever / predicted), num_left_out,
      kNumRobotPoses * num_runs, (CpuSeconds() - begin) / num_runs);
}

/// Cramer-Rao bound of T_carrier_camera of an eye in hand from points and robot poses, by numeric
/// derivatives of the measurement itself.
Matrix6d BoundOfHandEye(const RobotScene& scene, const std::vector<Transform>& views,
                        const std::vector<TargetSighting>& sightings, const CellCalibration& cell,
                        const std::vector<Eigen::Vector3d>& points) {
  constexpr double kStep = 1e-6;
  using Matrix12 = Eigen::Matrix<double, 12, 12>;
  Matrix12 information = Matrix12::Zero();
  for (std::size_t k = 0; k < views.size(); ++k) {
    const Transform F = scene.FlangeFor(views[k]);
    Eigen::Matrix<double, 18, 18> normal = Eigen::Matrix<double, 18, 18>::Zero();
    for (const PointSighting& seen : sightings[k].points) {
      const auto pixels = [&](const Eigen::Matrix<double, 18, 1>& x) {
        const Vector6d by_camera = x.head<6>();
        const Vector6d by_target = x.segment<6>(6);
        const Vector6d by_robot = x.tail<6>();
        const Eigen::Vector3d point =
            (F * Exp(by_robot) * scene.T_carrier_camera * Exp(by_camera)).inverse() *
            (scene.T_other_target * Exp(by_target) * points[static_cast<std::size_t>(seen.point)]);
        Eigen::Vector4d pixel;
        pixel << Project(cell.camera, point),
            Project(cell.projector, cell.T_projector_camera * point);
        return pixel;
      };
      Eigen::Matrix<double, 4, 18> J;
      for (int i = 0; i < 18; ++i) {
        Eigen::Matrix<double, 18, 1> x = Eigen::Matrix<double, 18, 1>::Zero();
        x[i] = kStep;
        J.col(i) = (pixels(x) - pixels(-x)) / (2.0 * kStep);
      }
      Eigen::Vector4d weight;
      weight << Eigen::Vector2d::Constant(1.0 / seen.covariance_camera_px2(0, 0)),
          Eigen::Vector2d::Constant(seen.has_projector ? 1.0 / seen.covariance_projector_px2(0, 0)
                                                       : 0.0);
      normal += J.transpose() * weight.asDiagonal() * J;
    }
    for (int i = 0; i < 3; ++i) {
      normal(12 + i, 12 + i) += 1.0 / (kSigmaRobotRad * kSigmaRobotRad);
      normal(15 + i, 15 + i) += 1.0 / (kSigmaRobotM * kSigmaRobotM);
    }
    const Matrix6d own = normal.bottomRightCorner<6, 6>();
    const Eigen::Matrix<double, 6, 12> coupling = normal.bottomLeftCorner<6, 12>();
    information += normal.topLeftCorner<12, 12>() -
                   Matrix12(dense::Propagate(coupling.transpose(), dense::Invert(own)));
  }
  return dense::Invert(information).topLeftCorner<6, 6>();
}

/// E9: points of the target, robot of .005 deg and .02 mm, 20 poses, against the bound and OpenCV.
void StudyLever(int num_runs) {
  const CellCalibration cell = SceneCell();
  const CalibrationTarget target = SceneTarget();
  const Eigen::Vector3d middle = Middle(target);
  double ours = 0.0;
  double largest = 0.0;
  double bound = 0.0;
  double squared = 0.0;
  double seconds = 0.0;
  double least_rotation_deg = 180.0;
  std::array<double, kMethods.size()> others{};
  for (int run = 0; run < num_runs; ++run) {
    const RobotScene scene;
    const auto seed = static_cast<unsigned>(10 * run);
    const auto views = HandEyeViews(target, kNumRobotPoses, seed + 1U);
    least_rotation_deg = std::min(least_rotation_deg, LargestRotationDeg(views));
    SceneNoise noise;
    noise.seed = seed + 5U;
    const auto sightings = SightAll(cell, target, views, noise);
    const auto robot = ReadRobot(scene, views, {kSigmaRobotRad, kSigmaRobotM}, seed + 2U);
    const double begin = CpuSeconds();
    const auto result = Value(CalibrateHandEye(robot, sightings, {target, cell}, scene.mount, {}));
    seconds += CpuSeconds() - begin;
    const double own = LeverSquared(result.T_carrier_camera, scene.T_carrier_camera, views, middle);
    ours += own;
    largest = std::max(largest, own);
    squared += Normalized(result.covariance_camera,
                          PerturbationTo(scene.T_carrier_camera, result.T_carrier_camera));
    const Matrix6d best = BoundOfHandEye(scene, views, sightings, cell, TargetPoints(target));
    for (const Transform& view : views) {
      Eigen::Matrix<double, 3, 6> J;
      J << -Hat(view * middle), Eigen::Matrix3d::Identity();
      bound += (J * best * J.transpose()).trace() / static_cast<double>(views.size());
    }
    std::vector<Transform> T_base_flange;
    std::vector<Transform> T_camera_target;
    for (std::size_t k = 0; k < robot.size(); ++k) {
      T_base_flange.push_back(robot[k].T_base_flange);
      T_camera_target.push_back(result.poses[k].T_camera_target);
    }
    for (std::size_t m = 0; m < kMethods.size(); ++m) {
      others[m] += LeverSquared(ByOpenCv(T_base_flange, T_camera_target, kMethods[m].method),
                                scene.T_carrier_camera, views, middle);
    }
  }
  const auto rms_mm = [&](double sum) { return 1e3 * std::sqrt(sum / num_runs); };
  fmt::print(
      "hand-eye from points, {} runs, {} poses of rotations up to at least {:.0f} deg: error "
      "through the lever {:.4f} mm (rms of the distance), worst run {:.4f} mm, bound {:.4f} mm, "
      "ratio {:.3f}; squared error over stated {:.3f} ({} numbers); {:.2f} s of CPU a run\n",
      num_runs, kNumRobotPoses, least_rotation_deg, rms_mm(ours), 1e3 * std::sqrt(largest),
      rms_mm(bound), std::sqrt(ours / bound), squared / (6.0 * num_runs), 6 * num_runs,
      seconds / num_runs);
  for (std::size_t m = 0; m < kMethods.size(); ++m) {
    fmt::print("  OpenCV {} on the same poses: {:.4f} mm\n", kMethods[m].name, rms_mm(others[m]));
  }
}

/// E8: a target on a table, 36 stops.
void StudyTable(int num_runs) {
  const CellCalibration cell = SceneCell();
  const CalibrationTarget target = SceneTarget();
  const TableScene scene;
  const TurntableConfig config;
  for (const bool angles_known : {true, false}) {
    TurntableConfig own = config;
    own.angles_known = angles_known;
    double direction = 0.0;
    double distance = 0.0;
    double worst_direction = 0.0;
    double worst_distance = 0.0;
    double predicted_direction = 0.0;
    double predicted_distance = 0.0;
    double squared = 0.0;
    const double begin = CpuSeconds();
    for (int run = 0; run < num_runs; ++run) {
      const auto seed = static_cast<unsigned>(run + 1);
      const auto stops = TableStops(36, 360.0);
      const auto views =
          scene.TargetsAt(AnglesOfStops(stops), config.sigma_wobble_deg * kRadPerDeg,
                          1e-3 * config.sigma_runout_mm, config.sigma_angle_deg * kRadPerDeg, seed);
      SceneNoise noise;
      noise.seed = seed;
      const auto result = Value(
          CalibrateTurntable(stops, SightAll(cell, target, views, noise), {target, cell}, own));
      const AxisError error = ErrorOfAxis(scene, result);
      direction += error.direction_rad * error.direction_rad;
      distance += error.distance_m * error.distance_m;
      worst_direction = std::max(worst_direction, error.direction_rad);
      worst_distance = std::max(worst_distance, error.distance_m);
      predicted_direction += 2.0 * result.sigma_direction_rad * result.sigma_direction_rad;
      predicted_distance += 2.0 * result.sigma_point_m * result.sigma_point_m;
      // The four numbers of the axis in the frame found: rotation and shift across z.
      const Transform T_found_true = result.T_camera_base.inverse() * scene.T_camera_base;
      const Eigen::Vector3d axis = T_found_true.linear().col(2);
      const Eigen::Vector3d origin =
          T_found_true.translation() - axis * T_found_true.translation().z() / axis.z();
      Eigen::Vector4d e(-axis.y(), axis.x(), origin.x(), origin.y());
      Eigen::Matrix4d covariance;
      constexpr std::array<int, 4> kAcross = {0, 1, 3, 4};
      for (int i = 0; i < 4; ++i) {
        for (int j = 0; j < 4; ++j) {
          covariance(i, j) = result.covariance_base(kAcross[static_cast<std::size_t>(i)],
                                                    kAcross[static_cast<std::size_t>(j)]);
        }
      }
      squared += e.dot(Eigen::Vector4d(dense::SolveSymmetric(covariance, e)));
    }
    fmt::print(
        "turntable, angles {}, {} runs of 36 stops: direction {:.5f} deg rms (worst {:.5f}), place "
        "{:.5f} mm rms (worst {:.5f}), over predicted {:.3f} and {:.3f}; squared error over stated "
        "{:.3f} ({} numbers); {:.2f} s of CPU a run\n",
        angles_known ? "known" : "free", num_runs, std::sqrt(direction / num_runs) / kRadPerDeg,
        worst_direction / kRadPerDeg, 1e3 * std::sqrt(distance / num_runs), 1e3 * worst_distance,
        std::sqrt(direction / predicted_direction), std::sqrt(distance / predicted_distance),
        squared / (4.0 * num_runs), 4 * num_runs, (CpuSeconds() - begin) / num_runs);
  }
}

/// Standard deviation per axis and rms distance of the target's middle from its mean, as every pose
/// puts it into the base.
struct Spread {
  Eigen::Vector3d axes_mm = Eigen::Vector3d::Zero();
  double distance_mm = 0.0;
};

Spread SpreadOf(const Transform& T_flange_camera, const std::vector<Transform>& T_base_flange,
                const std::vector<Transform>& T_camera_target, const Eigen::Vector3d& middle) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> seen;
  for (std::size_t k = 0; k < T_base_flange.size(); ++k) {
    seen.emplace_back(T_base_flange[k] * (T_flange_camera * (T_camera_target[k] * middle)));
    mean += seen.back() / static_cast<double>(T_base_flange.size());
  }
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : seen) sum += (point - mean).cwiseAbs2();
  sum /= static_cast<double>(seen.size());
  return {1e3 * sum.cwiseSqrt(), 1e3 * std::sqrt(sum.sum())};
}

void PrintSpread(const std::string& name, const Spread& spread, const Transform& T) {
  fmt::print(
      "  {}: spread {:.2f} {:.2f} {:.2f} mm, distance {:.2f} mm; translation {:.4f} {:.4f} "
      "{:.4f} m\n",
      name, spread.axes_mm.x(), spread.axes_mm.y(), spread.axes_mm.z(), spread.distance_mm,
      T.translation().x(), T.translation().y(), T.translation().z());
}

void StudyBoard(const std::vector<DevicePose>& robot, const std::vector<TargetSighting>& sightings,
                const TargetView& view, const HandEyeConfig& config) {
  const Eigen::Vector3d middle = Middle(view.target);
  const auto result =
      Value(CalibrateHandEye(robot, sightings, view, HandEyeMount::kEyeInHand, config));
  fmt::print("lens {}\n", config.refine_lens > 0 ? "found along" : "as stated");
  std::vector<Transform> T_base_flange;
  std::vector<Transform> T_camera_target;
  for (std::size_t k = 0; k < robot.size(); ++k) {
    const DevicePoseOutcome& pose = result.poses[k];
    fmt::print("    {}: {} {:.3f} deg {:.3f} mm, {} points, rms {:.3f} px {}\n", pose.name,
               pose.used ? "in" : "out", pose.rotation_miss_rad / kRadPerDeg,
               1e3 * pose.translation_miss_m, pose.num_points, pose.rms_px, pose.reason);
    T_base_flange.push_back(robot[k].T_base_flange);
    T_camera_target.push_back(pose.T_camera_target);
  }
  const auto print = [&](const std::string& name, const Transform& T) {
    PrintSpread(name, SpreadOf(T, T_base_flange, T_camera_target, middle), T);
  };
  const Vector6d sigma = result.covariance_camera.diagonal().cwiseSqrt();
  fmt::print(
      "  +- {:.2f} {:.2f} {:.2f} mm, {:.3f} {:.3f} {:.3f} deg; robot {:.1f} / {:.1f} times its "
      "stated sigma, points {:.1f} times\n  {}\n",
      1e3 * sigma[3], 1e3 * sigma[4], 1e3 * sigma[5], sigma[0] / kRadPerDeg, sigma[1] / kRadPerDeg,
      sigma[2] / kRadPerDeg, result.sigma_scale_rotation, result.sigma_scale_translation,
      result.sigma_scale_target, result.verdict.words);
  const CameraModel& lens = result.camera;
  fmt::print("  lens fx {:.2f} +- {:.2f}, fy {:.2f}, cx {:.2f}, cy {:.2f}, k1 {:.4f} k2 {:.4f}\n",
             lens.fx, result.sigma_camera[0], lens.fy, lens.cx, lens.cy, lens.distortion[0],
             lens.distortion[1]);
  print("ours, all poses", result.T_carrier_camera);
  print("own Park-Martin", result.T_carrier_camera_park_martin);
  print("own dual quaternions", result.T_carrier_camera_dual_quaternion);
  for (const Method& method : kMethods) {
    print(std::string("OpenCV ") + method.name,
          ByOpenCv(T_base_flange, T_camera_target, method.method));
  }
}

void StudyReal(const std::string& folder) {
  const auto file = Value(LoadRobotPoses(folder + "/robot_poses.yaml"));
  const TargetView view{Value(LoadTarget(folder + "/target.yaml")),
                        Value(ReadRig(folder + "/cell.yaml"))};
  std::vector<DevicePose> robot;
  std::vector<TargetSighting> sightings;
  for (const RobotStation& station : file.stations) {
    const auto sighting =
        DetectTarget(GreyPicture(Value(ReadGrayImage(station.image))), view.target, DetectConfig{});
    if (!sighting) {
      fmt::print("{}: {}\n", station.pose.name, sighting.error().message);
      continue;
    }
    sightings.push_back(*sighting);
    sightings.back().name = station.pose.name;
    robot.push_back(station.pose);
  }
  for (const int refine_lens : {0, 1, 3}) {
    HandEyeConfig config;
    config.refine_lens = refine_lens;
    StudyBoard(robot, sightings, view, config);
  }
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  const std::string part = argc > 1 ? argv[1] : "";
  const auto num_runs = [&](int by_default) { return argc > 2 ? std::stoi(argv[2]) : by_default; };
  try {
    if (part == "nees") fringe_fusion::StudyNees(num_runs(400));
    if (part == "lever") fringe_fusion::StudyLever(num_runs(340));
    if (part == "table") fringe_fusion::StudyTable(num_runs(100));
    if (part == "real" && argc > 2) fringe_fusion::StudyReal(argv[2]);
  } catch (const std::exception& error) {
    fmt::print(stderr, "hand_eye_study: {}\n", error.what());
    return 1;
  }
  return 0;
}
