#include <array>
#include <cmath>

#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "yaml_fields.hpp"

namespace fringe_fusion {
namespace {

using internal::QuotedYaml;
using internal::YamlFields;

constexpr std::array<PoseSource, 4> kSources = {PoseSource::kFile, PoseSource::kTf,
                                                PoseSource::kEpipolar, PoseSource::kRegistration};

void ReadSigmas(YamlFields& fields, Matrix6d& covariance) {
  if (fields.Has("covariance")) {
    std::array<double, 36> values{};
    fields.Required("covariance", values);
    covariance = Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(values.data());
    if (!(covariance == covariance.transpose())) fields.Reject("covariance must be symmetric");
    return;
  }
  double sigma_rotation_rad = 0.0;
  double sigma_translation_m = 0.0;
  fields.Required("sigma_rotation_rad", sigma_rotation_rad);
  fields.Required("sigma_translation_m", sigma_translation_m);
  if (!(sigma_rotation_rad >= 0.0)) {
    fields.Reject(fmt::format("sigma_rotation_rad = {} must be at least 0", sigma_rotation_rad));
  }
  if (!(sigma_translation_m >= 0.0)) {
    fields.Reject(fmt::format("sigma_translation_m = {} must be at least 0", sigma_translation_m));
  }
  covariance = PoseCovariance(sigma_rotation_rad, sigma_translation_m);
}

void ReadPose(YamlFields& fields, Pose& pose) {
  fields.Nested("T_object_camera", [&](YamlFields& transform) {
    internal::ReadTransform(transform, pose.T_object_camera);
  });
  ReadSigmas(fields, pose.covariance);
  std::string source = PoseSourceName(PoseSource::kFile);
  fields.Optional("source", source);
  pose.source = PoseSource::kNone;
  for (const PoseSource known : kSources) {
    if (source == PoseSourceName(known)) pose.source = known;
  }
  if (pose.source == PoseSource::kNone) {
    fields.Reject(fmt::format("source = {} must be file, tf, epipolar or registration", source));
  }
}

std::string PoseYaml(const Pose& pose) {
  std::string text =
      "prior:\n  T_object_camera: " + internal::TransformYaml(pose.T_object_camera) + "\n";
  const Matrix6d& covariance = pose.covariance;
  const double sigma_rotation_rad = std::sqrt(covariance(0, 0));
  const double sigma_translation_m = std::sqrt(covariance(3, 3));
  if (PoseCovariance(sigma_rotation_rad, sigma_translation_m) == covariance) {
    text += fmt::format("  sigma_rotation_rad: {}\n  sigma_translation_m: {}\n", sigma_rotation_rad,
                        sigma_translation_m);
  } else {
    // Symmetric: column order is row order.
    const std::vector<double> values(covariance.data(), covariance.data() + 36);
    text += fmt::format("  covariance: [{}]\n", fmt::join(values, ", "));
  }
  return text + fmt::format("  source: {}\n", PoseSourceName(pose.source));
}

template <typename T>
std::string ListYaml(const char* key, const std::vector<T>& values) {
  if (values.empty()) return "";
  return fmt::format("{}: [{}]\n", key, fmt::join(values, ", "));
}

Status CheckDescription(const ViewDescription& view, const std::string& path) {
  if (view.bit_depth < 0 || view.bit_depth > 16) {
    return Fail("{}: bit_depth = {} is outside [1, 16]", path, view.bit_depth);
  }
  for (const double exposure_s : view.exposures_s) {
    if (!(exposure_s >= 0.0)) return Fail("{}: exposures_s has {}, must be >= 0", path, exposure_s);
  }
  for (const double gain : view.gains) {
    if (!(gain > 0.0)) return Fail("{}: gains has {}, must be positive", path, gain);
  }
  return {};
}

}  // namespace

Result<ViewDescription> ReadViewDescriptionFile(const std::string& path) {
  const Result<YAML::Node> root = internal::LoadYaml(path);
  if (!root) return Forward(root);
  ViewDescription view;
  YamlFields fields(*root, path);
  fields.Optional("root", view.root);
  fields.Optional("frames", view.frame_files);
  fields.Optional("color", view.color_file);
  fields.Optional("bit_depth", view.bit_depth);
  fields.Optional("stamps_ns", view.stamps_ns);
  fields.Optional("exposures_s", view.exposures_s);
  fields.Optional("gains", view.gains);
  fields.Optional("joint_positions", view.joint_positions);
  fields.Optional("scan_id", view.scan_id);
  fields.Optional("camera_id", view.camera_id);
  if (fields.Has("prior")) {
    fields.Nested("prior", [&](YamlFields& prior) { ReadPose(prior, view.prior.emplace()); });
  }
  for (const auto stamp_ns : view.stamps_ns) {
    if (stamp_ns < 0) fields.Reject(fmt::format("stamps_ns has {}, must be >= 0", stamp_ns));
  }
  if (Status status = fields.Finish(); !status) return tl::unexpected<Error>(status.error());
  if (Status status = CheckDescription(view, path); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return view;
}

Status WriteViewDescriptionFile(const ViewDescription& view, const std::string& path) {
  if (Status status = CheckDescription(view, path); !status) return status;
  if (view.prior &&
      (!view.prior->T_object_camera.matrix().allFinite() || !view.prior->covariance.allFinite())) {
    return Fail("{}: prior has a value that is not finite", path);
  }
  if (view.prior && view.prior->source == PoseSource::kNone) {
    return Fail("{}: prior has the source 'none': it is no pose", path);
  }
  std::string text;
  if (!view.scan_id.empty()) text += "scan_id: " + QuotedYaml(view.scan_id) + "\n";
  if (!view.camera_id.empty()) text += "camera_id: " + QuotedYaml(view.camera_id) + "\n";
  if (!view.root.empty()) text += "root: " + QuotedYaml(view.root) + "\n";
  if (!view.frame_files.empty()) text += "frames:\n";
  for (const std::string& file : view.frame_files) text += "  - " + QuotedYaml(file) + "\n";
  if (!view.color_file.empty()) text += "color: " + QuotedYaml(view.color_file) + "\n";
  if (view.bit_depth != 0) text += fmt::format("bit_depth: {}\n", view.bit_depth);
  text += ListYaml("stamps_ns", view.stamps_ns);
  text += ListYaml("exposures_s", view.exposures_s);
  text += ListYaml("gains", view.gains);
  text += ListYaml("joint_positions", view.joint_positions);
  if (view.prior) text += PoseYaml(*view.prior);
  if (text.empty()) text = "{}\n";
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << text;
    return {};
  });
}

}  // namespace fringe_fusion
