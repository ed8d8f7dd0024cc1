#include "nodes/cell_task.hpp"

#include <sensor_msgs/Image.h>
#include <visualization_msgs/MarkerArray.h>

#include <filesystem>
#include <utility>

#include "fringe_fusion/inspection/calibration_report.hpp"
#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/ros_io/calibration_messages.hpp"
#include "fringe_fusion/ros_io/picture_messages.hpp"

namespace fringe_fusion::nodes {
namespace {

DeviceSizes SizesOf(const CellCalibration& calibration) {
  return {calibration.camera.width, calibration.camera.height, calibration.projector.width,
          calibration.projector.height};
}

std::string FileIn(const std::string& folder, const std::string& name) {
  return (std::filesystem::path(folder) / name).string();
}

}  // namespace

CellTask::CellTask(ros::NodeHandle nh, Setup setup, CalibrationFiles& files)
    : setup_(std::move(setup)),
      files_(files),
      session_(setup_.target, SizesOf(setup_.in_force), setup_.calibration) {
  state_publisher_ = nh.advertise<CalibrationState>("calibration_state", 1, /*latch=*/true);
  marker_publisher_ =
      nh.advertise<visualization_msgs::MarkerArray>("calibration_markers", 1, /*latch=*/true);
  camera_picture_publisher_ =
      nh.advertise<sensor_msgs::Image>("calibration_residuals/camera", 1, /*latch=*/true);
  projector_picture_publisher_ =
      nh.advertise<sensor_msgs::Image>("calibration_residuals/projector", 1, /*latch=*/true);
  (void)Update();
}

std::vector<std::string> CellTask::Names() const {
  std::vector<std::string> names;
  for (const TargetSighting& sighting : session_.sightings()) names.push_back(sighting.name);
  return names;
}

Result<std::string> CellTask::Add(const SightedTarget& seen) {
  if (Status status = session_.Add(seen.sighting); !status) return Forward(status);
  solved_ = false;
  last_stamp_ns_ = seen.stamp_ns;
  return fmt::format("pose '{}', {} points: {}", seen.sighting.name, seen.sighting.points.size(),
                     Update());
}

Result<std::string> CellTask::Remove(const std::string& name) {
  if (Status status = session_.Remove(name); !status) return Forward(status);
  solved_ = false;
  return fmt::format("{} poses are left: {}", session_.sightings().size(), Update());
}

void CellTask::Reset() {
  session_.Clear();
  solved_ = false;
  (void)Update();
}

Result<std::string> CellTask::Solve(const std::string& report_folder) {
  const auto& result = session_.Solve();
  const std::string words = Update();
  if (!result) return Forward(result);
  solved_ = true;
  if (report_folder.empty()) return words;
  Status status = MakeFolder(report_folder);
  if (status) status = WriteCalibrationReport(*result, {}, report_folder);
  if (!status) return Forward(status);
  return words;
}

Result<std::string> CellTask::Accept(bool force) {
  if (!solved_) {
    return Fail("there is no solution of the {} poses: solve first", session_.sightings().size());
  }
  const auto& solved = session_.Solve();
  if (!solved) return Forward(solved);
  if (!solved->verdict.accepted && !force) {
    return Fail("the earlier calibration stays in force: {}",
                fmt::join(solved->verdict.reasons, "; "));
  }
  CellCalibrationResult result = *solved;
  result.calibration.camera_serial = setup_.in_force.camera_serial;
  result.calibration.projector_serial = setup_.in_force.projector_serial;
  result.calibration.date = UtcDate(last_stamp_ns_);
  const Status put = files_.Put({Paths(), [&] { return Write(result); }, {}});
  if (!put) return Forward(put);
  setup_.in_force = result.calibration;
  return fmt::format("calibration {} is in force: {}", CalibrationId(result.calibration),
                     setup_.calibration_file);
}

CalibrateCellResult CellTask::Message() const {
  CalibrateCellResult message;
  message.calibration = state_;
  return message;
}

std::string CellTask::Update() {
  const std::vector<TargetSighting>& sightings = session_.sightings();
  const auto min_poses = static_cast<std::size_t>(setup_.calibration.min_poses);
  std::string why = fmt::format("{} of at least {} poses", sightings.size(), min_poses);
  if (sightings.size() >= min_poses) {
    const auto& result = session_.Solve();
    if (result) {
      state_ = ros_io::ToMessage(*result, Header());
      state_publisher_.publish(state_);
      marker_publisher_.publish(ros_io::ToMarkers(*result, Header(), setup_.marker_enlarge));
      PublishPictures(*result);
      return result->verdict.words;
    }
    why = result.error().message;
  }
  const Coverage coverage =
      CoverageOf(sightings, session_.sizes(), setup_.calibration.min_coverage_ratio);
  state_ = ros_io::ToMessage(sightings, coverage, why, Header());
  state_publisher_.publish(state_);
  marker_publisher_.publish(ros_io::NoMarkers(Header()));
  return fmt::format("{}; {}", why, state_.next_pose);
}

void CellTask::PublishPictures(const CellCalibrationResult& result) {
  camera_picture_publisher_.publish(
      ros_io::ToMessage(DrawResidualField(result, /*in_projector=*/false), Header()));
  projector_picture_publisher_.publish(
      ros_io::ToMessage(DrawResidualField(result, /*in_projector=*/true), Header()));
}

std_msgs::Header CellTask::Header() const {
  std_msgs::Header header;
  header.stamp = ros::Time::now();
  header.frame_id = setup_.camera_frame;
  return header;
}

std::vector<std::string> CellTask::Paths() const {
  std::vector<std::string> paths{setup_.calibration_file};
  if (setup_.camera_info_folder.empty()) return paths;
  paths.push_back(FileIn(setup_.camera_info_folder, "camera.yaml"));
  paths.push_back(FileIn(setup_.camera_info_folder, "projector.yaml"));
  return paths;
}

Status CellTask::Write(const CellCalibrationResult& result) const {
  if (!setup_.camera_info_folder.empty()) {
    const std::vector<std::string> paths = Paths();
    Status status = MakeFolder(setup_.camera_info_folder);
    if (status) status = WriteCameraInfo(result.calibration.camera, "camera", paths[1]);
    if (status) status = WriteCameraInfo(result.calibration.projector, "projector", paths[2]);
    if (!status) return status;
  }
  return WriteCalibratedCell(result, setup_.calibration_file);
}

}  // namespace fringe_fusion::nodes
