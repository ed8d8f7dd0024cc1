// calibration_node in the simulated cell: poses of a target by the scanner, solve, accept; against
// the geometry that the simulation has and the nodes do not know. The tests go on from each other.
#include <fringe_fusion/CalibrateCellAction.h>
#include <fringe_fusion/SimPlace.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <visualization_msgs/MarkerArray.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <mutex>

#include "fringe_fusion/calibration/error_field.hpp"
#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/service_call.hpp"
#include "fringe_fusion/ros_io/tf_lookup.hpp"
#include "test/ros/cell_support.hpp"

namespace fringe_fusion {
namespace {

constexpr double kTimeout_s = 60.0;
constexpr double kDeg = 3.14159265358979323846 / 180.0;
using Client = actionlib::SimpleActionClient<CalibrateCellAction>;

/// The last message of a topic.
template <typename Message>
class Last {
 public:
  explicit Last(const std::string& topic) {
    subscriber_ = nh_.subscribe<Message>(topic, 2, [this](const typename Message::ConstPtr& m) {
      const std::lock_guard<std::mutex> lock(mutex_);
      message_ = m;
    });
  }
  [[nodiscard]] typename Message::ConstPtr Get() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return message_;
  }

 private:
  ros::NodeHandle nh_;
  std::mutex mutex_;
  typename Message::ConstPtr message_;
  ros::Subscriber subscriber_;
};

/// What a step ended with.
struct Ended {
  std::string state;
  CalibrateCellResult result;
};

Ended RunStep(Client& client, const CalibrateCellGoal& goal) {
  client.sendGoal(goal);
  Ended ended;
  ended.state = test::WaitForEnd(client, kTimeout_s);
  if (client.getResult()) ended.result = *client.getResult();
  return ended;
}

CalibrateCellGoal Goal(const std::string& step, const std::string& pose = "") {
  CalibrateCellGoal goal;
  goal.step = step;
  goal.pose = pose;
  return goal;
}

/// Says why a step that must fail did.
std::string Refusal(Client& client, const CalibrateCellGoal& goal) {
  const Ended ended = RunStep(client, goal);
  EXPECT_EQ(ended.state, "ABORTED") << ended.result.message;
  EXPECT_FALSE(ended.result.success);
  return ended.result.message;
}

bool Says(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

class Calibration : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    ASSERT_TRUE(ros::param::get("calibration_node/calibration_file", file_));
    // A run before this one has replaced the guess.
    const auto guess = ReadFile(SOURCE_DIR "/test/ros/cell_small_rough.yaml");
    ASSERT_TRUE(guess) << guess.error().message;
    Overwrite(*guess);
    client_ = std::make_unique<Client>("calibrate_cell", true);
    tf_ = std::make_unique<tf2_ros::Buffer>();
    listener_ = std::make_unique<tf2_ros::TransformListener>(*tf_);
    const bool ready = test::WaitFor(
        [] {
          for (const char* name : {"cell_sim_node/place_target", "projector_node/show_pattern",
                                   "camera_node/capture", "scanner_node/reload_calibration"}) {
            if (!ros::service::exists(ros::names::resolve(name), false)) return false;
          }
          return client_->isServerConnected() &&
                 tf_->canTransform("object", "camera_optical_frame", ros::Time());
        },
        kTimeout_s);
    ASSERT_TRUE(ready);
    for (const char* node : {"camera_node", "projector_node", "scanner_node"}) {
      const auto reloaded = ros_io::CallService<std_srvs::Trigger>(
          ros::NodeHandle(), std::string(node) + "/reload_calibration", {}, kTimeout_s);
      ASSERT_TRUE(reloaded) << reloaded.error().message;
    }
  }
  static void TearDownTestSuite() {
    client_.reset();
    listener_.reset();
    tf_.reset();
  }

  static void Overwrite(const std::string& text) {
    ASSERT_TRUE(WriteAtomically(file_, [&text](std::ostream& stream) -> Status {
      stream << text;
      return {};
    }));
  }

