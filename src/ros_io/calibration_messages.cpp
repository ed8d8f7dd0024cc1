#include "fringe_fusion/ros_io/calibration_messages.hpp"

#include <algorithm>
#include <cmath>

#include "fringe_fusion/ros_io/geometry_messages.hpp"

namespace fringe_fusion::ros_io {
namespace {

using visualization_msgs::Marker;

CalibrationPose PoseMessage(const PoseOutcome& outcome) {
  CalibrationPose pose;
  pose.name = outcome.name;
  pose.used = static_cast<std::uint8_t>(outcome.used);
  pose.reason = outcome.reason;
  pose.pose = ToMessage(Pose{outcome.T_camera_target, outcome.covariance, PoseSource::kNone});
  pose.num_points_camera = static_cast<std::uint32_t>(outcome.num_points_camera);
  pose.num_points_projector = static_cast<std::uint32_t>(outcome.num_points_projector);
  pose.rms_camera = outcome.rms_camera_px;
  pose.rms_projector = outcome.rms_projector_px;
  return pose;
}

CalibrationResidual ResidualMessage(const CellResidual& residual) {
  CalibrationResidual message;
  message.pose = static_cast<std::uint32_t>(residual.sighting);
  message.point = static_cast<std::uint32_t>(residual.point);
  message.in_projector = static_cast<std::uint8_t>(residual.in_projector);
  message.x = static_cast<float>(residual.pixel.x());
  message.y = static_cast<float>(residual.pixel.y());
  message.residual_x = static_cast<float>(residual.residual_px.x());
  message.residual_y = static_cast<float>(residual.residual_px.y());
  return message;
}

std_msgs::ColorRGBA LineColor(float r, float g, float b) {
  std_msgs::ColorRGBA color;
  color.r = r;
  color.g = g;
  color.b = b;
  color.a = 1.0F;
  return color;
}

geometry_msgs::Point PointMessage(const Eigen::Vector3d& p) {
  geometry_msgs::Point point;
  point.x = p.x();
  point.y = p.y();
  point.z = p.z();
  return point;
}

Marker LineMarker(const std_msgs::Header& header, const std::string& name, double width_m) {
  Marker marker;
  marker.header = header;
  marker.ns = name;
  marker.type = Marker::LINE_LIST;
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.scale.x = width_m;
  marker.color = LineColor(1.0F, 1.0F, 1.0F);
  return marker;
}

void AddLine(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
             const std_msgs::ColorRGBA& color, Marker& marker) {
  for (const Eigen::Vector3d& end : {from, to}) {
    marker.points.push_back(PointMessage(end));
    marker.colors.push_back(color);
  }
}

/// The rectangle about all points of the target, and its diagonal from point 0, so that the way it
/// lies is seen.
void AddOutline(const std::vector<Eigen::Vector3d>& points, const Transform& T_camera_target,
                const std_msgs::ColorRGBA& color, Marker& marker) {
  Eigen::Vector3d low = points.front();
  Eigen::Vector3d high = points.front();
  for (const Eigen::Vector3d& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  const std::array<Eigen::Vector3d, 4> corners = {
      T_camera_target * Eigen::Vector3d(low.x(), low.y(), 0.0),
      T_camera_target * Eigen::Vector3d(high.x(), low.y(), 0.0),
      T_camera_target * Eigen::Vector3d(high.x(), high.y(), 0.0),
      T_camera_target * Eigen::Vector3d(low.x(), high.y(), 0.0)};
  for (std::size_t k = 0; k < 4; ++k) AddLine(corners[k], corners[(k + 1) % 4], color, marker);
  AddLine(corners[0], 0.5 * (corners[0] + corners[2]), color, marker);
}

/// A residual at its point: what it measures there across the ray, camera frame [m].
Eigen::Vector3d ResidualAt(const CellCalibration& cell, const CellResidual& residual,
                           const Eigen::Vector3d& point_camera) {
  const CameraModel& model = residual.in_projector ? cell.projector : cell.camera;
  const Eigen::Vector3d point =
      residual.in_projector ? cell.T_projector_camera * point_camera : point_camera;
  const Eigen::Vector3d across(residual.residual_px.x() / model.fx * point.z(),
                               residual.residual_px.y() / model.fy * point.z(), 0.0);
  return residual.in_projector ? cell.T_projector_camera.linear().transpose() * across : across;
}

Marker ResidualMarker(const CellCalibrationResult& result, const std_msgs::Header& header,
                      double enlarge) {
  Marker marker = LineMarker(header, "residuals", 3e-4);
  const std_msgs::ColorRGBA camera = LineColor(0.3F, 0.6F, 1.0F);
  const std_msgs::ColorRGBA projector = LineColor(1.0F, 0.6F, 0.1F);
  for (const CellResidual& residual : result.residuals) {
    const auto pose = static_cast<std::size_t>(residual.sighting);
    const Eigen::Vector3d point = result.poses[pose].T_camera_target *
                                  (result.target_points[static_cast<std::size_t>(residual.point)] +
                                   result.stage_shifts_m[pose]);
    AddLine(point, point + enlarge * ResidualAt(result.calibration, residual, point),
            residual.in_projector ? projector : camera, marker);
  }
  return marker;
}

Marker WordsMarker(const CellCalibrationResult& result, const std_msgs::Header& header) {
  Marker words = LineMarker(header, "next_pose_words", 0.0);
  words.type = Marker::TEXT_VIEW_FACING;
  words.text = result.next.words;
  words.scale.x = 0.0;
  words.scale.z = 0.008;
  words.color = LineColor(1.0F, 0.9F, 0.2F);
  words.pose = ToPoseMessage(result.next.T_camera_target);
  return words;
}

}  // namespace

CalibrationState ToMessage(const std::vector<TargetSighting>& sightings, const Coverage& coverage,
                           const std::string& verdict, const std_msgs::Header& header) {
  CalibrationState state;
  state.header = header;
  for (const TargetSighting& sighting : sightings) {
    CalibrationPose pose;
    pose.name = sighting.name;
    pose.pose.pose.orientation.w = 1.0;
    pose.num_points_camera = static_cast<std::uint32_t>(sighting.points.size());
    pose.num_points_projector = static_cast<std::uint32_t>(
        std::count_if(sighting.points.begin(), sighting.points.end(),
                      [](const PointSighting& point) { return point.has_projector; }));
    state.poses.push_back(pose);
  }
  state.coverage_camera = coverage.camera_ratio;
  state.coverage_projector = coverage.projector_ratio;
  state.gaps = coverage.gaps;
  state.verdict = verdict;
  state.next_pose = fmt::format(
      "place the target elsewhere in both images and tilt it by about 30 deg another way{}{}",
      coverage.gaps.empty() ? "" : ": ", coverage.gaps);
  state.next_target_pose.orientation.w = 1.0;
  return state;
}

CalibrationState ToMessage(const CellCalibrationResult& result, const std_msgs::Header& header) {
  CalibrationState state;
  state.header = header;
  for (const PoseOutcome& outcome : result.poses) state.poses.push_back(PoseMessage(outcome));
  state.coverage_camera = result.coverage.camera_ratio;
  state.coverage_projector = result.coverage.projector_ratio;
  state.gaps = result.coverage.gaps;
  state.next_pose = result.next.words;
  state.next_target_pose = ToPoseMessage(result.next.T_camera_target);
  state.solved = 1;
  state.acceptable = static_cast<std::uint8_t>(result.verdict.accepted);
  state.verdict = result.verdict.words;
  for (const CellResidual& residual : result.residuals) {
    state.residuals.push_back(ResidualMessage(residual));
  }
  const std::array<double, kNumCellParameters> values = CellParameterValues(result.calibration);
  for (int k = 0; k < kNumCellParameters; ++k) {
    state.parameters.push_back(CellParameterName(k));
    state.values.push_back(values[static_cast<std::size_t>(k)]);
    state.sigmas.push_back(std::sqrt(result.covariance(k, k)));
  }
  state.rms_camera = result.rms_camera_px;
  state.rms_projector = result.rms_projector_px;
  state.predicted_error = result.next.error_before_m;
  state.calibration_id = CalibrationId(result.calibration);
  return state;
}

visualization_msgs::MarkerArray NoMarkers(const std_msgs::Header& header) {
  visualization_msgs::MarkerArray markers;
  Marker clear = LineMarker(header, "", 0.0);
  clear.action = Marker::DELETEALL;
  markers.markers.push_back(clear);
  return markers;
}

visualization_msgs::MarkerArray ToMarkers(const CellCalibrationResult& result,
                                          const std_msgs::Header& header, double enlarge) {
  visualization_msgs::MarkerArray markers = NoMarkers(header);
  Marker poses = LineMarker(header, "poses", 8e-4);
  for (const PoseOutcome& pose : result.poses) {
    AddOutline(result.target_points, pose.T_camera_target,
               pose.used ? LineColor(0.2F, 0.8F, 0.3F) : LineColor(0.9F, 0.2F, 0.2F), poses);
  }
  Marker next = LineMarker(header, "next_pose", 1.2e-3);
  AddOutline(result.target_points, result.next.T_camera_target, LineColor(1.0F, 0.9F, 0.2F), next);
  for (const Marker& marker : {poses, ResidualMarker(result, header, enlarge), next}) {
    if (!marker.points.empty()) markers.markers.push_back(marker);
  }
  markers.markers.push_back(WordsMarker(result, header));
  return markers;
}

}  // namespace fringe_fusion::ros_io
