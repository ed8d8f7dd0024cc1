#pragma once

#include <yaml-cpp/yaml.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/geometry/transform.hpp"

namespace fringe_fusion::internal {

/// Parses a YAML file. @return error naming the file, the line and the cause.
[[nodiscard]] Result<YAML::Node> LoadYaml(const std::string& path);

/// Short form of a node for messages, in one line.
[[nodiscard]] std::string Shown(const YAML::Node& node);

/// Reads the keys of one YAML map strictly: unknown, doubled and missing keys are errors, and so
/// are numbers that are not finite. The first error is kept and later calls do nothing.
class YamlFields {
 public:
  /// @param owner names the map in messages, e.g. "cell.yaml: camera".
  YamlFields(const YAML::Node& node, std::string owner);

  [[nodiscard]] bool Has(const char* key) const;

  template <typename T>
  void Required(const char* key, T& value) {
    if (Find(key, true)) Convert(key, value);
  }
  /// Leaves `value` at its default when the key is missing.
  template <typename T>
  void Optional(const char* key, T& value) {
    if (Find(key, false)) Convert(key, value);
  }
  /// Reads the map below a required key.
  void Nested(const char* key, const std::function<void(YamlFields& fields)>& read);

  /// Records a failure of the caller's own checks, prefixed by the owner.
  void Reject(const std::string& reason);
  [[nodiscard]] const std::string& owner() const { return owner_; }
  [[nodiscard]] bool ok() const { return status_.has_value(); }
  /// The required list of maps below a key; empty after an error.
  [[nodiscard]] std::vector<YAML::Node> List(const char* key);

  /// The first error, or a complaint about a key that nobody asked for.
  [[nodiscard]] Status Finish() const;

 private:
  bool Find(const char* key, bool required);
  void RejectValue(const char* key, const std::string& expected);

  template <typename T>
  void Convert(const char* key, T& value) {
    try {
      value = node_[key].template as<T>();
    } catch (const YAML::Exception&) {
      RejectValue(key, Expected(value));
      return;
    }
    if (!IsFinite(value)) RejectValue(key, "finite");
  }
  template <typename T>
  static bool IsFinite(const T& value) {
    if constexpr (std::is_floating_point_v<T>) {
      return std::isfinite(value);
    } else if constexpr (std::is_arithmetic_v<T> || std::is_same_v<T, std::string>) {
      return true;
    } else {
      for (const auto& item : value) {
        if (!IsFinite(item)) return false;
      }
      return true;
    }
  }
  template <typename T>
  struct FixedLength : std::integral_constant<std::size_t, 0> {};
  template <typename T, std::size_t N>
  struct FixedLength<std::array<T, N>> : std::integral_constant<std::size_t, N> {};

  /// Words for a value of the type that is read.
  template <typename T>
  static std::string Expected(const T& /*value*/) {
    if constexpr (std::is_same_v<T, bool>) {
      return "true or false";
    } else if constexpr (std::is_integral_v<T>) {
      return "a whole number";
    } else if constexpr (std::is_floating_point_v<T>) {
      return "a number";
    } else if constexpr (std::is_same_v<T, std::string>) {
      return "a text";
    } else {
      using Item = typename T::value_type;
      const std::string items = std::is_same_v<Item, std::string> ? "texts"
                                : std::is_integral_v<Item>        ? "whole numbers"
                                                                  : "numbers";
      if constexpr (FixedLength<T>::value == 0) {
        return "a list of " + items;
      } else {
        return fmt::format("a list of {} {}", FixedLength<T>::value, items);
      }
    }
  }

  YAML::Node node_;
  std::string owner_;
  std::set<std::string> known_;
  Status status_;
};

/// {translation_m, quaternion_xyzw} and, optional, rotation_row_major: the exact matrix, which must
/// agree with the quaternion to 1e-9.
void ReadTransform(YamlFields& fields, Transform& T);
/// The flow map that ReadTransform reads back bit by bit.
[[nodiscard]] std::string TransformYaml(const Transform& T);

/// Text in double quotes with escapes.
[[nodiscard]] std::string QuotedYaml(const std::string& text);

}  // namespace fringe_fusion::internal
