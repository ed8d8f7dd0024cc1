#include <array>

#include "fringe_fusion/io/device_files.hpp"
#include "fringe_fusion/io/file.hpp"
#include "yaml_fields.hpp"

namespace fringe_fusion {
namespace {

using internal::YamlFields;

constexpr const char* kTurntableEdge = "turntable_base";

void ReadEdge(YamlFields& fields, FrameEdge& edge) {
  fields.Required("parent_frame", edge.parent_frame);
  fields.Required("child_frame", edge.child_frame);
  std::array<double, 3> translation{};
  std::array<double, 4> quaternion{};
  fields.Required("translation_m", translation);
  fields.Required("quaternion_xyzw", quaternion);
  if (!fields.ok()) return;
  const Result<Transform> T =
      MakeTransform(Eigen::Vector3d(translation.data()), Eigen::Vector4d(quaternion.data()));
  if (!T) {
    fields.Reject(T.error().message);
    return;
  }
  edge.T_parent_child = *T;
}

}  // namespace

Result<std::vector<FrameEdge>> ReadFrameEdges(const std::string& path) {
  const Result<YAML::Node> root = internal::LoadYaml(path);
  if (!root) return Forward(root);
  std::vector<std::string> names;
  std::vector<FrameEdge> edges;
  YamlFields fields(*root, path);
  fields.Required("names", names);
  for (const std::string& name : names) {
    FrameEdge edge;
    edge.name = name;
    fields.Nested(name.c_str(), [&](YamlFields& nested) { ReadEdge(nested, edge); });
    edges.push_back(std::move(edge));
  }
  if (Status status = fields.Finish(); !status) return tl::unexpected<Error>(status.error());
  return edges;
}

Status WriteFrameEdges(const std::vector<FrameEdge>& edges, const std::string& path) {
  std::vector<std::string> names;
  for (const FrameEdge& edge : edges) names.push_back(edge.name);
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << "# Calibrated edges of the tf tree, for ~edges of scanner_node.\n"
           << fmt::format("names: [{}]\n", fmt::join(names, ", "));
    for (const FrameEdge& edge : edges) {
      const Eigen::Vector3d t = edge.T_parent_child.translation();
      const Eigen::Vector4d q = QuaternionXyzw(edge.T_parent_child);
      stream << fmt::format(
          "{}:\n  parent_frame: {}\n  child_frame: {}\n  translation_m: [{}, {}, {}]\n"
          "  quaternion_xyzw: [{}, {}, {}, {}]\n",
          edge.name, edge.parent_frame, edge.child_frame, t.x(), t.y(), t.z(), q[0], q[1], q[2],
          q[3]);
    }
    return {};
  });
}

void SetFrameEdge(const FrameEdge& edge, std::vector<FrameEdge>& edges) {
  for (FrameEdge& known : edges) {
    if (known.name != edge.name) continue;
    known = edge;
    return;
  }
  edges.push_back(edge);
}

FrameEdge ScannerEdge(const HandEyeResult& result, const std::string& flange_frame,
                      const std::string& base_frame) {
  const bool in_hand = result.mount == HandEyeMount::kEyeInHand;
  return {"scanner", in_hand ? flange_frame : base_frame, "scanner", result.T_carrier_camera};
}

FrameEdge TurntableBaseEdge(const TurntableResult& result, const Transform& T_parent_camera,
                            const std::string& parent, const std::vector<FrameEdge>& edges) {
  FrameEdge edge{kTurntableEdge, parent, kTurntableEdge, T_parent_camera * result.T_camera_base};
  for (const FrameEdge& known : edges) {
    if (known.name != kTurntableEdge || known.parent_frame != parent) continue;
    // The origin's foot on the new axis, and the smallest rotation that turns the old z into it.
    const Eigen::Vector3d axis = edge.T_parent_child.linear().col(2);
    const Eigen::Vector3d point = edge.T_parent_child.translation();
    const Eigen::Vector3d origin = known.T_parent_child.translation();
    edge.child_frame = known.child_frame;
    edge.T_parent_child.translation() = point + axis * axis.dot(origin - point);
    edge.T_parent_child.linear() =
        RotationBetween(known.T_parent_child.linear().col(2), axis) * known.T_parent_child.linear();
  }
  return edge;
}

}  // namespace fringe_fusion
