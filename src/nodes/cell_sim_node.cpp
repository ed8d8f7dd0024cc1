#include "nodes/cell_sim_node.hpp"

#include <geometry_msgs/PoseStamped.h>

#include <cmath>
#include <thread>
#include <utility>

#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/ros_io/configs.hpp"
#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/truth_messages.hpp"
#include "fringe_fusion/sim/gauges.hpp"

namespace fringe_fusion::nodes {
namespace {

constexpr int kNumStops = 1000003;

/// Names a stop by its joint positions, so that the same stop always has the same pose error.
int PoseIndex(const std::vector<double>& joint_positions) {
  constexpr double kResolutionRad = 1e-5;
  std::uint64_t hash = 1469598103934665603ULL;  // FNV-1a
  for (const double position : joint_positions) {
    hash ^= static_cast<std::uint64_t>(std::llround(position / kResolutionRad));
    hash *= 1099511628211ULL;
  }
  return static_cast<int>(hash % static_cast<std::uint64_t>(kNumStops));
}

/// Far below every device's resolution, far above the rounding of tf.
bool SamePose(const Transform& a, const Transform& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff() < 1e-9;
}

}  // namespace

Result<std::unique_ptr<CellSimNode>> CellSimNode::Create(const ros::NodeHandle& nh,
                                                         const ros::NodeHandle& private_nh) {
  const auto config = ros_io::LoadConfig<CellSimNodeConfig>(private_nh);
  if (!config) return Forward(config);
  const auto physics = ros_io::LoadConfig<sim::SimConfig>(ros::NodeHandle(private_nh, "sim"));
  if (!physics) return Forward(physics);
  const auto gige = ros_io::LoadConfig<GigeServerConfig>(ros::NodeHandle(private_nh, "gige"));
  if (!gige) return Forward(gige);
  const Result<CellCalibration> calibration = ReadCellCalibration(config->calibration_file);
  if (!calibration) return Forward(calibration);
  Result<Scene> scene = MakeScene(*config);
  if (!scene) return Forward(scene);
  Result<sim::SimCell> cell =
      sim::SimCell::Create(*physics, *calibration, scene->object, scene->background, scene->print);
  if (!cell) return Forward(cell);
  std::unique_ptr<CellSimNode> node(
      new CellSimNode(nh, private_nh, *config, std::move(*cell), std::move(*scene)));
  if (Status status = node->StartTruthFolder(node->scene_.object); !status) {
    return tl::unexpected<Error>(status.error());
  }
  if (Status status = node->StartGige(*gige); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const std::string& stands = config->target_file.empty() ? config->object : config->target_file;
  ROS_INFO("simulated cell ready, object '%s'", stands.c_str());
  return node;
}

Result<CellSimNode::Scene> CellSimNode::MakeScene(const CellSimNodeConfig& config) {
  Scene scene;
  if (config.plate_radius_m > 0.0) {
    scene.background = sim::MakePlate(config.plate_radius_m, config.plate_thickness_m);
  }
  if (config.target_file.empty()) {
    Result<Mesh> object = sim::MakeObject(config.object);
    if (!object) return Forward(object);
    scene.object = std::move(*object);
    return scene;
  }
  const auto target = LoadTarget(config.target_file);
  if (!target) return Forward(target);
  const auto T_object_target = MakeTransform(Eigen::Vector3d(config.target_translation_m.data()),
                                             Eigen::Vector4d(config.target_quaternion_xyzw.data()));
  if (!T_object_target) {
    return Fail("target_translation_m, target_quaternion_xyzw: {}",
                T_object_target.error().message);
  }
  scene.print =
      sim::SurfacePrint{MakeTargetPrint(*target), *T_object_target, config.target_softness_m};
  scene.object = sim::MakeTargetPlate(*scene.print);
  return scene;
}

CellSimNode::CellSimNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                         CellSimNodeConfig config, sim::SimCell cell, Scene scene)
    : config_(std::move(config)),
      cell_(std::move(cell)),
      scene_(std::move(scene)),
      tf_listener_(tf_buffer_) {
  const CameraModel& projector = cell_.calibration().projector;
  picture_ = Image<std::uint8_t>(projector.width, projector.height);
  ros::NodeHandle handle = nh;
  ros::NodeHandle private_handle = private_nh;
  truth_pose_ =
      private_handle.advertise<geometry_msgs::PoseStamped>("truth/pose", 1, /*latch=*/true);
  truth_points_ =
      private_handle.advertise<sensor_msgs::PointCloud2>("truth/points", 1, /*latch=*/true);
  joint_states_ = handle.subscribe("joint_states", 10, &CellSimNode::OnJointState, this);
  project_ = private_handle.advertiseService("project", &CellSimNode::OnProject, this);
  expose_ = private_handle.advertiseService("expose", &CellSimNode::OnExpose, this);
  place_target_ =
      private_handle.advertiseService("place_target", &CellSimNode::OnPlaceTarget, this);
}

Status CellSimNode::StartTruthFolder(const Mesh& object) {
  if (config_.truth_folder.empty()) return {};
  Result<TruthFolder> folder = TruthFolder::Create(config_.truth_folder, object);
  if (!folder) return tl::unexpected<Error>(folder.error());
  truth_folder_ = std::move(*folder);
  return {};
}

Status CellSimNode::StartGige(const GigeServerConfig& config) {
  if (config.interface.empty()) return {};
  if (cell_.config().bit_depth != 8) {
    return Fail("gige/interface is set: sim/bit_depth {} must be 8", cell_.config().bit_depth);
  }
  auto server = GigeServer::Start(config, [this](double exposure_s) { return Expose(exposure_s); });
  if (!server) return tl::unexpected<Error>(server.error());
  gige_server_ = std::move(*server);
  ROS_INFO("camera served as GigE Vision device on %s", config.interface.c_str());
  return {};
}

bool CellSimNode::OnProject(SimProject::Request& request, SimProject::Response& response) {
  const Result<CapturedFrame> picture = ros_io::FromMessage(request.picture, {});
  const CameraModel& projector = cell_.calibration().projector;
  const auto* pixels = picture ? std::get_if<Image<std::uint8_t>>(&picture->pixels) : nullptr;
  if (pixels == nullptr) {
    response.message = picture ? "picture must be mono8" : picture.error().message;
    return true;
  }
  if (pixels->width() != projector.width || pixels->height() != projector.height) {
    response.message = fmt::format("picture of {} x {} px, must be {} x {}", pixels->width(),
                                   pixels->height(), projector.width, projector.height);
    return true;
  }
  const std::lock_guard<std::mutex> lock(cell_mutex_);
  picture_ = *pixels;
  response.success = 1;
  return true;
}

bool CellSimNode::OnExpose(SimExpose::Request& request, SimExpose::Response& response) {
  const Result<CapturedFrame> frame = Expose(request.exposure);
  if (!frame) {
    response.message = frame.error().message;
    return true;
  }
  response.success = 1;
  response.image = ros_io::ToMessage(*frame, config_.camera_frame);
  response.bit_depth = static_cast<std::uint32_t>(frame->bit_depth);
  return true;
}

bool CellSimNode::OnPlaceTarget(SimPlace::Request& request, SimPlace::Response& response) {
  const Result<Transform> T_object_target = ros_io::FromMessage(request.pose);
  const Status placed = T_object_target ? PlaceTarget(*T_object_target) : Forward(T_object_target);
  response.success = static_cast<std::uint8_t>(placed.has_value());
  if (!placed) response.message = placed.error().message;
  return true;
}

Status CellSimNode::PlaceTarget(const Transform& T_object_target) {
  const std::lock_guard<std::mutex> lock(cell_mutex_);
  if (!scene_.print) return Fail("no target stands in the simulated cell: target_file is empty");
  sim::SurfacePrint print = *scene_.print;
  print.T_object_target = T_object_target;
  Mesh plate = sim::MakeTargetPlate(print);
  auto cell =
      sim::SimCell::Create(cell_.config(), cell_.calibration(), plate, scene_.background, print);
  if (!cell) return Forward(cell);
  cell_ = std::move(*cell);
  scene_.print = std::move(print);
  scene_.object = std::move(plate);
  ++num_placed_;
  T_object_camera_.reset();  // The rays are cast anew.
  return {};
}

void CellSimNode::OnJointState(const sensor_msgs::JointStateConstPtr& message) {
  const std::lock_guard<std::mutex> lock(joint_mutex_);
  joint_state_ = message;
}

Result<CapturedFrame> CellSimNode::Expose(double exposure_s) {
  constexpr double kMaxExposureS = 10.0;  // It is waited for in real time.
  if (!(exposure_s > 0.0 && exposure_s <= kMaxExposureS)) {
    return Fail("exposure {} s must be above 0 and at most {}", exposure_s, kMaxExposureS);
  }
  const std::lock_guard<std::mutex> lock(cell_mutex_);
  if (Status status = UpdatePose(); !status) return tl::unexpected<Error>(status.error());
  const ros::WallTime begin = ros::WallTime::now();
  const int frame_index = frame_index_++;
  Result<CapturedFrame> frame = cell_.Expose(picture_, exposure_s, frame_index);
  if (!frame) return frame;
  // The core stamps by frame number; a frame later than its number says comes later here too.
  const double period_s = std::max(cell_.config().frame_period_s, exposure_s);
  const double late_s = 1e-9 * static_cast<double>(frame->stamp_ns) -
                        period_s * (1000.0 * pose_index_ + frame_index + 0.5);
  const ros::WallTime end = begin + ros::WallDuration(exposure_s + std::max(0.0, late_s));
  // Rendering is part of the exposure; sleep until a real one would be over.
  ros::WallTime::sleepUntil(end);
  frame->stamp_ns = static_cast<std::int64_t>((end - ros::WallDuration(0.5 * exposure_s)).toNSec());
  return frame;
}

Status CellSimNode::UpdatePose() {
  sensor_msgs::JointStateConstPtr joint_state;
  {
    const std::lock_guard<std::mutex> lock(joint_mutex_);
    joint_state = joint_state_;
  }
  // A cell without axes publishes no joint states: its tf is static and has no time.
  const ros::Time stamp = joint_state ? joint_state->header.stamp : ros::Time(0);
  geometry_msgs::TransformStamped message;
  try {
    message = tf_buffer_.lookupTransform(config_.object_frame, config_.camera_frame, stamp,
                                         ros::Duration(config_.tf_timeout_s));
  } catch (const tf2::TransformException& exception) {
    return Fail("simulated cell: no transform of '{}' in '{}' within {} s: {}",
                config_.camera_frame, config_.object_frame, config_.tf_timeout_s, exception.what());
  }
  const Result<Transform> T_object_camera = ros_io::FromMessage(message.transform);
  if (!T_object_camera) return tl::unexpected<Error>(T_object_camera.error());
  // The pose may be known before the first joint state, which names the stop. A target in another
  // place has other noise.
  const int pose_index =
      ((joint_state ? PoseIndex(joint_state->position) : 0) + num_placed_) % kNumStops;
  if (T_object_camera_ && SamePose(*T_object_camera_, *T_object_camera) &&
      pose_index == pose_index_) {
    return {};
  }
  pose_index_ = pose_index;
  frame_index_ = 0;
  T_object_camera_.reset();
  if (Status status = cell_.MoveTo(*T_object_camera, pose_index_); !status) return status;
  T_object_camera_ = *T_object_camera;
  PublishTruth(message.header.stamp);
  return {};
}

void CellSimNode::PublishTruth(const ros::Time& stamp) {
  const sim::ViewTruth truth = cell_.Truth();
  geometry_msgs::PoseStamped pose;
  pose.header.stamp = stamp;
  pose.header.frame_id = config_.object_frame;
  pose.pose = ros_io::ToPoseMessage(truth.T_object_camera);
  truth_pose_.publish(pose);
  sensor_msgs::PointCloud2 points = ros_io::ToMessage(truth);
  points.header.stamp = stamp;
  points.header.frame_id = config_.camera_frame;
  truth_points_.publish(points);
  if (!truth_folder_) return;
  if (const Status status = truth_folder_->AddStop(truth.face_visible); !status) {
    ROS_ERROR("truth was not written: %s", status.error().message.c_str());
  }
}

}  // namespace fringe_fusion::nodes
