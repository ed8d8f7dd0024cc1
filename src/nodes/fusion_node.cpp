#include "nodes/fusion_node.hpp"

#include <fringe_fusion/StageState.h>
#include <fringe_fusion/ViewStatus.h>
#include <ros/console.h>
#include <visualization_msgs/Marker.h>

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "fringe_fusion/fusion/model_file.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/ros_io/configs.hpp"
#include "fringe_fusion/ros_io/marker_messages.hpp"
#include "fringe_fusion/ros_io/octomap_message.hpp"
#include "fringe_fusion/ros_io/view_messages.hpp"

namespace fringe_fusion::nodes {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::size_t kMaxQueryPoints = 100000;

std_msgs::ColorRGBA Color(float r, float g, float b, float a) {
  std_msgs::ColorRGBA color;
  color.r = r;
  color.g = g;
  color.b = b;
  color.a = a;
  return color;
}

ViewStatus StatusOf(int view_id, const ScanModel::Counts& counts) {
  ViewStatus status;
  status.view_id = static_cast<std::uint32_t>(view_id);
  status.stage = "fusion";
  status.success = 1;
  status.num_points = static_cast<std::uint32_t>(counts.num_points);
  status.num_dropped = static_cast<std::uint32_t>(counts.num_dropped);
  return status;
}

}  // namespace

Result<std::unique_ptr<FusionNode>> FusionNode::Create(ros::NodeHandle nh,
                                                       ros::NodeHandle private_nh) {
  const auto node = ros_io::LoadConfig<FusionNodeConfig>(private_nh);
  if (!node) return Forward(node);
  const auto surface = ros_io::LoadConfig<SurfaceConfig>(ros::NodeHandle(private_nh, "surface"));
  if (!surface) return Forward(surface);
  const auto fill = ros_io::LoadConfig<FillConfig>(ros::NodeHandle(private_nh, "fill"));
  if (!fill) return Forward(fill);
  const auto fusion = ros_io::LoadConfig<FusionConfig>(ros::NodeHandle(private_nh, "fusion"));
  if (!fusion) return Forward(fusion);
  const auto crop = ros_io::LoadConfig<CropConfig>(ros::NodeHandle(private_nh, "crop"));
  if (!crop) return Forward(crop);
  const auto occupancy =
      ros_io::LoadConfig<OccupancyConfig>(ros::NodeHandle(private_nh, "occupancy"));
  if (!occupancy) return Forward(occupancy);
  Result<ScanModel> model = ScanModel::Create({*fusion, *crop, *occupancy});
  if (!model) return Forward(model);
  return std::unique_ptr<FusionNode>(new FusionNode(
      std::move(nh), std::move(private_nh), Setup{*node, *surface, *fill}, std::move(*model)));
}

FusionNode::FusionNode(ros::NodeHandle nh, ros::NodeHandle private_nh, Setup setup, ScanModel model)
    : config_(std::move(setup.node)),
      surface_(setup.surface),
      fill_(setup.fill),
      nh_(std::move(nh)),
      model_(std::move(model)) {
  state_publisher_ = nh_.advertise<StageState>("model_state", 1, /*latch=*/true);
  status_publisher_ = nh_.advertise<ViewStatus>("view_status", 100);
  mesh_publisher_ = nh_.advertise<visualization_msgs::Marker>("mesh", 1, /*latch=*/true);
  octomap_publisher_ = nh_.advertise<ros_io::OctomapMessage>("octomap", 1, /*latch=*/true);
  occupied_publisher_ =
      nh_.advertise<visualization_msgs::Marker>("occupied_cells", 1, /*latch=*/true);
  free_publisher_ = nh_.advertise<visualization_msgs::Marker>("free_cells", 1, /*latch=*/true);
  integrate_server_ = nh_.advertiseService("integrate_view", &FusionNode::OnIntegrate, this);
  extract_server_ = nh_.advertiseService("extract_mesh", &FusionNode::OnExtract, this);
  query_server_ = nh_.advertiseService("query_distance", &FusionNode::OnQuery, this);
  save_server_ = nh_.advertiseService("save_model", &FusionNode::OnSave, this);
  load_server_ = nh_.advertiseService("load_model", &FusionNode::OnLoad, this);
  reset_server_ = private_nh.advertiseService("reset", &FusionNode::OnReset, this);
  poses_subscriber_ =
      nh_.subscribe<ViewPoses>("view_poses", 4, [this](const ViewPoses::ConstPtr& message) {
        const std::lock_guard<std::mutex> lock(mutex_);
        poses_ = message;
        OnPoses(*message);
      });
  view_subscriber_ = nh_.subscribe<RangeView>(
      "view", 4, [this](const RangeView::ConstPtr& message) { OnView(*message); });
  const std::lock_guard<std::mutex> lock(mutex_);
  PublishState();
}

