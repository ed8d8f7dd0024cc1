#include "nodes/phase_node.hpp"

#include <fringe_fusion/RangeView.h>
#include <fringe_fusion/ViewStatus.h>
#include <ros/console.h>

#include <boost/make_shared.hpp>
#include <chrono>
#include <cmath>
#include <thread>
#include <utility>

#include "fringe_fusion/diagnosis/sensor_noise.hpp"
#include "fringe_fusion/inspection/mask_picture.hpp"
#include "fringe_fusion/io/response_yaml.hpp"
#include "fringe_fusion/ros_io/configs.hpp"
#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_fusion/ros_io/phase_messages.hpp"
#include "fringe_fusion/ros_io/picture_messages.hpp"
#include "fringe_fusion/ros_io/tf_lookup.hpp"
#include "fringe_fusion/ros_io/view_messages.hpp"

namespace fringe_fusion::nodes {
namespace {

using Clock = std::chrono::steady_clock;

// Fringe amplitude over the noise of one grey value, the usual measure of a pixel's quality.
Image<float> SignalToNoise(const PhaseMap& phase, const PhaseConfig& config) {
  Image<float> snr(phase.width, phase.height, std::nanf(""));
  for (std::size_t i = 0; i < snr.size(); ++i) {
    const double variance = config.read_noise_dn * config.read_noise_dn +
                            config.gain_dn * static_cast<double>(phase.offset[i]) + 1.0 / 12.0;
    snr[i] = static_cast<float>(static_cast<double>(phase.modulation[i]) / std::sqrt(variance));
  }
  return snr;
}

Image<float> Depth(const RangeImage& range) {
  Image<float> depth(range.width, range.height);
  for (std::size_t i = 0; i < depth.size(); ++i) depth[i] = range.points[i].z();
  return depth;
}

}  // namespace

Result<std::unique_ptr<PhaseNode>> PhaseNode::Create(ros::NodeHandle nh,
                                                     ros::NodeHandle private_nh) {
  const auto node = ros_io::LoadConfig<PhaseNodeConfig>(private_nh);
  if (!node) return Forward(node);
  const auto phase = ros_io::LoadConfig<PhaseConfig>(ros::NodeHandle(private_nh, "phase"));
  if (!phase) return Forward(phase);
  const auto diagnosis =
      ros_io::LoadConfig<DiagnosisConfig>(ros::NodeHandle(private_nh, "diagnosis"));
  if (!diagnosis) return Forward(diagnosis);
  const auto triangulation =
      ros_io::LoadConfig<TriangulationConfig>(ros::NodeHandle(private_nh, "triangulation"));
  if (!triangulation) return Forward(triangulation);
  Configs configs{*node, *phase, *diagnosis, *triangulation, {}};
  if (!node->response_file.empty()) {
    auto response = ReadResponse(node->response_file);
    if (!response) return Forward(response);
    configs.response = std::move(*response);
  }
  return std::unique_ptr<PhaseNode>(new PhaseNode(std::move(nh), configs));
}

PhaseNode::PhaseNode(ros::NodeHandle nh, const Configs& configs)
    : configs_(configs), nh_(std::move(nh)), tf_listener_(tf_buffer_, nh_), images_(nh_) {
  range_view_publisher_ = nh_.advertise<RangeView>("range_view", 4);
  decoded_view_publisher_ = nh_.advertise<DecodedView>("decoded_view", 2);
  status_publisher_ = nh_.advertise<ViewStatus>("view_status", 100);
  points_publisher_ = nh_.advertise<sensor_msgs::PointCloud2>("points/xyzrgba", 2);
  normals_publisher_ = nh_.advertise<sensor_msgs::PointCloud2>("normals/xyz", 2);
  phase_u_publisher_ = images_.advertiseCamera("phase_map/u", 2);
  phase_v_publisher_ = images_.advertiseCamera("phase_map/v", 2);
  depth_publisher_ = images_.advertiseCamera("depth/image", 2);
  snr_publisher_ = images_.advertiseCamera("snr/image", 2);
  error_publisher_ = images_.advertiseCamera("error_depth/image", 2);
  order_publisher_ = images_.advertiseCamera("order_error/image", 2);
  color_publisher_ = images_.advertiseCamera("color/image_color", 2);
  mask_publisher_ = images_.advertiseCamera("mask/image", 2);
  mask_color_publisher_ = images_.advertiseCamera("mask/image_color", 2);
  legend_publisher_ = nh_.advertise<sensor_msgs::Image>("mask/legend", 1, /*latch=*/true);
  legend_publisher_.publish(ros_io::ToMessage(MaskLegend(), std_msgs::Header()));
  const auto keep = [this](sensor_msgs::CameraInfo::ConstPtr& member) {
    return [this, &member](const sensor_msgs::CameraInfo::ConstPtr& info) {
      const std::lock_guard<std::mutex> lock(mutex_);
      member = info;
    };
  };
  camera_info_subscriber_ =
      nh_.subscribe<sensor_msgs::CameraInfo>("camera_info", 10, keep(camera_info_));
  projector_info_subscriber_ =
      nh_.subscribe<sensor_msgs::CameraInfo>("projector_info", 10, keep(projector_info_));
  const auto queue_size = static_cast<std::uint32_t>(configs_.node.frame_queue_size);
  frame_subscriber_ = nh_.subscribe<Frame>(
      "frames", queue_size, [this](const Frame::ConstPtr& frame) { OnFrame(*frame); });
}

void PhaseNode::OnFrame(const Frame& frame) {
  Result<StackAssembler::Outcome> outcome = assembler_.Add(frame);
  if (!outcome) {
    ROS_ERROR_THROTTLE(5.0, "%s", outcome.error().message.c_str());
    return;
  }
  if (!outcome->discarded.empty()) ROS_WARN("%s", outcome->discarded.c_str());
  if (outcome->stack) Process(*outcome->stack, outcome->camera_frame);
}

void PhaseNode::Process(const ImageStack& stack, const std::string& camera_frame) {
  const auto start = Clock::now();
  const Result<int> num_points = Reconstruct(stack, camera_frame);
  ViewStatus status;
  status.header.stamp = ros_io::ToRosTime(stack.frames.front().stamp_ns);
  status.header.frame_id = camera_frame;
  status.scan_id = stack.scan_id;
  status.view_id = static_cast<std::uint32_t>(stack.view_id);
  status.stage = "phase";
  status.success = static_cast<std::uint8_t>(num_points.has_value());
  status.duration = std::chrono::duration<double>(Clock::now() - start).count();
  if (num_points) {
    status.num_points = static_cast<std::uint32_t>(*num_points);
    ROS_INFO("view %d of scan '%s': %d points in %.2f s", stack.view_id, stack.scan_id.c_str(),
             *num_points, status.duration);
  } else {
    status.message = num_points.error().message;
    ROS_ERROR("view %d of scan '%s' gives no range image: %s", stack.view_id, stack.scan_id.c_str(),
              status.message.c_str());
  }
  status_publisher_.publish(status);
}

Result<int> PhaseNode::Reconstruct(const ImageStack& stack, const std::string& camera_frame) {
  const Result<CellCalibration> calibration = Calibration(camera_frame);
  if (!calibration) return Forward(calibration);
  const Result<PhaseConfig> config = WithSensorNoise(configs_.phase, stack, configs_.diagnosis);
  if (!config) return Forward(config);
  Result<PhaseMap> phase = DecodeWithResponse(stack, *config, configs_.diagnosis, configs_.response,
                                              NoProgress, std::move(last_phase_));
  if (!phase) return Forward(phase);
  last_phase_ = std::move(*phase);
  PublishCodes(last_phase_, *calibration, stack, camera_frame);
  Result<TriangulationResult> triangulated =
      Triangulate(last_phase_, *calibration, configs_.triangulation);
  if (!triangulated) return Forward(triangulated);
  PublishMask(triangulated->mask, stack, camera_frame);
  const int num_points = CountValid(triangulated->range);
  if (num_points == 0) {
    return Fail("0 of {} pixels carry a point: check light, exposure and focus",
                triangulated->range.points.size());
  }
  View view;
  view.id = stack.view_id;
  view.range = std::move(triangulated->range);
  ros_io::ViewContext context;
  context.scan_id = stack.scan_id;
  context.calibration_id = CalibrationId(*calibration);
  context.camera_frame = camera_frame;
  range_view_publisher_.publish(ros_io::ToMessage(view, context));
  PublishPictures(last_phase_, view.range, *config, camera_frame);
  return num_points;
}

Result<CellCalibration> PhaseNode::Calibration(const std::string& camera_frame) {
  const auto deadline =
      Clock::now() + std::chrono::duration<double>(configs_.node.calibration_timeout_s);
  sensor_msgs::CameraInfo::ConstPtr camera_info;
  sensor_msgs::CameraInfo::ConstPtr projector_info;
  while (true) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      camera_info = camera_info_;
      projector_info = projector_info_;
    }
    if (camera_info && projector_info) break;
    if (Clock::now() >= deadline) {
      return Fail("no message on {} within {} s",
                  nh_.resolveName(camera_info ? "projector_info" : "camera_info"),
                  configs_.node.calibration_timeout_s);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  const Result<CameraModel> camera = ros_io::FromMessage(*camera_info, "camera_info");
  if (!camera) return Forward(camera);
  const Result<CameraModel> projector = ros_io::FromMessage(*projector_info, "projector_info");
  if (!projector) return Forward(projector);
  const Result<Transform> T_projector_camera = ros_io::LookupTransform(
      tf_buffer_, {configs_.node.projector_frame, camera_frame, ros::Time()},
      configs_.node.calibration_timeout_s);
  if (!T_projector_camera) return Forward(T_projector_camera);
  CellCalibration calibration;
  calibration.camera = *camera;
  calibration.projector = *projector;
  calibration.T_projector_camera = *T_projector_camera;
  if (Status status = Validate(calibration, "calibration"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return calibration;
}

void PhaseNode::PublishCodes(const PhaseMap& phase, const CellCalibration& calibration,
                             const ImageStack& stack, const std::string& camera_frame) {
  // Relative codes are off by unknown periods: no epipolar constraint holds.
  if (phase.relative_u || phase.relative_v) return;
  if (decoded_view_publisher_.getNumSubscribers() == 0) return;
  ros_io::DecodedCodes codes;
  codes.scan_id = stack.scan_id;
  codes.view_id = stack.view_id;
  codes.camera_frame = camera_frame;
  codes.projector_frame = configs_.node.projector_frame;
  codes.calibration = calibration;
  // Shared: maps of many megapixels pass between nodelets without a copy.
  decoded_view_publisher_.publish(
      boost::make_shared<const DecodedView>(ros_io::ToMessage(phase, codes)));
}

template <typename Make>
void PhaseNode::PublishImage(const image_transport::CameraPublisher& publisher,
                             const std_msgs::Header& header, const Make& make) {
  if (publisher.getNumSubscribers() == 0) return;
  sensor_msgs::CameraInfo info;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    info = *camera_info_;
  }
  info.header = header;
  publisher.publish(ros_io::ToMessage(make(), header), info);
}

void PhaseNode::PublishMask(const Image<std::uint8_t>& mask, const ImageStack& stack,
                            const std::string& camera_frame) {
  std_msgs::Header header;
  header.stamp = ros_io::ToRosTime(stack.frames.front().stamp_ns);
  header.frame_id = camera_frame;
  PublishImage(mask_publisher_, header, [&] { return mask; });
  PublishImage(mask_color_publisher_, header, [&] { return RenderMask(mask); });
}

void PhaseNode::PublishPictures(const PhaseMap& phase, const RangeImage& range,
                                const PhaseConfig& config, const std::string& camera_frame) {
  std_msgs::Header header;
  header.stamp = ros_io::ToRosTime(range.first_stamp_ns);
  header.frame_id = camera_frame;
  const auto publish = [&](const image_transport::CameraPublisher& publisher, const auto& make) {
    PublishImage(publisher, header, make);
  };
  if (!phase.u.empty()) publish(phase_u_publisher_, [&] { return phase.u; });
  if (!phase.v.empty()) publish(phase_v_publisher_, [&] { return phase.v; });
  if (!phase.order_error.empty()) publish(order_publisher_, [&] { return phase.order_error; });
  publish(depth_publisher_, [&] { return Depth(range); });
  publish(snr_publisher_, [&] { return SignalToNoise(phase, config); });
  publish(error_publisher_, [&] { return range.sigma_range; });
  publish(color_publisher_, [&] { return range.color; });
  if (points_publisher_.getNumSubscribers() > 0) {
    points_publisher_.publish(ros_io::ToPointCloud(range, camera_frame));
  }
  if (normals_publisher_.getNumSubscribers() > 0) {
    normals_publisher_.publish(ros_io::ToNormalCloud(range, camera_frame));
  }
}

}  // namespace fringe_fusion::nodes
