#pragma once

#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::cli {

/// A JSON object whose keys keep the order in which they were set. Just enough to write figures.
class Json {
 public:
  /// Sets a number; one that is not finite becomes null, because JSON knows no NaN.
  template <typename Number, std::enable_if_t<std::is_arithmetic_v<Number>, int> = 0>
  Json& Set(const std::string& key, Number value) {
    if constexpr (std::is_same_v<Number, bool>) {
      return SetText(key, value ? "true" : "false");
    } else if constexpr (std::is_floating_point_v<Number>) {
      return SetText(key, NumberText(static_cast<double>(value)));
    } else {
      return SetText(key, std::to_string(value));
    }
  }
  Json& Set(const std::string& key, const std::string& value);
  Json& Set(const std::string& key, const char* value) { return Set(key, std::string(value)); }
  Json& Set(const std::string& key, const Json& value);
  Json& Set(const std::string& key, const std::vector<Json>& values);

  /// The object as indented text without a final line break.
  [[nodiscard]] std::string Text() const;

 private:
  Json& SetText(const std::string& key, std::string text);
  static std::string NumberText(double value);

  std::vector<std::pair<std::string, std::string>> members_;
};

/// Writes the object atomically. @return error naming the path.
[[nodiscard]] Status WriteJson(const Json& json, const std::string& path);

}  // namespace fringe_fusion::cli