  /// Puts the middle of the target at a place before the camera, tilted about an axis in its plane.
  static void Place(const Eigen::Vector3d& middle_camera, double tilt_deg, double axis_deg) {
    const Eigen::Vector3d axis(std::cos(axis_deg * kDeg), std::sin(axis_deg * kDeg), 0.0);
    Transform T_camera_target = Transform::Identity();
    T_camera_target.linear() = Eigen::AngleAxisd(tilt_deg * kDeg, axis).toRotationMatrix();
    const Eigen::Vector3d middle_target(0.054, 0.036, 0.0);
    T_camera_target.translation() = middle_camera - T_camera_target.linear() * middle_target;
    const auto T_object_camera =
        ros_io::LookupTransform(*tf_, {"object", "camera_optical_frame", ros::Time()}, kTimeout_s);
    ASSERT_TRUE(T_object_camera) << T_object_camera.error().message;
    SimPlace::Request request;
    request.pose = ros_io::ToPoseMessage(*T_object_camera * T_camera_target);
    const auto placed = ros_io::CallService<SimPlace>(
        ros::NodeHandle(), "cell_sim_node/place_target", request, kTimeout_s);
    ASSERT_TRUE(placed) << placed.error().message;
  }

  static std::string file_;
  static std::unique_ptr<Client> client_;
  static std::unique_ptr<tf2_ros::Buffer> tf_;
  static std::unique_ptr<tf2_ros::TransformListener> listener_;
};

std::string Calibration::file_;
std::unique_ptr<Client> Calibration::client_;
std::unique_ptr<tf2_ros::Buffer> Calibration::tf_;
std::unique_ptr<tf2_ros::TransformListener> Calibration::listener_;

TEST_F(Calibration, RefusesWhatCannotBeDone) {
  const std::string before = *ReadFile(file_);
  EXPECT_TRUE(Says(Refusal(*client_, Goal("solve")), "3 are needed"));
  EXPECT_TRUE(Says(Refusal(*client_, Goal("accept")), "solve first"));
  EXPECT_TRUE(Says(Refusal(*client_, Goal("remove_pose", "x")), "no pose to remove"));
  EXPECT_TRUE(Says(Refusal(*client_, Goal("fly")), "step 'fly' must be add_pose, remove_pose"));
  // The target is not in the picture.
  Place({0.0, 1.0, 0.5}, 0.0, 0.0);
  const std::string nothing = Refusal(*client_, Goal("add_pose", "nowhere"));
  EXPECT_TRUE(Says(nothing, "nowhere: ")) << nothing;
  EXPECT_EQ(*ReadFile(file_), before);
}

TEST_F(Calibration, CancelledPoseLeavesNoTrace) {
  Place({0.0, 0.0, 0.5}, 20.0, 30.0);
  std::atomic<bool> capturing{false};
  client_->sendGoal(Goal("add_pose"), {}, {}, [&](const CalibrateCellFeedbackConstPtr& feedback) {
    if (feedback->state == "capturing" && feedback->frame > 2) capturing = true;
  });
  ASSERT_TRUE(test::WaitFor([&] { return capturing.load(); }, kTimeout_s)) << "no feedback";
  client_->cancelGoal();
  EXPECT_EQ(test::WaitForEnd(*client_, kTimeout_s), "PREEMPTED");
  ASSERT_TRUE(client_->getResult());
  EXPECT_TRUE(client_->getResult()->calibration.poses.empty());
}

TEST_F(Calibration, PosesFillTheImagesAndTheNextOneIsSuggested) {
  struct Pose {
    Eigen::Vector3d middle;
    double tilt_deg;
    double axis_deg;
  };
  const std::vector<Pose> poses = {
      {{-0.02, -0.014, 0.50}, 25.0, 0.0}, {{0.02, -0.014, 0.49}, 25.0, 90.0},
      {{0.02, 0.014, 0.51}, 25.0, 180.0}, {{-0.02, 0.014, 0.50}, 25.0, 270.0},
      {{0.0, 0.0, 0.45}, 22.0, 45.0},     {{0.0, 0.0, 0.55}, 28.0, 225.0},
      {{0.025, 0.0, 0.53}, 25.0, 135.0},  {{-0.025, 0.0, 0.47}, 24.0, 315.0},
  };
  double coverage = 0.0;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    Place(poses[k].middle, poses[k].tilt_deg, poses[k].axis_deg);
    const Ended ended = RunStep(*client_, Goal("add_pose", "at " + std::to_string(k)));
    ASSERT_EQ(ended.state, "SUCCEEDED") << ended.result.message;
    const CalibrationState& state = ended.result.calibration;
    ASSERT_EQ(state.poses.size(), k + 1);
    EXPECT_EQ(state.poses.back().name, "at " + std::to_string(k));
    EXPECT_GE(state.poses.back().num_points_camera, 30U);
    EXPECT_GE(state.poses.back().num_points_projector, 25U);
    EXPECT_GE(state.coverage_camera, coverage);
    coverage = state.coverage_camera;
    EXPECT_FALSE(state.next_pose.empty());
    EXPECT_EQ(state.solved != 0, k >= 2) << state.verdict;
    if (k == 1) {
      EXPECT_TRUE(Says(Refusal(*client_, Goal("solve")), "2 of 2 poses are usable, 3 are needed"));
    }
  }
  EXPECT_GT(coverage, 0.5);
  EXPECT_TRUE(Says(Refusal(*client_, Goal("add_pose", "at 3")), "there is a pose 'at 3' already"));
  EXPECT_TRUE(Says(Refusal(*client_, Goal("accept")), "solve first"));
}

