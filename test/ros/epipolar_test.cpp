// Health of the calibration on /diagnostics and the epipolar services, in a cell that agrees with
// its calibration (Healthy) and in one whose projector has turned (Turned).
#include <diagnostic_msgs/DiagnosticArray.h>
#include <fringe_fusion/SelfCalibrate.h>
#include <fringe_fusion/SolveRelativePose.h>
#include <fringe_fusion/SolveViewPose.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <Eigen/Eigenvalues>
#include <limits>
#include <mutex>
#include <optional>

#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/picture_messages.hpp"
#include "fringe_fusion/ros_io/service_call.hpp"
#include "fringe_fusion/ros_io/tf_lookup.hpp"
#include "test/ros/cell_support.hpp"

namespace fringe_fusion {
namespace {

constexpr double kTimeout_s = 200.0;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The last status "calibration" of pose_node.
class Diagnostics {
 public:
  Diagnostics() {
    subscriber_ = nh_.subscribe<diagnostic_msgs::DiagnosticArray>(
        "/diagnostics", 100, [this](const diagnostic_msgs::DiagnosticArray::ConstPtr& message) {
          for (const auto& status : message->status) {
            if (status.name.find("pose_node: calibration") == std::string::npos) continue;
            const std::lock_guard<std::mutex> lock(mutex_);
            last_ = status;
          }
        });
  }
  [[nodiscard]] diagnostic_msgs::DiagnosticStatus Last() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return last_;
  }
  [[nodiscard]] std::string Value(const std::string& key) {
    for (const auto& pair : Last().values) {
      if (pair.key == key) return pair.value;
    }
    return "";
  }

