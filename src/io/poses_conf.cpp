#include "fringe_fusion/io/poses_conf.hpp"

#include <array>

#include "fringe_fusion/io/file.hpp"
#include "text_lines.hpp"

namespace fringe_fusion {
namespace {

using Words = std::vector<std::string_view>;

Result<ConfEntry> ParseEntry(const Words& words, const std::string& owner) {
  if (words.size() != 9) {
    return Fail("{}: bmesh needs a file and 7 numbers, has {} words", owner, words.size() - 1);
  }
  std::array<double, 7> numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const std::optional<double> number = internal::ParseNumber<double>(words[i + 2]);
    if (!number) return Fail("{}: '{}' is no number", owner, words[i + 2]);
    numbers[i] = *number;
  }
  const Result<Transform> inverse_rotation =
      MakeTransform(Eigen::Vector3d(numbers.data()), Eigen::Vector4d(numbers.data() + 3));
  if (!inverse_rotation) return Fail("{}: {}", owner, inverse_rotation.error().message);
  ConfEntry entry;
  entry.file = std::string(words[1]);
  entry.T_object_camera.linear() = inverse_rotation->linear().transpose();
  entry.T_object_camera.translation() = inverse_rotation->translation();
  return entry;
}

}  // namespace

Result<std::vector<ConfEntry>> ReadPosesConf(const std::string& path) {
  const Result<std::string> content = ReadFile(path);
  if (!content) return Forward(content);
  std::vector<ConfEntry> entries;
  internal::TextLines lines(*content);
  Words words;
  while (const std::optional<std::string_view> line = lines.Next()) {
    internal::SplitWords(*line, words);
    if (words.empty() || words[0][0] == '#' || words[0] == "camera") continue;
    const std::string owner = fmt::format("{}: line {}", path, lines.number());
    if (words[0] != "bmesh") {
      return Fail("{}: unknown keyword '{}', must be bmesh or camera", owner, words[0]);
    }
    Result<ConfEntry> entry = ParseEntry(words, owner);
    if (!entry) return Forward(entry);
    entries.push_back(std::move(*entry));
  }
  if (entries.empty()) return Fail("{}: has no bmesh line", path);
  return entries;
}

Status WritePosesConf(const std::vector<ConfEntry>& entries, const std::string& path) {
  std::string text;
  for (const ConfEntry& entry : entries) {
    if (entry.file.empty() || entry.file.find_first_of(" \t\r\n") != std::string::npos) {
      return Fail("{}: the file name '{}' is empty or has blanks", path, entry.file);
    }
    if (!entry.T_object_camera.matrix().allFinite()) {
      return Fail("{}: the pose of {} is not finite", path, entry.file);
    }
    Transform inverse_rotation = Transform::Identity();
    inverse_rotation.linear() = entry.T_object_camera.linear().transpose();
    const Eigen::Vector4d q = QuaternionXyzw(inverse_rotation);
    const Eigen::Vector3d t = entry.T_object_camera.translation();
    text += fmt::format("bmesh {} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n",
                        entry.file, t.x(), t.y(), t.z(), q[0], q[1], q[2], q[3]);
  }
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << text;
    return {};
  });
}

}  // namespace fringe_fusion
