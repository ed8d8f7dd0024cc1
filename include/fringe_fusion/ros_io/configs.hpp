#pragma once

#include <ros/node_handle.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/ros_io/known_parameters.hpp"

namespace fringe_fusion::ros_io {

namespace internal {
/// Reads the fields of a Config from a parameter namespace; every key is required.
class ParameterReader {
 public:
  explicit ParameterReader(const ros::NodeHandle& nh) : nh_(nh) {}

  template <typename T, typename... Bounds>
  void operator()(const char* name, T& value, Bounds... /*bounds*/) {
    Read(name, value);
  }
  template <std::size_t N>
  void operator()(const char* name, std::array<double, N>& values, double /*low*/,
                  double /*high*/) {
    std::vector<double> list;
    Read(name, list);
    if (!status_) return;
    if (list.size() != N) {
      status_ =
          Fail("parameter {} has {} values, must have {}", nh_.resolveName(name), list.size(), N);
      return;
    }
    std::copy(list.begin(), list.end(), values.begin());
  }

  [[nodiscard]] const Status& status() const { return status_; }

 private:
  template <typename T>
  void Read(const char* name, T& value) {
    DeclareParameter(nh_.resolveName(name));
    if (!status_) return;
    if (!nh_.hasParam(name)) {
      status_ = Fail("required parameter {} is missing", nh_.resolveName(name));
    } else if (!nh_.getParam(name, value)) {
      status_ = Fail("parameter {} has a value of the wrong type", nh_.resolveName(name));
    }
  }

  ros::NodeHandle nh_;
  Status status_;
};
}  // namespace internal

/// Loads one stage's Config from the parameters below `nh`, e.g. ~phase, and checks its bounds.
/// @return error naming the parameter, its value and the bounds.
template <typename Config>
[[nodiscard]] Result<Config> LoadConfig(const ros::NodeHandle& nh) {
  Config config;
  internal::ParameterReader reader(nh);
  config.Visit(reader);
  if (!reader.status()) return tl::unexpected<Error>(reader.status().error());
  if (Status status = CheckBounds(config, nh.getNamespace()); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return config;
}

/// Makes known the parameters of a Config that is not read now, e.g. of a backend not chosen.
template <typename Config>
void DeclareConfig(const ros::NodeHandle& nh) {
  Config config;
  config.Visit([&nh](const char* name, auto&&... /*value_and_bounds*/) {
    DeclareParameter(nh.resolveName(name));
  });
}

/// One required parameter of a node. @return error naming it.
template <typename T>
[[nodiscard]] Result<T> RequiredParameter(const ros::NodeHandle& nh, const std::string& name) {
  T value{};
  internal::ParameterReader reader(nh);
  reader(name.c_str(), value);
  if (!reader.status()) return tl::unexpected<Error>(reader.status().error());
  return value;
}

}  // namespace fringe_fusion::ros_io