void FusionNode::OnView(const RangeView& message) {
  const Result<ScanModel::Counts> counts = Integrate(message);
  if (!counts) {
    ROS_ERROR("view %u of scan '%s' is not integrated: %s", message.view_id,
              message.scan_id.c_str(), counts.error().message.c_str());
    return;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  if (config_.preview) PublishPreview();
}

Result<ScanModel::Counts> FusionNode::Integrate(const RangeView& message) {
  const auto start = Clock::now();
  const Result<ScanModel::Counts> counts = AddToModel(message);
  model_changed_.notify_all();
  ViewStatus status =
      StatusOf(static_cast<int>(message.view_id), counts.value_or(ScanModel::Counts()));
  status.header = message.header;
  status.scan_id = message.scan_id;
  status.success = static_cast<std::uint8_t>(counts.has_value());
  status.duration = std::chrono::duration<double>(Clock::now() - start).count();
  if (!counts) status.message = counts.error().message;
  status_publisher_.publish(status);
  return counts;
}

Result<ScanModel::Counts> FusionNode::AddToModel(const RangeView& message) {
  Result<View> view = ros_io::FromMessage(message);
  if (!view) return Forward(view);
  if (view->pose.source == PoseSource::kNone) {
    return Fail("view {} of scan '{}' has no pose", message.view_id, message.scan_id);
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  if (message.scan_id != model_.scan_id()) {
    Status ready = model_.Reset(message.scan_id);
    if (ready) ready = ApplyPoses();
    if (!ready) return tl::unexpected<Error>(ready.error());
  }
  const Result<ScanModel::Counts> counts = model_.Integrate(std::move(*view));
  PublishState();
  return counts;
}

void FusionNode::OnPoses(const ViewPoses& message) {
  if (message.scan_id != model_.scan_id()) return;
  if (Status status = ApplyPoses(); !status) {
    ROS_ERROR("poses of revision %u of scan '%s' are not fully applied: %s", message.revision,
              message.scan_id.c_str(), status.error().message.c_str());
  }
  PublishState();
  model_changed_.notify_all();
}

Status FusionNode::ApplyPoses() {
  if (!poses_ || poses_->scan_id != model_.scan_id() || poses_->revision == model_.revision()) {
    return {};
  }
  std::vector<RegisteredView> poses;
  for (const ViewPose& pose : poses_->views) {
    const Result<RegisteredView> view = ros_io::FromMessage(pose);
    if (!view) return tl::unexpected<Error>(view.error());
    poses.push_back(*view);
  }
  return model_.Repose(poses, poses_->revision);
}

bool FusionNode::OnIntegrate(IntegrateView::Request& request, IntegrateView::Response& response) {
  const Result<ScanModel::Counts> counts = Integrate(request.view);
  response.success = static_cast<std::uint8_t>(counts.has_value());
  if (counts) {
    response.num_points = static_cast<std::uint32_t>(counts->num_points);
    response.num_dropped = static_cast<std::uint32_t>(counts->num_dropped);
  } else {
    response.message = counts.error().message;
  }
  return true;
}

bool FusionNode::OnExtract(ExtractSurface::Request& request, ExtractSurface::Response& response) {
  const Result<Mesh> mesh = Extract(request);
  Status status;
  if (!mesh) {
    status = tl::unexpected<Error>(mesh.error());
  } else if (!request.path.empty()) {
    status = WriteMesh(*mesh, request.path);
  }
  response.success = static_cast<std::uint8_t>(status.has_value());
  if (!status) {
    response.message = status.error().message;
    ROS_ERROR("no surface: %s", response.message.c_str());
    return true;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  response.num_views = static_cast<std::uint32_t>(model_.ViewIds().size());
  response.num_vertices = static_cast<std::uint32_t>(mesh->vertices.size());
  response.num_faces = static_cast<std::uint32_t>(mesh->faces.size());
  response.num_filled_faces = static_cast<std::uint32_t>(
      std::count(mesh->filled_faces.begin(), mesh->filled_faces.end(), 1));
  for (const auto& [id, counts] : model_.ViewCounts()) {
    response.views.push_back(StatusOf(id, counts));
  }
  PublishMesh(*mesh);
  PublishCells();
  return true;
}

Result<Mesh> FusionNode::Extract(const ExtractSurface::Request& request) {
  const double timeout_s = std::max(config_.extract_timeout_s, request.timeout.toSec());
  std::unique_lock<std::mutex> lock(mutex_);
  const bool ready = model_changed_.wait_for(lock, std::chrono::duration<double>(timeout_s),
                                             [&] { return Holds(request); });
  if (!ready) {
    return Fail(
        "the model holds {} of {} views of scan '{}' at pose revision {} (wanted scan '{}', "
        "revision {}) after {:.3g} s",
        model_.ViewIds().size(), request.num_views, model_.scan_id(), model_.revision(),
        request.scan_id, request.pose_revision, timeout_s);
  }
  if (request.fill_holes == 0 && request.watertight == 0) {
    return ExtractMesh(model_.model(), surface_);
  }
  FillConfig fill = fill_;
  if (request.watertight != 0) fill.watertight = true;
  Result<FilledSurface> filled = model_.Fill(fill, surface_);
  if (!filled) return Forward(filled);
  return std::move(filled->mesh);
}

bool FusionNode::Holds(const ExtractSurface::Request& request) const {
  return (request.scan_id.empty() || request.scan_id == model_.scan_id()) &&
         model_.ViewIds().size() >= std::max(1U, request.num_views) &&
         (request.pose_revision == 0 || request.pose_revision == model_.revision());
}

bool FusionNode::OnQuery(QueryDistance::Request& request, QueryDistance::Response& response) {
  if (request.points.size() > kMaxQueryPoints) {
    response.success = 0;
    response.message = fmt::format("{} points are more than the {} of one call",
                                   request.points.size(), kMaxQueryPoints);
    return true;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const geometry_msgs::Point& point : request.points) {
    const FieldSample sample = model_.model().Query({point.x, point.y, point.z});
    geometry_msgs::Vector3 gradient;
    gradient.x = static_cast<double>(sample.gradient.x());
    gradient.y = static_cast<double>(sample.gradient.y());
    gradient.z = static_cast<double>(sample.gradient.z());
    response.supported.push_back(static_cast<std::uint8_t>(sample.supported));
    response.distance.push_back(static_cast<double>(sample.distance));
    response.gradient.push_back(gradient);
    response.sigma.push_back(static_cast<double>(sample.sigma));
  }
  response.success = 1;
  return true;
}

bool FusionNode::OnSave(WriteModel::Request& request, WriteModel::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const Status status =
      SaveModel(model_.model(), request.path, {model_.scan_id(), model_.revision()});
  response.success = static_cast<std::uint8_t>(status.has_value());
  if (!status) {
    response.message = status.error().message;
    ROS_ERROR("the model is not saved: %s", response.message.c_str());
  }
  response.num_views = static_cast<std::uint32_t>(model_.ViewIds().size());
  return true;
}

bool FusionNode::OnLoad(ReadModel::Request& request, ReadModel::Response& response) {
  Result<SavedModel> saved = LoadModel(request.path);
  response.success = static_cast<std::uint8_t>(saved.has_value());
  if (!saved) {
    response.message = saved.error().message;
    ROS_ERROR("no model is loaded: %s", response.message.c_str());
    return true;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  model_.Adopt(std::move(*saved));
  response.scan_id = model_.scan_id();
  response.num_views = static_cast<std::uint32_t>(model_.ViewIds().size());
  PublishState();
  PublishPreview();
  model_changed_.notify_all();
  return true;
}

bool FusionNode::OnReset(std_srvs::Trigger::Request& /*request*/,
                         std_srvs::Trigger::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  response.message =
      fmt::format("{} views of scan '{}' forgotten", model_.ViewIds().size(), model_.scan_id());
  const Status status = model_.Reset("");
  poses_.reset();
  response.success = static_cast<std::uint8_t>(status.has_value());
  if (!status) response.message = status.error().message;
  PublishState();
  mesh_publisher_.publish(ros_io::DeleteMarker(Header()));
  occupied_publisher_.publish(ros_io::DeleteMarker(Header()));
  free_publisher_.publish(ros_io::DeleteMarker(Header()));
  return true;
}

void FusionNode::PublishState() {
  StageState state;
  state.header = Header();
  state.stage = "fusion";
  state.scan_id = model_.scan_id();
  state.pose_revision = model_.revision();
  for (const int id : model_.ViewIds()) state.view_ids.push_back(static_cast<std::uint32_t>(id));
  state_publisher_.publish(state);
}

void FusionNode::PublishPreview() {
  if (mesh_publisher_.getNumSubscribers() > 0) {
    const Result<Mesh> mesh = ExtractMesh(model_.model(), surface_);
    if (mesh) {
      PublishMesh(*mesh);
    } else {
      ROS_WARN_THROTTLE(5.0, "no preview: %s", mesh.error().message.c_str());
    }
  }
  PublishCells();
}

void FusionNode::PublishMesh(const Mesh& mesh) {
  mesh_publisher_.publish(
      ros_io::ToMarker(mesh, Header(), static_cast<std::size_t>(config_.max_marker_faces)));
}

void FusionNode::PublishCells() {
  const bool wanted = octomap_publisher_.getNumSubscribers() > 0 ||
                      occupied_publisher_.getNumSubscribers() > 0 ||
                      free_publisher_.getNumSubscribers() > 0;
  if (!wanted) return;
  const Result<OccupancyMap> map = model_.Occupancy();
  if (!map) {
    ROS_WARN_THROTTLE(5.0, "no OctoMap: %s", map.error().message.c_str());
    return;
  }
  const std_msgs::Header header = Header();
  octomap_publisher_.publish(ros_io::ToMessage(*map, header.frame_id, header.stamp));
  occupied_publisher_.publish(
      ros_io::ToMarker(map->OccupiedCells(), header, Color(0.9F, 0.5F, 0.1F, 0.35F)));
  free_publisher_.publish(
      ros_io::ToMarker(map->FreeCells(), header, Color(0.2F, 0.7F, 0.9F, 0.06F)));
}

std_msgs::Header FusionNode::Header() const {
  std_msgs::Header header;
  header.stamp = ros::Time::now();
  header.frame_id = config_.object_frame;
  return header;
}

}  // namespace fringe_fusion::nodes