TEST_F(Calibration, SolutionLiesWithinItsSigmasOfTheTruth) {
  const std::string before = *ReadFile(file_);
  Last<CalibrationState> state("calibration_state");
  Last<visualization_msgs::MarkerArray> markers("calibration_markers");
  CalibrateCellGoal goal = Goal("solve");
  goal.report_folder = std::filesystem::path(file_).parent_path().string() + "/report";
  const Ended ended = RunStep(*client_, goal);
  ASSERT_EQ(ended.state, "SUCCEEDED") << ended.result.message;
  const CalibrationState& solved = ended.result.calibration;
  EXPECT_TRUE(solved.acceptable) << solved.verdict;
  EXPECT_EQ(ended.result.message, solved.verdict);
  EXPECT_TRUE(std::filesystem::exists(goal.report_folder + "/report.html"));
  EXPECT_EQ(*ReadFile(file_), before) << "in force before it is accepted";
  EXPECT_GT(solved.residuals.size(), 400U);
  ASSERT_TRUE(test::WaitFor([&] { return state.Get() && markers.Get(); }, kTimeout_s));
  EXPECT_EQ(state.Get()->calibration_id, solved.calibration_id);
  EXPECT_GE(markers.Get()->markers.size(), 4U);

  const auto truth = ReadCellCalibration(SOURCE_DIR "/test/ros/cell_small.yaml");
  ASSERT_TRUE(truth) << truth.error().message;
  const std::array<double, kNumCellParameters> exact = CellParameterValues(*truth);
  double squares = 0.0;
  int free = 0;
  // The pose of the projector is compared below: its sigmas are those of a perturbation.
  for (std::size_t k = 0; k < 18; ++k) {
    if (!(solved.sigmas.at(k) > 0.0)) continue;
    const double normalized = (solved.values.at(k) - exact[k]) / solved.sigmas[k];
    EXPECT_LT(std::abs(normalized), 5.0)
        << solved.parameters.at(k) << " " << solved.values[k] << ", true " << exact[k];
    squares += normalized * normalized;
    ++free;
  }
  ASSERT_GE(free, 8);
  RecordProperty("normalized_rms_percent", static_cast<int>(100.0 * std::sqrt(squares / free)));
  EXPECT_LT(std::sqrt(squares / free), 2.0);
}