 private:
  ros::NodeHandle nh_;
  std::mutex mutex_;
  diagnostic_msgs::DiagnosticStatus last_;
  ros::Subscriber subscriber_;
};

/// One view scanned and judged; shared by the tests of this program.
struct Judged {
  std::string failure;
  Diagnostics diagnostics;
  std::optional<Image<float>> residual_px;
};

Judged& JudgeOneView() {
  static auto* judged = [] {
    auto* out = new Judged;
    std::mutex mutex;
    ros::NodeHandle nh;
    const ros::Subscriber residual = nh.subscribe<sensor_msgs::Image>(
        "epipolar_residual/image", 2, [&](const sensor_msgs::Image::ConstPtr& message) {
          const auto image = ros_io::FloatImageFromMessage(*message, "residual");
          const std::lock_guard<std::mutex> lock(mutex);
          if (image) out->residual_px = *image;
        });
    test::MoveClient move("move_to_view", true);
    test::ScanViewClient scan("scan_view", true);
    const bool ready = test::WaitForCell(kTimeout_s) &&
                       test::WaitFor(
                           [&] {
                             return move.isServerConnected() && scan.isServerConnected() &&
                                    residual.getNumPublishers() > 0;
                           },
                           kTimeout_s);
    if (!ready) {
      out->failure = "the cell is not ready";
      return out;
    }
    MoveToViewGoal stop;
    stop.joint_positions = {0.7};
    move.sendGoal(stop);
    ScanViewGoal goal;
    goal.scan_id = "judged";
    goal.view_id = 3;
    if (test::WaitForEnd(move, kTimeout_s) == "SUCCEEDED") scan.sendGoal(goal);
    if (test::WaitForEnd(scan, kTimeout_s) != "SUCCEEDED") out->failure = "the scan failed";
    const bool told = test::WaitFor(
        [&] {
          const std::lock_guard<std::mutex> lock(mutex);
          return out->residual_px &&
                 out->diagnostics.Value("view").find("judged") != std::string::npos;
        },
        kTimeout_s);
    if (!told) out->failure += " no diagnostics or no residual";
    return out;
  }();
  return *judged;
}

CellCalibration Calibration(const std::string& node) {
  std::string file;
  EXPECT_TRUE(ros::param::get(node + "/calibration_file", file));
  const auto calibration = ReadCellCalibration(file);
  EXPECT_TRUE(calibration) << calibration.error().message;
  return *calibration;
}

template <typename Service>
Result<typename Service::Response> Call(const std::string& name,
                                        const typename Service::Request& request) {
  return ros_io::CallService<Service>(ros::NodeHandle(), name, request, kTimeout_s);
}

/// Squared error of a pose against the truth in its own standard deviations, over the directions
/// that have one (the length of the baseline has none), per degree of freedom.
double Nees(const geometry_msgs::PoseWithCovariance& message, const Transform& truth) {
  const auto pose = ros_io::FromMessage(message, "epipolar");
  EXPECT_TRUE(pose) << pose.error().message;
  const Vector6d error = Log(pose->T_object_camera.inverse() * truth);
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(pose->covariance);
  double sum = 0.0;
  int dof = 0;
  for (Eigen::Index k = 0; k < 6; ++k) {
    if (!(eigen.eigenvalues()[k] > 1e-9 * eigen.eigenvalues()[5])) continue;
    sum += std::pow(eigen.eigenvectors().col(k).dot(error), 2) / eigen.eigenvalues()[k];
    ++dof;
  }
  EXPECT_GE(dof, 5);
  return sum / dof;
}

SolveRelativePose::Request PoseRequest() {
  SolveRelativePose::Request request;
  request.scan_id = "judged";
  request.view_ids = {3};
  request.timeout = ros::Duration(20.0);
  return request;
}

TEST(Healthy, IsOkOnDiagnosticsWithItsNumber) {
  Judged& judged = JudgeOneView();
  ASSERT_EQ(judged.failure, "");
  const auto status = judged.diagnostics.Last();
  EXPECT_EQ(status.level, diagnostic_msgs::DiagnosticStatus::OK) << status.message;
  EXPECT_NE(status.message.find("systematic distance to the epipolar lines"), std::string::npos)
      << status.message;
  EXPECT_LT(std::stod(judged.diagnostics.Value("systematic [px]")), 0.15);
  EXPECT_EQ(judged.diagnostics.Value("calibration"), CalibrationId(Calibration("scanner_node")));
  EXPECT_NE(judged.diagnostics.Value("drift").find("a trend needs 3"), std::string::npos);
  const CameraModel& camera = Calibration("scanner_node").camera;
  ASSERT_TRUE(judged.residual_px);
  EXPECT_EQ(judged.residual_px->width(), camera.width);
  EXPECT_EQ(judged.residual_px->height(), camera.height);
}

TEST(Healthy, RelativePoseIsTheTrueOneWithinItsCovariance) {
  ASSERT_EQ(JudgeOneView().failure, "");
  tf2_ros::Buffer buffer;
  const tf2_ros::TransformListener listener(buffer);
  const auto answer = Call<SolveRelativePose>("estimate_relative_pose", PoseRequest());
  ASSERT_TRUE(answer) << answer.error().message;
  const Transform truth = Calibration("cell_sim_node").T_projector_camera.inverse();
  EXPECT_EQ(answer->pose.header.frame_id, "camera_optical_frame");
  EXPECT_LT(Nees(answer->pose.pose, truth), 5.0);
  EXPECT_GT(answer->num_inliers, 1000U);
  EXPECT_LT(answer->rotation_change, 0.1 * M_PI / 180.0);
  const auto estimated = ros_io::LookupTransform(
      buffer, {"camera_optical_frame", "projector_optical_frame_estimated", ros::Time(0)}, 5.0);
  ASSERT_TRUE(estimated) << estimated.error().message;
  const auto told = ros_io::FromMessage(answer->pose.pose.pose);
  ASSERT_TRUE(told);
  EXPECT_TRUE(estimated->isApprox(*told, 1e-9));
}

TEST(Healthy, SelfCalibrationFindsTheProjectorsFocalLength) {
  ASSERT_EQ(JudgeOneView().failure, "");
  SelfCalibrate::Request request;
  request.layout = "rig";
  request.projector.focal_ratio = kInfinity;
  const auto answer = Call<SelfCalibrate>("self_calibrate", request);
  ASSERT_TRUE(answer) << answer.error().message;
  const double truth = Calibration("cell_sim_node").projector.fx;
  EXPECT_EQ(answer->camera_sigma.focal_ratio, 0.0);
  EXPECT_GT(answer->projector_sigma.focal_ratio, 0.0);
  EXPECT_NEAR(answer->projector_info.K[0] / truth, 1.0, 5.0 * answer->projector_sigma.focal_ratio);
  ASSERT_EQ(answer->poses.size(), 1U);

  request.layout = "projector_fixed";
  request.projector.focal_ratio = 0.0;
  const auto stations = Call<SelfCalibrate>("self_calibrate", request);
  ASSERT_TRUE(stations) << stations.error().message;
  ASSERT_EQ(stations->poses.size(), 1U);
  EXPECT_EQ(stations->frame_id, "projector_optical_frame");
  EXPECT_LT(Nees(stations->poses[0], Calibration("cell_sim_node").T_projector_camera), 5.0);
}

TEST(Healthy, ViewPoseIsWhereTheCameraStands) {
  ASSERT_EQ(JudgeOneView().failure, "");
  // The cell's own projector in the part of the one at rest: the truth is the calibration.
  const CellCalibration cell = Calibration("cell_sim_node");
  SolveViewPose::Request request;
  request.view_id = 3;
  request.code_scan_id = "judged";
  request.code_view_id = 3;
  request.timeout = ros::Duration(20.0);
  request.projector_info = ros_io::ToMessage(cell.projector);
  request.projector_info.header.frame_id = "projector_at_rest";
  const auto answer = Call<SolveViewPose>("estimate_view_pose", request);
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(answer->pose.header.frame_id, "projector_at_rest");
  const auto pose = ros_io::FromMessage(answer->pose.pose.pose);
  ASSERT_TRUE(pose);
  const Vector6d error = Log(pose->inverse() * cell.T_projector_camera);
  EXPECT_LT(error.head<3>().norm(), 0.05 * M_PI / 180.0);
  EXPECT_LT(error.tail<3>().norm(), 0.5e-3);
}

TEST(Healthy, RefusalsAreWordsAndNeverAnIdentity) {
  ASSERT_EQ(JudgeOneView().failure, "");
  SolveRelativePose::Request request = PoseRequest();
  request.timeout = ros::Duration(0.1);
  request.view_ids = {3, 77};
  SolveRelativePose::Response response;
  ASSERT_TRUE(ros::service::call("estimate_relative_pose", request, response));
  EXPECT_EQ(response.success, 0);
  EXPECT_NE(response.message.find("no codes of view 77 of scan 'judged'"), std::string::npos)
      << response.message;
  EXPECT_EQ(response.pose.pose.pose.orientation.w, 0.0);
  request = PoseRequest();
  request.baseline = -0.2;
  ASSERT_TRUE(ros::service::call("estimate_relative_pose", request, response));
  EXPECT_EQ(response.success, 0);
  EXPECT_NE(response.message.find("baseline -0.2 m must be positive"), std::string::npos)
      << response.message;
  SelfCalibrate::Request calibrate;
  const auto refusal = [&calibrate] {
    SelfCalibrate::Response answer;
    EXPECT_TRUE(ros::service::call("self_calibrate", calibrate, answer));
    EXPECT_EQ(answer.success, 0);
    EXPECT_TRUE(answer.poses.empty());
    return answer.message;
  };
  calibrate.layout = "both_moving";
  EXPECT_NE(refusal().find("must be rig, projector_fixed or camera_fixed"), std::string::npos);
  calibrate.layout = "rig";
  EXPECT_NE(refusal().find("both focal lengths are held"), std::string::npos);
  calibrate.camera.principal = kInfinity;
  EXPECT_NE(refusal().find("more stations"), std::string::npos);
  SolveViewPose::Request place;
  place.code_scan_id = "judged";
  place.code_view_id = 3;
  SolveViewPose::Response nowhere;
  ASSERT_TRUE(ros::service::call("estimate_view_pose", place, nowhere));
  EXPECT_EQ(nowhere.success, 0);
  EXPECT_NE(nowhere.message.find("projector_info"), std::string::npos) << nowhere.message;
}

TEST(Turned, ProjectorIsNamedOnDiagnostics) {
  Judged& judged = JudgeOneView();
  ASSERT_EQ(judged.failure, "");
  const auto status = judged.diagnostics.Last();
  EXPECT_EQ(status.level, diagnostic_msgs::DiagnosticStatus::ERROR) << status.message;
  EXPECT_NE(status.message.find("the projector has turned by 0.3"), std::string::npos)
      << status.message;
  EXPECT_EQ(judged.diagnostics.Value("moved device"), "projector");
  // sqrt(.1^2 + .1^2 + .3^2) deg
  EXPECT_NEAR(std::stod(judged.diagnostics.Value("turn [deg]")), 0.332, 0.03);
}

TEST(Turned, RelativePoseIsTheTrueOneAndSaysWhatMoved) {
  ASSERT_EQ(JudgeOneView().failure, "");
  const auto answer = Call<SolveRelativePose>("estimate_relative_pose", PoseRequest());
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(answer->moved_device, "projector");
  EXPECT_LT(Nees(answer->pose.pose, Calibration("cell_sim_node").T_projector_camera.inverse()),
            5.0);
}

TEST(Turned, NothingIsLeftAfterAReset) {
  ASSERT_EQ(JudgeOneView().failure, "");
  ASSERT_TRUE(Call<std_srvs::Trigger>("pose_node/reset", std_srvs::Trigger::Request()));
  SolveRelativePose::Request request;
  const auto answer = Call<SolveRelativePose>("estimate_relative_pose", request);
  ASSERT_FALSE(answer);
  EXPECT_NE(answer.error().message.find("no view with codes has come yet"), std::string::npos)
      << answer.error().message;
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "epipolar_test");
  const ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
