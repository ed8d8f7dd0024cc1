#pragma once

#include <actionlib/client/simple_action_client.h>
#include <actionlib/server/simple_action_server.h>
#include <fringe_fusion/CaptureFinding.h>
#include <fringe_fusion/MoveToViewAction.h>
#include <fringe_fusion/OptimizeViews.h>
#include <fringe_fusion/ScanObjectAction.h>
#include <fringe_fusion/ScanViewAction.h>
#include <ros/node_handle.h>

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/diagnosis/diagnose_stack.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "nodes/action_goal.hpp"
#include "nodes/scan_output.hpp"
#include "nodes/view_tracker.hpp"

namespace fringe_fusion::nodes {

/// Parameters of cell_node. File: config/cell_node.yaml.
struct CellNodeConfig {
  int num_views = 12;           ///< of a goal that does not say
  int max_views_in_flight = 2;  ///< captured, but not yet in the model
  int max_resends = 2;          ///< of one view from disk, when a node has lost it
  int frame_queue_size = 200;   ///< of the frames that are sent again
  std::string camera_frame = "camera_optical_frame";
  std::string object_frame = "object";
  double server_timeout_s = 10.0;   ///< a node that is away for longer counts as lost
  double move_timeout_s = 60.0;     ///< one motion
  double view_timeout_s = 120.0;    ///< capture of one view
  double process_timeout_s = 60.0;  ///< from the last frame of a view until it is in the model
  double optimize_timeout_s = 300.0;
  double extract_timeout_s = 300.0;
  bool fill_holes = false;  ///< close the holes of the mesh

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("num_views", num_views, 1, 100000);
    field("max_views_in_flight", max_views_in_flight, 1, 1000);
    field("max_resends", max_resends, 0, 1000);
    field("frame_queue_size", frame_queue_size, 1, 100000);
    field("camera_frame", camera_frame);
    field("object_frame", object_frame);
    field("server_timeout_s", server_timeout_s, 0.1, 3600.0);
    field("move_timeout_s", move_timeout_s, 0.1, 3600.0);
    field("view_timeout_s", view_timeout_s, 0.1, 3600.0);
    field("process_timeout_s", process_timeout_s, 0.1, 3600.0);
    field("optimize_timeout_s", optimize_timeout_s, 0.1, 86400.0);
    field("extract_timeout_s", extract_timeout_s, 0.1, 86400.0);
    field("fill_holes", fill_holes);
  }
};

/// Does the whole job: move, scan, register, fuse, mesh, report. Views of which a node has lost its
/// memory are sent again from the frames on disk.
class CellNode {
 public:
  [[nodiscard]] static Result<std::unique_ptr<CellNode>> Create(ros::NodeHandle nh,
                                                                ros::NodeHandle private_nh);
  ~CellNode();

 private:
  using Clock = std::chrono::steady_clock;
  using Server = actionlib::SimpleActionServer<ScanObjectAction>;

  /// One goal while it runs.
  struct Run {
    std::string folder;
    bool resume = false;
    ScanJob job;
    std::map<int, int> num_resends;
    std::map<int, std::vector<CaptureFinding>> findings;  ///< of every view that was examined
    std::map<int, ScanFigures::View> views;               ///< what becomes figures.views
    ScanFigures figures;
    std::map<std::string, double> seconds;
  };

  struct Setup {
    CellNodeConfig config;
    PhaseConfig phase;
    DiagnosisConfig diagnosis;
    std::vector<double> joint_positions;  ///< flat list of stops; empty: equal steps of a turn
    int num_joints = 1;
  };
  CellNode(ros::NodeHandle nh, Setup setup);

  void Execute(const ScanObjectGoal& goal);
  [[nodiscard]] Result<Run> Scan(const ScanObjectGoal& goal);
  [[nodiscard]] Result<Run> Prepare(const ScanObjectGoal& goal);
  [[nodiscard]] Status ResetStages();
  [[nodiscard]] Status CaptureViews(Run& run);
  [[nodiscard]] Status CaptureView(Run& run, int view_id);
  /// Joint positions of a view.
  [[nodiscard]] std::vector<double> Stop(int view_id, int num_views) const;
  /// Waits until at most num_in_flight views are not yet in the model; sends lost ones again.
  [[nodiscard]] Status WaitForModel(Run& run, std::size_t num_in_flight);
  [[nodiscard]] Status Resend(Run& run, const std::vector<int>& view_ids);
  [[nodiscard]] Status SendFromDisk(Run& run, int view_id);
  /// @return error naming a node that the scan cannot do without and that has gone.
  [[nodiscard]] Status CheckNodes();
  [[nodiscard]] Result<OptimizeViews::Response> Register(Run& run);
  [[nodiscard]] Status ExtractMesh(Run& run, std::uint32_t pose_revision);
  [[nodiscard]] Status WriteOutput(Run& run, const ViewPoses& poses);
  [[nodiscard]] Result<std::map<int, Transform>> PriorPoses(const Run& run) const;

  void Feedback(const Run& run, const std::string& state, double progress);
  [[nodiscard]] bool Cancelled();

  Setup setup_;
  const CellNodeConfig& config_;
  ros::NodeHandle nh_;
  ViewTracker tracker_;
  ros::Publisher frame_publisher_;
  ros::Publisher prior_publisher_;
  ros::Subscriber status_subscriber_;
  ros::Subscriber pose_state_subscriber_;
  ros::Subscriber model_state_subscriber_;
  ros::CallbackQueue client_queue_;  ///< of both clients
  ros::NodeHandle client_nh_;        ///< with that queue
  actionlib::SimpleActionClient<MoveToViewAction> move_client_;
  actionlib::SimpleActionClient<ScanViewAction> scan_client_;
  std::map<std::string, Clock::time_point> missing_since_;  ///< used by CheckNodes alone
  std::atomic<bool> stopping_{false};
  Server server_;  ///< last: its thread uses the rest
};

}  // namespace fringe_fusion::nodes
