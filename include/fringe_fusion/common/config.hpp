#pragma once

#include <array>
#include <string>
#include <type_traits>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

// Every stage has one Config struct with a member template
//
//   template <typename Visitor> void Visit(Visitor&& field) {
//     field("min_modulation_dn", min_modulation_dn, 0.0, 65535.0);   // number with bounds
//     field("align", align);                                         // bool or string
//   }
//
// One description serves validation, YAML files (io/config_yaml.hpp) and the ROS parameter server
// (ros_io/configs.hpp), so names and bounds cannot drift apart.

namespace internal {
/// Collects the first violated bound of a Config.
class BoundsCheck {
 public:
  explicit BoundsCheck(std::string owner) : owner_(std::move(owner)) {}

  void operator()(const char* name, int value, int low, int high);
  void operator()(const char* name, double value, double low, double high);
  template <std::size_t N>
  void operator()(const char* name, const std::array<double, N>& values, double low, double high) {
    for (const double value : values) (*this)(name, value, low, high);
  }
  void operator()(const char* /*name*/, const bool& /*value*/) {}
  void operator()(const char* /*name*/, const std::string& /*value*/) {}

  [[nodiscard]] const Status& status() const { return status_; }

 private:
  std::string owner_;
  Status status_;
};
}  // namespace internal

/// Checks every bound of a Config.
/// @param owner name used in the message, e.g. "phase".
/// @return error naming the field, its value and the bounds.
template <typename Config>
[[nodiscard]] Status CheckBounds(const Config& config, const std::string& owner) {
  internal::BoundsCheck check(owner);
  Config copy = config;  // Visit hands out mutable references.
  copy.Visit(check);
  return check.status();
}

}  // namespace fringe_fusion
