#include "command.hpp"

#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::cli {

namespace {

/// Files that a command reads from a folder of settings.
constexpr std::array<const char*, 25> kStageFiles = {
    "assembly",   "calibration",   "capture_assistant", "cell",     "crop",          "detect",
    "diagnosis",  "drift",         "epipolar",          "fill",     "fusion",        "hand_eye",
    "health",     "inspection",    "pattern",           "phase",    "registration",  "response",
    "sim",        "simulate_scan", "surface",           "transfer", "triangulation", "turntable",
    "variational"};
/// Files of the nodes and of a scan, which may lie beside them.
constexpr std::array<const char*, 19> kOtherFiles = {"arm_axes",
                                                     "calibration_node",
                                                     "camera",
                                                     "cell_node",
                                                     "cell_sim",
                                                     "fusion_node",
                                                     "job",
                                                     "motion",
                                                     "occupancy",
                                                     "patterns",
                                                     "phase_node",
                                                     "pose",
                                                     "pose_node",
                                                     "pose_prior",
                                                     "projector",
                                                     "scanner",
                                                     "stations",
                                                     "turntable_axes",
                                                     "turntable_stops"};

template <typename Names>
bool Contains(const Names& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

Status CheckConfigFolder(const std::string& folder) {
  std::vector<std::string> unknown;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string stem = entry.path().stem().string();
    const bool is_yaml = entry.path().extension() == ".yaml" || entry.path().extension() == ".yml";
    if (!is_yaml || entry.path().filename().string().front() == '.') continue;
    const bool is_known = Contains(kStageFiles, stem) || Contains(kOtherFiles, stem);
    if (!is_known || entry.path().extension() == ".yml") {
      unknown.push_back(entry.path().filename().string());
    }
  }
  if (error) return Fail("--config {}: cannot be listed: {}", folder, error.message());
  if (unknown.empty()) return {};
  std::sort(unknown.begin(), unknown.end());
  return Fail("--config {}: {} is not read by any command; the settings are {}.yaml", folder,
              unknown.front(), fmt::join(kStageFiles, ".yaml "));
}

bool Session::StatesKey(const std::string& stage, const std::string& key) const {
  if (!HasStage(stage)) return false;
  try {
    const YAML::Node root = YAML::LoadFile(StageFile(stage));
    return root.IsMap() && root[key].IsDefined();
  } catch (const YAML::Exception&) {
    return false;  // LoadStage says what is wrong with the file.
  }
}

namespace {

/// --json, --config (where the command has none of its own), --threads and --quiet.
void DeclareCommon(Command& command, CommonOptions& options) {
  command.AddOption("--json", options.json_file, "Write the figures of the run to this file")
      .TypeName("FILE");
  if (!command.HasOption("--config")) {
    command
        .AddOption(
            "--config", options.config_folder,
            "Folder with settings: each stage reads its <stage>.yaml there, if present; keys "
            "that it does not have keep their defaults (default: the folder settings/ of the "
            "scan, where there is a scan)")
        .TypeName("DIR");
  }
  command.AddOption("--threads", options.threads, "Threads to use, 0: all cores")
      .InRange(0, 1024)
      .TypeName("N")
      .ShowDefault();
  command.AddFlag("--quiet", options.quiet, "No progress on stderr");
}

/// Runs the body of a command under the common options and writes its figures.
Status RunBody(const std::string& name, const CommonOptions& options,
               const std::function<Status(Session&)>& body) {
  if (!options.config_folder.empty() && !std::filesystem::is_directory(options.config_folder)) {
    return Fail("--config {}: is not a folder", options.config_folder);
  }
  if (!options.config_folder.empty()) {
    if (Status status = CheckConfigFolder(options.config_folder); !status) return status;
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

}  // namespace

Tool::Tool() : app(std::make_unique<CLI::App>()) {}
Tool::~Tool() = default;

void AddCommand(Tool& tool, const std::string& name, const std::string& description,
                CommandParts parts) {
  CLI::App* app = tool.app->add_subcommand(name, description);
  Command command(*app);
  const auto common = std::make_shared<CommonOptions>();
  parts.declare(command);
  DeclareCommon(command, *common);
  app->callback([&tool, name, common, parts = std::move(parts)] {
    tool.command = name;
    tool.usage = parts.check();
    if (tool.usage) tool.outcome = RunBody(name, *common, parts.body);
  });
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
