#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <set>

#include "cell_yaml.hpp"
#include "fringe_fusion/io/device_files.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "yaml_fields.hpp"

namespace fringe_fusion {
namespace {

namespace fs = std::filesystem;

using internal::QuotedYaml;
using internal::YamlFields;

/// Where a data set keeps its files, as FrameFolder of a scan.
fs::path DataRoot(const std::string& path, const std::string& root) {
  constexpr const char* kShared = "shared/data/";
  const char* data = std::getenv("FRINGE_FUSION_DATA");
  const std::size_t at = root.find(kShared);
  if (data != nullptr && *data != '\0' && at != std::string::npos) {
    return (fs::path(data) / root.substr(at + std::string(kShared).size())).lexically_normal();
  }
  return (fs::path(path).parent_path() / root).lexically_normal();
}

/// x y z qx qy qz qw, a number each.
Result<Transform> ReadPoseFile(const std::string& path) {
  const Result<YAML::Node> root = internal::LoadYaml(path);
  if (!root) return Forward(root);
  YamlFields fields(*root, path);
  Eigen::Vector3d t;
  Eigen::Vector4d q;
  fields.Required("x", t[0]);
  fields.Required("y", t[1]);
  fields.Required("z", t[2]);
  fields.Required("qx", q[0]);
  fields.Required("qy", q[1]);
  fields.Required("qz", q[2]);
  fields.Required("qw", q[3]);
  if (Status status = fields.Finish(); !status) return tl::unexpected<Error>(status.error());
  const Result<Transform> T = MakeTransform(t, q);
  if (!T) return Fail("{}: {}", path, T.error().message);
  return T;
}

void ReadRobotSigmas(YamlFields& fields, Matrix6d& covariance) {
  if (fields.Has("covariance")) {
    std::array<double, 36> values{};
    fields.Required("covariance", values);
    covariance = Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(values.data());
    if (!(covariance == covariance.transpose())) fields.Reject("covariance must be symmetric");
    return;
  }
  if (!fields.Has("sigma_rotation_rad") && !fields.Has("sigma_translation_m")) return;
  std::array<double, 2> sigma{};
  fields.Required("sigma_rotation_rad", sigma[0]);
  fields.Required("sigma_translation_m", sigma[1]);
  for (const double value : sigma) {
    if (!(value > 0.0)) fields.Reject(fmt::format("sigma = {} must be positive", value));
  }
  covariance = PoseCovariance(sigma[0], sigma[1]);
}

Result<RobotStation> ReadStation(const YAML::Node& node, const std::string& owner,
                                 const fs::path& root) {
  RobotStation station;
  std::string pose_file;
  YamlFields fields(node, owner);
  fields.Required("name", station.pose.name);
  fields.Optional("image", station.image);
  fields.Optional("view", station.view);
  fields.Optional("pose_file", pose_file);
  const bool states_pose = fields.Has("T_base_flange");
  if (states_pose) {
    fields.Nested("T_base_flange", [&](YamlFields& transform) {
      internal::ReadTransform(transform, station.pose.T_base_flange);
    });
  }
  if (states_pose == !pose_file.empty()) {
    fields.Reject("exactly one of T_base_flange and pose_file is needed");
  }
  if (!station.image.empty() && station.view >= 0) fields.Reject("states both image and view");
  ReadRobotSigmas(fields, station.pose.covariance);
  if (Status status = fields.Finish(); !status) return tl::unexpected<Error>(status.error());
  if (!pose_file.empty()) {
    const Result<Transform> T = ReadPoseFile((root / pose_file).string());
    if (!T) return Forward(T);
    station.pose.T_base_flange = *T;
  }
  if (!station.image.empty()) station.image = (root / station.image).string();
  return station;
}

std::string CovarianceYaml6(const char* key, const Matrix6d& covariance) {
  std::string text = fmt::format("{}: [", key);
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      text += fmt::format("{}{}", row + column > 0 ? (column > 0 ? ", " : ",\n  ") : "",
                          covariance(row, column));
    }
  }
  return text + "]\n";
}

std::string OutcomesYaml(const char* key, const std::vector<DevicePoseOutcome>& poses) {
  std::string text = fmt::format("{}:\n", key);
  for (const DevicePoseOutcome& pose : poses) {
    text += fmt::format("  - {{name: {}, used: {}, rotation_miss_rad: {}, translation_miss_m: {}",
                        QuotedYaml(pose.name), pose.used, pose.rotation_miss_rad,
                        pose.translation_miss_m);
    if (!pose.reason.empty()) text += ", reason: " + QuotedYaml(pose.reason);
    text += "}\n";
  }
  return text;
}

Status WriteYaml(const std::string& text, const std::string& path) {
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << text;
    return {};
  });
}

constexpr const char* kCovarianceComment =
    "# covariance: of xi in T Exp(xi), rotation [rad] before translation [m], row after row.\n";

}  // namespace

