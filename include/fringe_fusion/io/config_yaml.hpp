#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <string>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

/// What a key that a file does not have means.
enum class MissingKeys { kAreErrors, kTakeDefaults };

namespace internal {
/// Reads the fields of a Config from a YAML file with one map; unknown keys are errors. The YAML
/// library stays in the source: every reader of settings would compile it for each field.
class YamlReader {
 public:
  YamlReader(const std::string& path, MissingKeys missing);
  ~YamlReader();
  YamlReader(const YamlReader&) = delete;
  YamlReader& operator=(const YamlReader&) = delete;

  template <typename T, typename... Bounds>
  void operator()(const char* name, T& value, Bounds... /*bounds*/) {
    Read(name, value);
  }

  /// The first thing that was wrong with the file or a field. Call it after all fields were read.
  [[nodiscard]] Status Finish() const;

 private:
  void Read(const char* name, bool& value);
  void Read(const char* name, int& value);
  void Read(const char* name, double& value);
  void Read(const char* name, std::string& value);
  template <std::size_t N>
  void Read(const char* name, std::array<double, N>& values) {
    ReadList(name, values.data(), N);
  }
  void ReadList(const char* name, double* values, std::size_t count);

  struct File;
  std::unique_ptr<File> file_;
};
}  // namespace internal

/// Loads a stage's Config from a YAML file, e.g. config/phase.yaml, and checks its bounds.
/// @param missing kTakeDefaults: the file states what differs from the defaults of the struct.
/// @return error naming file, key, value and bound.
template <typename Config>
[[nodiscard]] Result<Config> LoadConfigFile(const std::string& path,
                                            MissingKeys missing = MissingKeys::kAreErrors) {
  Config config;
  internal::YamlReader reader(path, missing);
  config.Visit(reader);
  if (Status status = reader.Finish(); !status) return tl::unexpected<Error>(status.error());
  if (Status status = CheckBounds(config, path); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return config;
}

}  // namespace fringe_fusion
