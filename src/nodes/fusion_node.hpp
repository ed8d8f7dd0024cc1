#pragma once

#include <fringe_fusion/ExtractSurface.h>
#include <fringe_fusion/IntegrateView.h>
#include <fringe_fusion/QueryDistance.h>
#include <fringe_fusion/RangeView.h>
#include <fringe_fusion/ReadModel.h>
#include <fringe_fusion/ViewPoses.h>
#include <fringe_fusion/WriteModel.h>
#include <ros/node_handle.h>
#include <std_srvs/Trigger.h>

#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/surface/extract_mesh.hpp"
#include "fringe_fusion/surface/fill_holes.hpp"
#include "nodes/scan_model.hpp"

namespace fringe_fusion::nodes {

/// Parameters of fusion_node beside `fusion`, `crop`, `occupancy`, `surface` and `fill`.
struct FusionNodeConfig {
  std::string object_frame = "object";
  int max_marker_faces = 200000;   ///< the mesh marker is thinned to this for display
  double extract_timeout_s = 0.1;  ///< least wait of extract_mesh for views on their way
  bool preview = true;             ///< publish mesh and cells after every view

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("object_frame", object_frame);
    field("max_marker_faces", max_marker_faces, 100, 100000000);
    field("extract_timeout_s", extract_timeout_s, 0.0, 3600.0);
    field("preview", preview);
  }
};

/// Fuses the posed views of one scan into the implicit model and gives mesh, distances and OctoMap.
class FusionNode {
 public:
  [[nodiscard]] static Result<std::unique_ptr<FusionNode>> Create(ros::NodeHandle nh,
                                                                  ros::NodeHandle private_nh);

 private:
  struct Setup {
    FusionNodeConfig node;
    SurfaceConfig surface;
    FillConfig fill;
  };
  FusionNode(ros::NodeHandle nh, ros::NodeHandle private_nh, Setup setup, ScanModel model);

  void OnView(const RangeView& message);
  void OnPoses(const ViewPoses& message);
  bool OnIntegrate(IntegrateView::Request& request, IntegrateView::Response& response);
  bool OnExtract(ExtractSurface::Request& request, ExtractSurface::Response& response);
  bool OnQuery(QueryDistance::Request& request, QueryDistance::Response& response);
  bool OnSave(WriteModel::Request& request, WriteModel::Response& response);
  bool OnLoad(ReadModel::Request& request, ReadModel::Response& response);
  bool OnReset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);

  /// Adds a view and says so on view_status.
  [[nodiscard]] Result<ScanModel::Counts> Integrate(const RangeView& message);
  [[nodiscard]] Result<ScanModel::Counts> AddToModel(const RangeView& message);
  [[nodiscard]] Result<Mesh> Extract(const ExtractSurface::Request& request);
  // Need the lock.
  [[nodiscard]] Status ApplyPoses();
  [[nodiscard]] bool Holds(const ExtractSurface::Request& request) const;
  void PublishState();
  void PublishPreview();
  void PublishCells();
  void PublishMesh(const Mesh& mesh);
  [[nodiscard]] std_msgs::Header Header() const;

  FusionNodeConfig config_;
  SurfaceConfig surface_;
  FillConfig fill_;
  ros::NodeHandle nh_;

  std::mutex mutex_;  ///< guards the three below
  std::condition_variable model_changed_;
  ScanModel model_;
  ViewPoses::ConstPtr poses_;  ///< latest solution, perhaps of a scan whose views are yet to come

  ros::Publisher state_publisher_;
  ros::Publisher status_publisher_;
  ros::Publisher mesh_publisher_;
  ros::Publisher octomap_publisher_;
  ros::Publisher occupied_publisher_;
  ros::Publisher free_publisher_;
  ros::ServiceServer integrate_server_;
  ros::ServiceServer extract_server_;
  ros::ServiceServer query_server_;
  ros::ServiceServer save_server_;
  ros::ServiceServer load_server_;
  ros::ServiceServer reset_server_;
  ros::Subscriber poses_subscriber_;
  ros::Subscriber view_subscriber_;
};

}  // namespace fringe_fusion::nodes
