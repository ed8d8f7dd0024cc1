#include "command.hpp"

#include <unistd.h>

#include <algorithm>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::cli {

void DeclareCommon(CLI::App& command, CommonOptions& options, bool has_config) {
  command.add_option("--json", options.json_file, "Write the figures of the run to this file")
      ->type_name("FILE");
  if (has_config) {
    command
        .add_option("--config", options.config_folder,
                    "Folder with settings: each stage reads its <stage>.yaml there, if present "
                    "(default: the folder settings/ of the scan)")
        ->type_name("DIR");
  }
  command.add_option("--threads", options.threads, "Threads to use, 0: all cores")
      ->check(CLI::Range(0, 1024))
      ->type_name("N")
      ->capture_default_str();
  command.add_flag("--quiet", options.quiet, "No progress on stderr");
}

Status RunBody(const std::string& name, const CommonOptions& options,
               const std::function<Status(Session&)>& body) {
  if (!options.config_folder.empty() && !std::filesystem::is_directory(options.config_folder)) {
    return Fail("--config {}: is not a folder", options.config_folder);
  }
  if (!options.json_file.empty()) {
    if (Status status = CheckOutputFile(options.json_file, {}); !status) return status;
  }
  const ThreadLimit thread_limit(options.threads);
  Session session(name, options);
  session.figures.Set("command", name);
  if (Status status = body(session); !status) return status;
  if (options.json_file.empty()) return {};
  Json seconds;
  for (const auto& [step, value] : session.console.seconds()) seconds.Set(step, value);
  session.figures.Set("seconds", seconds);
  return WriteJson(session.figures, options.json_file);
}

Status CheckOutputFile(const std::string& path, const std::vector<std::string>& extensions) {
  const std::filesystem::path file(path);
  if (!extensions.empty() &&
      std::find(extensions.begin(), extensions.end(), file.extension()) == extensions.end()) {
    return Fail("{}: extension '{}' must be one of {}", path, file.extension().string(),
                fmt::join(extensions, " "));
  }
  if (std::filesystem::is_directory(file)) return Fail("{}: is a folder, not a file", path);
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  if (!std::filesystem::is_directory(folder)) {
    return Fail("{}: folder {} does not exist", path, folder.string());
  }
  if (access(folder.c_str(), W_OK) != 0) {
    return Fail("{}: folder {} is not writable", path, folder.string());
  }
  return {};
}

}  // namespace fringe_fusion::cli