Result<RobotPosesFile> LoadRobotPoses(const std::string& path) {
  const Result<YAML::Node> node = internal::LoadYaml(path);
  if (!node) return Forward(node);
  RobotPosesFile file;
  std::string mount = HandEyeMountName(file.mount);
  std::string root;
  YamlFields fields(*node, path);
  fields.Optional("mount", mount);
  fields.Optional("root", root);
  const std::vector<YAML::Node> poses = fields.List("poses");
  const Result<HandEyeMount> known = HandEyeMountFromName(mount);
  if (!known) fields.Reject(known.error().message);
  if (Status status = fields.Finish(); !status) return tl::unexpected<Error>(status.error());
  file.mount = *known;
  std::set<std::string> names;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    auto station =
        ReadStation(poses[i], fmt::format("{}: poses[{}]", path, i), DataRoot(path, root));
    if (!station) return Forward(station);
    if (!names.insert(station->pose.name).second) {
      return Fail("{}: poses[{}]: the name '{}' occurs twice", path, i, station->pose.name);
    }
    file.stations.push_back(std::move(*station));
  }
  return file;
}

Result<std::vector<TurntableStop>> LoadTurntableStops(const std::string& path) {
  const Result<YAML::Node> node = internal::LoadYaml(path);
  if (!node) return Forward(node);
  YamlFields fields(*node, path);
  const std::vector<YAML::Node> list = fields.List("stops");
  if (Status status = fields.Finish(); !status) return tl::unexpected<Error>(status.error());
  std::vector<TurntableStop> stops;
  for (std::size_t i = 0; i < list.size(); ++i) {
    TurntableStop stop;
    YamlFields stop_fields(list[i], fmt::format("{}: stops[{}]", path, i));
    stop_fields.Required("name", stop.name);
    stop_fields.Required("angle_rad", stop.angle_rad);
    stop_fields.Optional("sigma_angle_rad", stop.sigma_angle_rad);
    if (Status status = stop_fields.Finish(); !status) {
      return tl::unexpected<Error>(status.error());
    }
    stops.push_back(std::move(stop));
  }
  return stops;
}

Result<CellCalibration> ReadRig(const std::string& path) {
  const Result<YAML::Node> node = internal::LoadYaml(path);
  if (!node) return Forward(node);
  if (!node->IsMap() || (*node)["projector"].IsDefined()) return ReadCellCalibration(path);
  CellCalibration rig;
  YamlFields fields(*node, path);
  fields.Nested("camera", [&](YamlFields& camera) { internal::ReadModel(camera, rig.camera); });
  Status status = fields.Finish();
  if (status) status = Validate(rig.camera, path + ": camera");
  if (!status) return tl::unexpected<Error>(status.error());
  return rig;
}

Status WriteHandEye(const HandEyeResult& result, const std::string& path) {
  std::string text =
      "# Hand-eye. The carrier of the camera is the flange (eye_in_hand) or the base "
      "(eye_to_hand);\n"
      "# the target is in the other one. p_carrier = T_carrier_camera p_camera [m].\n";
  text += kCovarianceComment;
  text += fmt::format("mount: {}\n", HandEyeMountName(result.mount));
  text += "T_carrier_camera: " + internal::TransformYaml(result.T_carrier_camera) + "\n";
  text += CovarianceYaml6("covariance_camera", result.covariance_camera);
  text += "T_other_target: " + internal::TransformYaml(result.T_other_target) + "\n";
  text += CovarianceYaml6("covariance_target", result.covariance_target);
  if (result.camera.width > 0) {
    text += "camera: " + internal::ModelYaml(result.camera) + "\n";
    text += fmt::format("sigma_camera: [{}]  # fx fy cx cy k1 k2 p1 p2 k3; 0: taken as stated\n",
                        fmt::join(result.sigma_camera, ", "));
  }
  text += fmt::format("predicted_error_m: {}\ntarget_spread_m: {}\n", result.predicted_error_m,
                      result.target_spread_m);
  text += "verdict: " + QuotedYaml(result.verdict.words) + "\n";
  return WriteYaml(text + OutcomesYaml("poses", result.poses), path);
}

Status WriteTurntable(const TurntableResult& result, const std::string& path) {
  const Eigen::Vector3d& p = result.point_camera;
  const Eigen::Vector3d& d = result.direction_camera;
  std::string text =
      "# Axis of a turntable in the camera's optical frame [m]: z of the base, angles grow\n"
      "# right-handed about it. Rotation about z and translation along it are conventions.\n";
  text += kCovarianceComment;
  text += fmt::format("point_camera: [{}, {}, {}]\ndirection_camera: [{}, {}, {}]\n", p.x(), p.y(),
                      p.z(), d.x(), d.y(), d.z());
  text += "T_camera_base: " + internal::TransformYaml(result.T_camera_base) + "\n";
  text += CovarianceYaml6("covariance_base", result.covariance_base);
  text += fmt::format("sigma_direction_rad: {}\nsigma_point_m: {}\n", result.sigma_direction_rad,
                      result.sigma_point_m);
  text += fmt::format("angles_rad: [{}]\n", fmt::join(result.angles_rad, ", "));
  text += "verdict: " + QuotedYaml(result.verdict.words) + "\n";
  return WriteYaml(text + OutcomesYaml("stops", result.stops), path);
}

}  // namespace fringe_fusion
