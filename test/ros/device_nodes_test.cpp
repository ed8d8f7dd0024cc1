// The device nodes over ROS: names, answers, failures in words, and what the simulated cell shows.
#include <actionlib/client/simple_action_client.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <fringe_fusion/Capture.h>
#include <fringe_fusion/LoadSequence.h>
#include <fringe_fusion/MoveToViewAction.h>
#include <fringe_fusion/ShowPattern.h>
#include <fringe_fusion/SimExpose.h>
#include <fringe_fusion/SimProject.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/JointState.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <memory>
#include <mutex>

#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/pattern_messages.hpp"
#include "fringe_fusion/sim/gauges.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"

namespace fringe_fusion {
namespace {

using MoveClient = actionlib::SimpleActionClient<MoveToViewAction>;

const ros::Duration kPatience(20.0);

Transform CameraAtZero() {
  return sim::TurntablePose(0, 1, 0.5, 30.0, Eigen::Vector3d(0.0, 0.0, 0.02));
}

CellCalibration Calibration() {
  return ReadCellCalibration(std::string(SOURCE_DIR) + "/config/cell_sim/cell.yaml").value();
}

template <typename Service>
typename Service::Response Call(const std::string& name, const typename Service::Request& request) {
  EXPECT_TRUE(ros::service::waitForService(name, kPatience)) << name;
  typename Service::Request sent = request;
  typename Service::Response response;
  EXPECT_TRUE(ros::service::call(name, sent, response)) << name;
  return response;
}

PatternSequence Sequence(int width, int height) {
  PatternConfig config;
  config.fringes = "1,16";
  return MakeSequence(config, width, height).value();
}

void Load(const std::string& projector, const PatternSequence& sequence) {
  LoadSequence::Request request;
  request.sequence = ros_io::ToMessage(sequence);
  const auto response = Call<LoadSequence>(projector + "/load_sequence", request);
  ASSERT_TRUE(response.success) << response.message;
}

ShowPattern::Response Show(const std::string& projector, std::uint32_t index) {
  ShowPattern::Request request;
  request.index = index;
  return Call<ShowPattern>(projector + "/show_pattern", request);
}

Capture::Response CaptureBy(const std::string& camera, double timeout_s) {
  Capture::Request request;
  request.timeout = ros::Duration(timeout_s);
  return Call<Capture>(camera + "/capture", request);
}

double ShareOfDifferingBytes(const std::vector<std::uint8_t>& a,
                             const std::vector<std::uint8_t>& b) {
  if (a.size() != b.size() || a.empty()) return 1.0;
  std::size_t num_differing = 0;
  for (std::size_t i = 0; i < a.size(); ++i) num_differing += a[i] != b[i] ? 1 : 0;
  return static_cast<double>(num_differing) / static_cast<double>(a.size());
}

// What the cell shows at a joint position under a pattern, rendered here from the same description.
std::vector<std::uint8_t> Rendered(double joint_rad, const Pattern& pattern) {
  const CellCalibration calibration = Calibration();
  auto cell = sim::SimCell::Create(sim::SimConfig(), calibration,
                                   sim::MakeObject("step_block").value(), sim::MakePlate(0.1, 0.01))
                  .value();
  Transform T_object_cell = Transform::Identity();
  T_object_cell.rotate(Eigen::AngleAxisd(-joint_rad, Eigen::Vector3d::UnitZ()));
  EXPECT_TRUE(cell.MoveTo(T_object_cell * CameraAtZero(), 0));
  const CameraModel& projector = calibration.projector;
  const auto frame =
      cell.Expose(RenderPattern(pattern, projector.width, projector.height, 1.0), 0.02, 0);
  const auto& image = std::get<Image<std::uint8_t>>(frame.value().pixels);
  return {image.begin(), image.end()};
}

// Keeps the last picture of image_raw; pictures without a listener are not sent.
class PictureListener {
 public:
  explicit PictureListener(ros::NodeHandle& nh)
      : subscriber_(nh.subscribe("image_raw", 10, &PictureListener::OnPicture, this)) {
    const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(10.0);
    while (subscriber_.getNumPublishers() == 0 && ros::WallTime::now() < deadline) {
      ros::WallDuration(0.01).sleep();
    }
  }

