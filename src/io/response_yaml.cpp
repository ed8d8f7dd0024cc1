#include "fringe_fusion/io/response_yaml.hpp"

#include <cmath>

#include "fringe_fusion/io/file.hpp"
#include "yaml_fields.hpp"

namespace fringe_fusion {
namespace {

constexpr std::size_t kNumValues = 256;
constexpr std::size_t kValuesPerLine = 8;
constexpr double kEndTolerance = 1e-6;
constexpr const char* kPatternsWord = "patterns";
constexpr const char* kPhaseWord = "phase";

// NaN fails every comparison.
Status CheckLight(const std::array<double, kNumValues>& light, const std::string& path) {
  if (!(std::abs(light.front()) <= kEndTolerance) ||
      !(std::abs(light.back() - 1.0) <= kEndTolerance)) {
    return Fail("{}: light goes from {} to {}, must go from 0 to 1", path, light.front(),
                light.back());
  }
  for (std::size_t value = 1; value < light.size(); ++value) {
    if (!(light[value] >= light[value - 1])) {
      return Fail("{}: light of value {} is {}, less than {} of value {}: it must not fall", path,
                  value, light[value], light[value - 1], value - 1);
    }
  }
  return {};
}

}  // namespace

Status WriteResponse(const ResponseCurve& response, const std::string& path) {
  if (Status status = CheckLight(response.light, path); !status) return status;
  std::string text =
      "# Light seen for each 8-bit value sent to the projector, relative to black and white.\n";
  text +=
      fmt::format("undo_in: {}  # patterns: they are sent through the inverse; phase: of scans\n",
                  response.use == ResponseUse::kPhase ? kPhaseWord : kPatternsWord);
  text += fmt::format("gamma: {}\n", response.gamma);
  if (std::isfinite(response.sigma_gamma)) {
    text += fmt::format("sigma_gamma: {}\n", response.sigma_gamma);
  }
  text += fmt::format("gamma_residual: {}\nlight: [", response.gamma_residual);
  for (std::size_t value = 0; value < response.light.size(); ++value) {
    if (value > 0) text += value % kValuesPerLine == 0 ? ",\n  " : ", ";
    text += fmt::format("{}", response.light[value]);
  }
  text += "]\n";
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << text;
    return {};
  });
}

Result<ResponseCurve> ReadResponse(const std::string& path) {
  const Result<YAML::Node> root = internal::LoadYaml(path);
  if (!root) return Forward(root);
  ResponseCurve response;
  internal::YamlFields fields(*root, path);
  std::string use = kPatternsWord;
  fields.Optional("undo_in", use);
  if (fields.ok() && use != kPatternsWord && use != kPhaseWord) {
    fields.Reject(fmt::format("undo_in is '{}', must be {} or {}", use, kPatternsWord, kPhaseWord));
  }
  response.use = use == kPhaseWord ? ResponseUse::kPhase : ResponseUse::kPatterns;
  fields.Required("gamma", response.gamma);
  fields.Optional("sigma_gamma", response.sigma_gamma);
  fields.Required("gamma_residual", response.gamma_residual);
  fields.Required("light", response.light);
  Status status = fields.Finish();
  if (status) status = CheckLight(response.light, path);
  if (!status) return tl::unexpected<Error>(status.error());
  return response;
}

}  // namespace fringe_fusion
