#pragma once

#include <fringe_fusion/Frame.h>
#include <image_transport/image_transport.h>
#include <ros/node_handle.h>
#include <sensor_msgs/CameraInfo.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/diagnosis/response.hpp"
#include "fringe_fusion/phase/phase_map.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"
#include "nodes/stack_assembler.hpp"

namespace fringe_fusion::nodes {

/// Parameters of phase_node beside the stages `phase`, `diagnosis` and `triangulation`.
struct PhaseNodeConfig {
  std::string projector_frame = "projector_optical_frame";
  std::string response_file;           ///< response.yaml; "": none. Undone here, if it says so
  int frame_queue_size = 200;          ///< Frames kept while a view is being decoded
  double calibration_timeout_s = 5.0;  ///< wait for camera_info, projector_info and tf

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("projector_frame", projector_frame);
    field("response_file", response_file);
    field("frame_queue_size", frame_queue_size, 1, 100000);
    field("calibration_timeout_s", calibration_timeout_s, 0.0, 3600.0);
  }
};

/// Makes range images of Frames: collects the stacks, decodes, triangulates, publishes.
class PhaseNode {
 public:
  [[nodiscard]] static Result<std::unique_ptr<PhaseNode>> Create(ros::NodeHandle nh,
                                                                 ros::NodeHandle private_nh);

 private:
  struct Configs {
    PhaseNodeConfig node;
    PhaseConfig phase;
    DiagnosisConfig diagnosis;  ///< whether and how sensor noise is estimated
    TriangulationConfig triangulation;
    std::optional<ResponseCurve> response;  ///< undone in the phases, if it says so
  };
  PhaseNode(ros::NodeHandle nh, const Configs& configs);

  void OnFrame(const Frame& frame);
  void Process(const ImageStack& stack, const std::string& camera_frame);
  /// @return number of valid points.
  [[nodiscard]] Result<int> Reconstruct(const ImageStack& stack, const std::string& camera_frame);
  /// Waits for the messages that hold the calibration.
  [[nodiscard]] Result<CellCalibration> Calibration(const std::string& camera_frame);
  /// The codes for pose_node, where someone listens.
  void PublishCodes(const PhaseMap& phase, const CellCalibration& calibration,
                    const ImageStack& stack, const std::string& camera_frame);
  /// @param make gives the picture; not called where nobody listens.
  template <typename Make>
  void PublishImage(const image_transport::CameraPublisher& publisher,
                    const std_msgs::Header& header, const Make& make);
  /// Reasons as numbers and in colours; also for a view without any point.
  void PublishMask(const Image<std::uint8_t>& mask, const ImageStack& stack,
                   const std::string& camera_frame);
  void PublishPictures(const PhaseMap& phase, const RangeImage& range, const PhaseConfig& config,
                       const std::string& camera_frame);

  Configs configs_;
  PhaseMap last_phase_;  ///< its memory takes the next view
  ros::NodeHandle nh_;
  tf2_ros::Buffer tf_buffer_;
  tf2_ros::TransformListener tf_listener_;
  image_transport::ImageTransport images_;

  std::mutex mutex_;  ///< guards the two infos
  sensor_msgs::CameraInfo::ConstPtr camera_info_;
  sensor_msgs::CameraInfo::ConstPtr projector_info_;

  StackAssembler assembler_;  ///< used by OnFrame alone

  ros::Publisher range_view_publisher_;
  ros::Publisher decoded_view_publisher_;
  ros::Publisher status_publisher_;
  ros::Publisher points_publisher_;
  ros::Publisher normals_publisher_;
  image_transport::CameraPublisher phase_u_publisher_;
  image_transport::CameraPublisher phase_v_publisher_;
  image_transport::CameraPublisher depth_publisher_;
  image_transport::CameraPublisher snr_publisher_;
  image_transport::CameraPublisher error_publisher_;
  image_transport::CameraPublisher order_publisher_;
  image_transport::CameraPublisher color_publisher_;
  image_transport::CameraPublisher mask_publisher_;
  image_transport::CameraPublisher mask_color_publisher_;
  ros::Publisher legend_publisher_;
  ros::Subscriber camera_info_subscriber_;
  ros::Subscriber projector_info_subscriber_;
  ros::Subscriber frame_subscriber_;  ///< last: the rest must stand before the first Frame
};

}  // namespace fringe_fusion::nodes