  sensor_msgs::ImageConstPtr Wait(const ros::Time& stamp) {
    std::unique_lock<std::mutex> lock(mutex_);
    const auto has_come = [&] { return picture_ && picture_->header.stamp == stamp; };
    return come_.wait_for(lock, std::chrono::seconds(10), has_come) ? picture_ : nullptr;
  }

 private:
  void OnPicture(const sensor_msgs::ImageConstPtr& picture) {
    const std::lock_guard<std::mutex> lock(mutex_);
    picture_ = picture;
    come_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable come_;
  sensor_msgs::ImageConstPtr picture_;
  ros::Subscriber subscriber_;
};

void MoveTo(double joint_rad) {
  MoveClient client("move_to_view", true);
  ASSERT_TRUE(client.waitForServer(kPatience));
  MoveToViewGoal goal;
  goal.joint_positions = {joint_rad};
  client.sendGoalAndWait(goal, kPatience);
  ASSERT_EQ(client.getState().state_, actionlib::SimpleClientGoalState::SUCCEEDED)
      << client.getResult()->message;
}

TEST(ProjectorNode, LatchesItsLensModel) {
  ros::NodeHandle nh;
  const auto message =
      ros::topic::waitForMessage<sensor_msgs::CameraInfo>("projector_info", nh, kPatience);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->header.frame_id, "projector_optical_frame");
  const CameraModel expected = Calibration().projector;
  const Result<CameraModel> model = ros_io::FromMessage(*message, "projector_info");
  ASSERT_TRUE(model);
  EXPECT_EQ(model->width, expected.width);
  EXPECT_EQ(model->fx, expected.fx);
  EXPECT_EQ(model->distortion, expected.distortion);
}

TEST(ProjectorNode, RefusesInWords) {
  LoadSequence::Request request;
  request.sequence = ros_io::ToMessage(Sequence(640, 480));
  const auto refused = Call<LoadSequence>("projector_node/load_sequence", request);
  EXPECT_FALSE(refused.success);
  EXPECT_NE(refused.message.find("640 x 480 px"), std::string::npos) << refused.message;
  EXPECT_NE(refused.message.find("1280 x 800 px"), std::string::npos) << refused.message;
  const auto unloaded = Show("projector_node", 0);
  EXPECT_FALSE(unloaded.success);
  EXPECT_NE(unloaded.message.find("no sequence is loaded"), std::string::npos);
  const PatternSequence sequence = Sequence(1280, 800);
  ASSERT_NO_FATAL_FAILURE(Load("projector_node", sequence));
  const auto beyond = Show("projector_node", static_cast<std::uint32_t>(sequence.frames.size()));
  EXPECT_FALSE(beyond.success);
  EXPECT_NE(beyond.message.find("must be below 18"), std::string::npos) << beyond.message;
  EXPECT_TRUE(Show("projector_node", 0).success);
}

TEST(ProjectorNode, SendsThePictureUnchanged) {
  const PatternSequence sequence = Sequence(1280, 800);
  ASSERT_NO_FATAL_FAILURE(Load("fake/projector_node", sequence));
  const auto missing = Show("fake/projector_node", 3);
  EXPECT_FALSE(missing.success);
  EXPECT_NE(missing.message.find("/fake/device/project was not found within 1 s"),
            std::string::npos)
      << missing.message;

  ros::NodeHandle nh;
  sensor_msgs::Image shown;
  boost::function<bool(SimProject::Request&, SimProject::Response&)> handler =
      [&shown](SimProject::Request& request, SimProject::Response& response) {
        shown = request.picture;
        response.success = 1;
        return true;
      };
  const ros::ServiceServer server = nh.advertiseService("fake/device/project", handler);
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const auto response = Show("fake/projector_node", static_cast<std::uint32_t>(i));
    ASSERT_TRUE(response.success) << response.message;
    const Image<std::uint8_t> expected = RenderPattern(sequence.frames[i], 1280, 800, 2.2);
    EXPECT_EQ(shown.encoding, "mono8");
    EXPECT_EQ(shown.width, 1280U);
    EXPECT_EQ(shown.data, std::vector<std::uint8_t>(expected.begin(), expected.end())) << i;
  }
}

TEST(CameraNode, CapturesWhatTheProjectorLights) {
  ros::NodeHandle nh;
  PictureListener pictures(nh);
  const PatternSequence sequence = Sequence(1280, 800);
  ASSERT_NO_FATAL_FAILURE(MoveTo(0.0));
  ASSERT_NO_FATAL_FAILURE(Load("projector_node", sequence));
  for (const std::uint32_t index : {0U, 1U, 7U}) {
    ASSERT_TRUE(Show("projector_node", index).success);
    const ros::Time before = ros::Time::now();
    const auto captured = CaptureBy("camera_node", 20.0);
    ASSERT_TRUE(captured.success) << captured.message;
    EXPECT_GE(captured.image.header.stamp, before + ros::Duration(0.5 * 0.02));
    EXPECT_LE(captured.image.header.stamp, ros::Time::now() - ros::Duration(0.5 * 0.02));
    EXPECT_EQ(captured.image.header.frame_id, "camera_optical_frame");
    EXPECT_EQ(captured.bit_depth, 8U);
    EXPECT_EQ(captured.exposure, 0.02);
    EXPECT_LT(ShareOfDifferingBytes(captured.image.data, Rendered(0.0, sequence.frames[index])),
              1e-3);
    const sensor_msgs::ImageConstPtr published = pictures.Wait(captured.image.header.stamp);
    ASSERT_TRUE(published);
    EXPECT_EQ(published->data, captured.image.data);
    const auto info =
        ros::topic::waitForMessage<sensor_msgs::CameraInfo>("camera_info", nh, kPatience);
    ASSERT_TRUE(info);
    EXPECT_EQ(info->header.stamp, captured.image.header.stamp);
    EXPECT_EQ(info->K[0], Calibration().camera.fx);
  }
}

TEST(CameraNode, SeesTheObjectTurn) {
  const PatternSequence sequence = Sequence(1280, 800);
  ASSERT_NO_FATAL_FAILURE(Load("projector_node", sequence));
  ASSERT_TRUE(Show("projector_node", 9).success);
  ASSERT_NO_FATAL_FAILURE(MoveTo(0.4));
  const auto captured = CaptureBy("camera_node", 20.0);
  ASSERT_TRUE(captured.success) << captured.message;
  EXPECT_LT(ShareOfDifferingBytes(captured.image.data, Rendered(0.4, sequence.frames[9])), 1e-3);
  EXPECT_GT(ShareOfDifferingBytes(captured.image.data, Rendered(0.0, sequence.frames[9])), 0.1);

  ros::NodeHandle nh;
  const auto truth = ros::topic::waitForMessage<geometry_msgs::PoseStamped>(
      "cell_sim_node/truth/pose", nh, kPatience);
  ASSERT_TRUE(truth);
  Transform expected = Transform::Identity();
  expected.rotate(Eigen::AngleAxisd(-0.4, Eigen::Vector3d::UnitZ()));
  const Transform T_object_camera = ros_io::FromMessage(truth->pose).value();
  EXPECT_TRUE(T_object_camera.isApprox(expected * CameraAtZero(), 1e-9));
}

TEST(CameraNode, GivesTheSamePicturesOverGigeVision) {
  const PatternSequence sequence = Sequence(1280, 800);
  ASSERT_NO_FATAL_FAILURE(MoveTo(0.0));
  ASSERT_NO_FATAL_FAILURE(Load("projector_node", sequence));
  ros::Time last;
  for (std::uint32_t index = 0; index < sequence.frames.size(); ++index) {
    ASSERT_TRUE(Show("projector_node", index).success);
    const ros::Time before = ros::Time::now();
    const auto over_network = CaptureBy("gige/camera_node", 20.0);
    ASSERT_TRUE(over_network.success) << over_network.message;
    const ros::Time stamp = over_network.image.header.stamp;
    EXPECT_GT(stamp, last);
    EXPECT_GT(stamp, before);
    EXPECT_LT(stamp, ros::Time::now());
    last = stamp;
    const auto direct = CaptureBy("camera_node", 20.0);
    ASSERT_TRUE(direct.success) << direct.message;
    EXPECT_EQ(over_network.image.data, direct.image.data) << index;
  }
}

// A camera whose pictures have a width of choice and come as late as told.
struct FakeDevice {
  bool Expose(const SimExpose::Request& request, SimExpose::Response& response) {
    exposure_s = request.exposure;
    ros::WallDuration(answer_after_s.load()).sleep();
    CapturedFrame frame;
    frame.pixels = Image<std::uint8_t>(width, 600, 77);
    frame.stamp_ns = ros_io::FromRosTime(ros::Time::now());
    response.image = ros_io::ToMessage(frame, "");
    response.bit_depth = 8;
    response.success = 1;
    return true;
  }

