#include "nodes/calibration_files.hpp"

#include <ros/console.h>
#include <std_srvs/Trigger.h>

#include <filesystem>
#include <optional>
#include <utility>

#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/ros_io/service_call.hpp"

namespace fringe_fusion::nodes {
namespace {

struct EarlierFile {
  std::string path;
  std::optional<std::string> content;  ///< nothing: it was not there
};

Status PutBack(const EarlierFile& file) {
  if (!file.content) {
    std::error_code code;
    std::filesystem::remove(file.path, code);
    if (code) return Fail("{}: cannot be removed: {}", file.path, code.message());
    return {};
  }
  return WriteAtomically(file.path, [&file](std::ostream& stream) -> Status {
    stream << *file.content;
    return {};
  });
}

}  // namespace

Status CalibrationFiles::Put(const Change& change) {
  std::vector<EarlierFile> earlier;
  for (const std::string& path : change.paths) {
    EarlierFile file{path, std::nullopt};
    if (std::filesystem::exists(path)) {
      auto content = ReadFile(path);
      if (!content) return Forward(content);
      file.content = std::move(*content);
    }
    earlier.push_back(std::move(file));
  }
  Status status = change.apply();
  if (status) status = Reload();
  if (status) return {};
  std::string words = status.error().message;
  for (const EarlierFile& file : earlier) {
    if (Status back = PutBack(file); !back) words += "; " + back.error().message;
  }
  if (change.undo) change.undo();
  // Those that had taken the new one.
  if (Status back = Reload(); !back) {
    ROS_WARN("after a calibration was refused: %s", back.error().message.c_str());
  }
  return Fail("the earlier calibration stays in force: {}", words);
}

Status CalibrationFiles::Reload() {
  Status first;
  for (const std::string& node : nodes_) {
    const auto answer =
        ros_io::CallService<std_srvs::Trigger>(nh_, node + "/reload_calibration", {}, timeout_s_);
    if (!answer && first) first = Forward(answer);
  }
  return first;
}

}  // namespace fringe_fusion::nodes