TEST_F(Calibration, AcceptedCalibrationIsInForceInAllNodes) {
  Last<sensor_msgs::CameraInfo> projector_info("projector_info");
  const Ended ended = RunStep(*client_, Goal("accept"));
  ASSERT_EQ(ended.state, "SUCCEEDED") << ended.result.message;
  const auto cell = ReadCellCalibration(file_);
  ASSERT_TRUE(cell) << cell.error().message;
  EXPECT_TRUE(Says(ended.result.message, CalibrationId(*cell)));
  EXPECT_EQ(CalibrationId(*cell), ended.result.calibration.calibration_id);
  EXPECT_EQ(cell->camera_serial, "sim-camera");
  EXPECT_FALSE(cell->date.empty());
  const auto covariance = ReadCellCovariance(file_);
  ASSERT_TRUE(covariance) << covariance.error().message;
  ASSERT_TRUE(test::WaitFor(
      [&] { return projector_info.Get() && projector_info.Get()->K[0] == cell->projector.fx; },
      kTimeout_s));
  ASSERT_TRUE(test::WaitFor(
      [&] {
        const auto T = ros_io::LookupTransform(
            *tf_, {"projector_optical_frame", "camera_optical_frame", ros::Time()}, 1.0);
        return T && (T->matrix() - cell->T_projector_camera.matrix()).cwiseAbs().maxCoeff() < 1e-9;
      },
      kTimeout_s));
  const std::string info = std::filesystem::path(file_).parent_path().string() + "/info";
  EXPECT_TRUE(std::filesystem::exists(info + "/camera.yaml"));
  EXPECT_TRUE(std::filesystem::exists(info + "/projector.yaml"));

  // What it is for: points of the volume, against what was predicted for them.
  const auto truth = ReadCellCalibration(SOURCE_DIR "/test/ros/cell_small.yaml");
  ASSERT_TRUE(truth);
  const Vector6d turned = Log(truth->T_projector_camera.inverse() * cell->T_projector_camera);
  for (int k = 0; k < 6; ++k) {
    EXPECT_LT(std::abs(turned[k]), 5.0 * std::sqrt((*covariance)(18 + k, 18 + k))) << k;
  }
  double measured_m2 = 0.0;
  double predicted_m2 = 0.0;
  for (int i = 0; i < 27; ++i) {
    const Eigen::Vector3d point(0.04 * (i % 3 - 1), 0.03 * (i / 3 % 3 - 1),
                                0.5 + 0.03 * (i / 9 - 1));
    const auto found = TriangulatePixels(
        *cell, Project(truth->camera, point),
        Project(truth->projector, truth->T_projector_camera * point), MeasurementNoise{});
    const auto error = PredictPointError(*cell, *covariance, point, MeasurementNoise{});
    ASSERT_TRUE(found && error);
    measured_m2 += (*found - point).squaredNorm() / 81.0;
    predicted_m2 += error->calibration.trace() / 81.0;
  }
  RecordProperty("point_error_um", static_cast<int>(1e6 * std::sqrt(measured_m2)));
  RecordProperty("predicted_um", static_cast<int>(1e6 * std::sqrt(predicted_m2)));
  EXPECT_LT(std::sqrt(measured_m2 / predicted_m2), 2.5);
}

TEST_F(Calibration, EarlierCalibrationStaysWhenANodeRefuses) {
  const std::string before = *ReadFile(file_);
  Last<sensor_msgs::CameraInfo> projector_info("projector_info");
  const Ended removed = RunStep(*client_, Goal("remove_pose", "at 6"));
  ASSERT_EQ(removed.state, "SUCCEEDED") << removed.result.message;
  EXPECT_EQ(removed.result.calibration.poses.size(), 7U);
  EXPECT_TRUE(Says(Refusal(*client_, Goal("accept")), "solve first")) << "the poses have changed";
  ASSERT_EQ(RunStep(*client_, Goal("solve")).state, "SUCCEEDED");
  // The scanner is at work with a view.
  test::ScanViewClient scan("scan_view", true);
  ASSERT_TRUE(test::WaitFor([&] { return scan.isServerConnected(); }, kTimeout_s));
  std::atomic<bool> capturing{false};
  scan.sendGoal(ScanViewGoal(), {}, {}, [&](const ScanViewFeedbackConstPtr& feedback) {
    if (feedback->state == "capturing") capturing = true;
  });
  ASSERT_TRUE(test::WaitFor([&] { return capturing.load(); }, kTimeout_s));
  const std::string words = Refusal(*client_, Goal("accept"));
  EXPECT_TRUE(Says(words, "the earlier calibration stays in force")) << words;
  EXPECT_TRUE(Says(words, "the scanner is busy with a view")) << words;
  EXPECT_EQ(*ReadFile(file_), before);
  const auto cell = ReadCellCalibration(file_);
  ASSERT_TRUE(cell);
  EXPECT_TRUE(test::WaitFor(
      [&] { return projector_info.Get() && projector_info.Get()->K[0] == cell->projector.fx; },
      kTimeout_s))
      << "the projector keeps what was refused";
  EXPECT_EQ(test::WaitForEnd(scan, kTimeout_s), "SUCCEEDED");
  ASSERT_EQ(RunStep(*client_, Goal("reset")).state, "SUCCEEDED");
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "calibration_test");
  const ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