  std::atomic<double> answer_after_s{0.0};
  std::atomic<int> width{800};
  std::atomic<double> exposure_s{0.0};
};

TEST(CameraNode, SaysWhatIsWrongWithItsDeviceAndRecovers) {
  const ros::WallTime begin = ros::WallTime::now();
  const auto missing = CaptureBy("fake/camera_node", 0.5);
  EXPECT_FALSE(missing.success);
  EXPECT_NE(missing.message.find("/fake/device/expose was not found within 0.5 s"),
            std::string::npos)
      << missing.message;
  EXPECT_LT((ros::WallTime::now() - begin).toSec(), 5.0);

  ros::NodeHandle nh;
  // Shared: a late answer may outlive this test.
  const auto device = std::make_shared<FakeDevice>();
  boost::function<bool(SimExpose::Request&, SimExpose::Response&)> handler =
      [device](SimExpose::Request& request, SimExpose::Response& response) {
        return device->Expose(request, response);
      };
  const ros::ServiceServer server = nh.advertiseService("fake/device/expose", handler);
  EXPECT_TRUE(CaptureBy("fake/camera_node", 5.0).success);

  device->width = 640;
  const auto other_size = CaptureBy("fake/camera_node", 5.0);
  EXPECT_FALSE(other_size.success);
  EXPECT_NE(other_size.message.find("640 x 600 px"), std::string::npos) << other_size.message;
  device->width = 800;

  device->answer_after_s = 3.0;
  const ros::WallTime call = ros::WallTime::now();
  const auto late = CaptureBy("fake/camera_node", 0.5);
  EXPECT_FALSE(late.success);
  EXPECT_NE(late.message.find("did not answer within 0.5 s"), std::string::npos) << late.message;
  EXPECT_LT((ros::WallTime::now() - call).toSec(), 2.5);
  device->answer_after_s = 0.0;
  EXPECT_TRUE(CaptureBy("fake/camera_node", 10.0).success);
  EXPECT_EQ(device->exposure_s, 0.02);

  dynamic_reconfigure::Reconfigure::Request settings;
  settings.config.doubles.resize(1);
  settings.config.doubles[0].name = "exposure_s";
  settings.config.doubles[0].value = 0.007;
  Call<dynamic_reconfigure::Reconfigure>("fake/camera_node/set_parameters", settings);
  EXPECT_TRUE(CaptureBy("fake/camera_node", 10.0).success);
  EXPECT_EQ(device->exposure_s, 0.007);
}

TEST(MotionNode, StopsWhenCancelled) {
  ASSERT_NO_FATAL_FAILURE(MoveTo(0.0));
  MoveClient client("move_to_view", true);
  ASSERT_TRUE(client.waitForServer(kPatience));
  MoveToViewGoal goal;
  goal.joint_positions = {3.0};  // Six seconds at 0.5 rad/s.
  client.sendGoal(goal);
  ros::NodeHandle nh;
  const auto position = [&nh] {
    const auto message =
        ros::topic::waitForMessage<sensor_msgs::JointState>("joint_states", nh, kPatience);
    return message ? *message : sensor_msgs::JointState();
  };
  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(10.0);
  sensor_msgs::JointState moving = position();
  while (moving.position.at(0) < 0.1 && ros::WallTime::now() < deadline) moving = position();
  EXPECT_GT(moving.velocity.at(0), 0.0);
  client.cancelGoal();
  ASSERT_TRUE(client.waitForResult(ros::Duration(5.0)));
  EXPECT_EQ(client.getState().state_, actionlib::SimpleClientGoalState::PREEMPTED);
  const double stopped = client.getResult()->joint_positions.at(0);
  EXPECT_LT(stopped, 2.5);
  for (int i = 0; i < 10; ++i) {
    const sensor_msgs::JointState resting = position();
    EXPECT_EQ(resting.position.at(0), stopped);
    EXPECT_EQ(resting.velocity.at(0), 0.0);
  }
  MoveTo(0.0);  // The next motion works.
}

TEST(CameraNode, RefusesAnExposureThatNoOneWouldWaitFor) {
  Capture::Request request;
  request.exposure = 1e9;
  const auto refused = Call<Capture>("camera_node/capture", request);
  EXPECT_FALSE(refused.success);
  EXPECT_NE(refused.message.find("exposure_s = 1000000000 is outside [1e-05, 10]"),
            std::string::npos)
      << refused.message;
  EXPECT_TRUE(CaptureBy("camera_node", 20.0).success);
}

TEST(CameraNode, TellsThatTheDeviceIsAbsentBeforeAnyPicture) {
  ros::NodeHandle nh;
  const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(30.0);
  std::string words;
  while (words.empty() && ros::WallTime::now() < deadline) {
    const auto message =
        ros::topic::waitForMessage<diagnostic_msgs::DiagnosticArray>("/diagnostics", nh, kPatience);
    ASSERT_TRUE(message);
    for (const auto& status : message->status) {
      const bool is_error = status.level == diagnostic_msgs::DiagnosticStatus::ERROR;
      if (status.name.find("absent") != std::string::npos && is_error) words = status.message;
    }
  }
  EXPECT_NE(words.find("'127.0.0.99' was not found"), std::string::npos) << words;
}

TEST(MotionNode, RefusesAWrongNumberOfJoints) {
  MoveClient client("move_to_view", true);
  ASSERT_TRUE(client.waitForServer(kPatience));
  MoveToViewGoal goal;
  goal.joint_positions = {1.0, 2.0};
  client.sendGoalAndWait(goal, kPatience);
  EXPECT_EQ(client.getState().state_, actionlib::SimpleClientGoalState::ABORTED);
  EXPECT_NE(client.getResult()->message.find("2 joint positions given, must be 1"),
            std::string::npos);
}

// The edges that a calibrated cell publishes.
void PublishEdges(tf2_ros::StaticTransformBroadcaster& broadcaster) {
  std::vector<geometry_msgs::TransformStamped> edges(3);
  for (auto& edge : edges) {
    edge.header.stamp = ros::Time::now();
    edge.transform.rotation.w = 1.0;
  }
  edges[0].header.frame_id = "cell";
  edges[0].child_frame_id = "turntable_base";
  edges[1].header.frame_id = "turntable";
  edges[1].child_frame_id = "object";
  edges[2].header.frame_id = "cell";
  edges[2].child_frame_id = "camera_optical_frame";
  edges[2].transform = ros_io::ToTransformMessage(CameraAtZero());
  broadcaster.sendTransform(edges);
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "device_nodes_test");
  ros::AsyncSpinner spinner(2);
  spinner.start();
  tf2_ros::StaticTransformBroadcaster broadcaster;
  fringe_fusion::PublishEdges(broadcaster);
  return RUN_ALL_TESTS();
}
