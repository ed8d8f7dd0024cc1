#pragma once

#include <yaml-cpp/yaml.h>

#include <array>
#include <set>
#include <string>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

/// What a key that a file does not have means.
enum class MissingKeys { kAreErrors, kTakeDefaults };

namespace internal {
/// Reads the fields of a Config from a YAML map; unknown keys are errors.
class YamlReader {
 public:
  YamlReader(const YAML::Node& node, std::string owner, MissingKeys missing)
      : node_(node), owner_(std::move(owner)), missing_(missing) {}

  template <typename T, typename... Bounds>
  void operator()(const char* name, T& value, Bounds... /*bounds*/) {
    known_.insert(name);
    if (!status_) return;
    const YAML::Node field = node_[name];
    if (!field) {
      if (missing_ == MissingKeys::kTakeDefaults) return;
      status_ = Fail("{}: required key '{}' is missing", owner_, name);
      return;
    }
    try {
      value = field.as<T>();
    } catch (const YAML::Exception&) {
      status_ = Fail("{}: key '{}' has the value '{}', must be {}", owner_, name, Shown(field),
                     Expected(value));
    }
  }

  [[nodiscard]] Status Finish() const {
    if (!status_) return status_;
    std::set<std::string> seen;
    for (const auto& entry : node_) {
      const auto key = entry.first.as<std::string>();
      if (known_.count(key) == 0) return Fail("{}: unknown key '{}'", owner_, key);
      if (!seen.insert(key).second) return Fail("{}: the key '{}' occurs twice", owner_, key);
    }
    return {};
  }

 private:
  static std::string Shown(const YAML::Node& node) {
    YAML::Emitter emitter;
    emitter.SetSeqFormat(YAML::Flow);
    emitter.SetMapFormat(YAML::Flow);
    emitter << node;
    return emitter.c_str();
  }
  static std::string Expected(const bool& /*value*/) { return "true or false"; }
  static std::string Expected(const int& /*value*/) { return "a whole number"; }
  static std::string Expected(const double& /*value*/) { return "a number"; }
  static std::string Expected(const std::string& /*value*/) { return "a text"; }
  template <std::size_t N>
  static std::string Expected(const std::array<double, N>& /*value*/) {
    return fmt::format("a list of {} numbers", N);
  }

  YAML::Node node_;
  std::string owner_;
  MissingKeys missing_;
  std::set<std::string> known_;
  Status status_;
};
}  // namespace internal

/// Loads a stage's Config from a YAML file, e.g. config/phase.yaml, and checks its bounds.
/// @param missing kTakeDefaults: the file states what differs from the defaults of the struct.
/// @return error naming file, key, value and bound.
template <typename Config>
[[nodiscard]] Result<Config> LoadConfigFile(const std::string& path,
                                            MissingKeys missing = MissingKeys::kAreErrors) {
  Config config;
  try {
    YAML::Node root = YAML::LoadFile(path);
    // A file of comments alone states nothing.
    if (root.IsNull() && missing == MissingKeys::kTakeDefaults) root = YAML::Load("{}");
    if (!root.IsMap()) return Fail("{}: not a YAML map", path);
    internal::YamlReader reader(root, path, missing);
    config.Visit(reader);
    if (Status status = reader.Finish(); !status) return tl::unexpected<Error>(status.error());
  } catch (const YAML::BadFile&) {
    return Fail("{}: cannot be read", path);
  } catch (const YAML::Exception& exception) {
    return Fail("{}: {}", path, exception.what());
  }
  if (Status status = CheckBounds(config, path); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return config;
}

}  // namespace fringe_fusion
