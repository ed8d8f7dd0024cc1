#include "yaml_fields.hpp"

#include <array>

#include "fringe_fusion/io/file.hpp"

namespace fringe_fusion::internal {
namespace {

using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

}  // namespace

std::string Shown(const YAML::Node& node) {
  YAML::Emitter emitter;
  emitter.SetSeqFormat(YAML::Flow);
  emitter.SetMapFormat(YAML::Flow);
  emitter << node;
  std::string text = emitter.c_str();
  for (char& c : text) c = c == '\n' ? ' ' : c;
  if (text.size() > 80) text = text.substr(0, 77) + "...";
  return text;
}

Result<YAML::Node> LoadYaml(const std::string& path) {
  const Result<std::string> text = ReadFile(path);
  if (!text) return Forward(text);
  try {
    return YAML::Load(*text);
  } catch (const YAML::Exception& exception) {
    return Fail("{}: line {}: {}", path, exception.mark.line + 1, exception.msg);
  }
}

YamlFields::YamlFields(const YAML::Node& node, std::string owner)
    : node_(node), owner_(std::move(owner)) {
  if (!node_.IsDefined() || node_.IsNull()) {
    node_ = YAML::Node(YAML::NodeType::Map);
  } else if (!node_.IsMap()) {
    status_ = Fail("{}: must be a map of keys and values, not '{}'", owner_, Shown(node_));
  }
}

bool YamlFields::Has(const char* key) const { return ok() && node_[key].IsDefined(); }

bool YamlFields::Find(const char* key, bool required) {
  known_.insert(key);
  if (!status_) return false;
  if (node_[key].IsDefined()) return true;
  if (required) status_ = Fail("{}: required key '{}' is missing", owner_, key);
  return false;
}

void YamlFields::RejectValue(const char* key, const std::string& expected) {
  status_ = Fail("{}: {} = {} must be {}", owner_, key, Shown(node_[key]), expected);
}

void YamlFields::Reject(const std::string& reason) {
  if (status_) status_ = Fail("{}: {}", owner_, reason);
}

void YamlFields::Nested(const char* key, const std::function<void(YamlFields& fields)>& read) {
  if (!Find(key, true)) return;
  YamlFields nested(node_[key], owner_ + ": " + key);
  read(nested);
  status_ = nested.Finish();
}

std::vector<YAML::Node> YamlFields::List(const char* key) {
  if (!Find(key, true)) return {};
  const YAML::Node list = node_[key];
  if (!list.IsSequence()) {
    RejectValue(key, "a list");
    return {};
  }
  return {list.begin(), list.end()};
}

Status YamlFields::Finish() const {
  if (!status_) return status_;
  std::set<std::string> seen;
  for (const auto& entry : node_) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : Shown(entry.first);
    if (known_.count(key) == 0) return Fail("{}: unknown key '{}'", owner_, key);
    if (!seen.insert(key).second) return Fail("{}: the key '{}' occurs twice", owner_, key);
  }
  return {};
}

void ReadTransform(YamlFields& fields, Transform& T) {
  std::array<double, 3> translation{};
  std::array<double, 4> quaternion{};
  std::array<double, 9> rotation{};
  fields.Required("translation_m", translation);
  fields.Required("quaternion_xyzw", quaternion);
  fields.Optional("rotation_row_major", rotation);
  if (!fields.ok()) return;
  const Result<Transform> made =
      MakeTransform(Eigen::Vector3d(translation.data()), Eigen::Vector4d(quaternion.data()));
  if (!made) {
    fields.Reject(made.error().message);
    return;
  }
  T = *made;
  if (!fields.Has("rotation_row_major")) return;
  const Eigen::Map<const RowMajor3d> exact(rotation.data());
  const double difference = (exact - T.linear()).cwiseAbs().maxCoeff();
  if (!(difference <= 1e-9)) {
    fields.Reject(
        fmt::format("rotation_row_major is off by {} from quaternion_xyzw, limit 1e-9; after an "
                    "edit of the quaternion remove rotation_row_major",
                    difference));
    return;
  }
  T.linear() = exact;
}

std::string TransformYaml(const Transform& T) {
  const Eigen::Vector3d t = T.translation();
  const Eigen::Vector4d q = QuaternionXyzw(T);
  std::string yaml = fmt::format("{{translation_m: [{}, {}, {}], quaternion_xyzw: [{}, {}, {}, {}]",
                                 t.x(), t.y(), t.z(), q[0], q[1], q[2], q[3]);
  // A quaternion does not give every matrix back to the last bit, but products are compared by
  // their bytes and calibrations by a fingerprint of the matrix.
  const Result<Transform> again = MakeTransform(t, q);
  if (!again || again->linear() != T.linear()) {
    const RowMajor3d rotation = T.linear();
    const std::vector<double> values(rotation.data(), rotation.data() + 9);
    yaml += fmt::format(", rotation_row_major: [{}]", fmt::join(values, ", "));
  }
  return yaml + "}";
}

std::string QuotedYaml(const std::string& text) {
  YAML::Emitter emitter;
  emitter << YAML::DoubleQuoted << text;
  return emitter.c_str();
}

}  // namespace fringe_fusion::internal
