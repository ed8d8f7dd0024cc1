#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "console.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/io/config_yaml.hpp"
#include "json.hpp"
#include "options.hpp"

namespace fringe_fusion::cli {

/// Options that every command has.
struct CommonOptions {
  std::string json_file;
  std::string config_folder;
  int threads = 0;
  bool quiet = false;
};

/// What a running command works with: progress, settings and the figures it reports.
class Session {
 public:
  Session(const std::string& command, const CommonOptions& options)
      : console(command, options.quiet), config_folder_(options.config_folder) {}

  /// Settings of a stage: the keys of <config folder>/<stage>.yaml, the others at their defaults.
  /// @return error naming file, key, value and bound.
  template <typename Config>
  [[nodiscard]] Result<Config> LoadStage(const std::string& stage) const {
    if (!HasStage(stage)) return Config{};
    return LoadConfigFile<Config>(StageFile(stage), MissingKeys::kTakeDefaults);
  }
  [[nodiscard]] bool HasStage(const std::string& stage) const {
    return !config_folder_.empty() && std::filesystem::exists(StageFile(stage));
  }
  /// Whether the settings state a key, which then is no default.
  [[nodiscard]] bool StatesKey(const std::string& stage, const std::string& key) const;
  /// Takes the settings that lie with a scan, SCAN/settings/, unless --config was given.
  void AdoptSettings(const std::string& scan) {
    const std::filesystem::path folder = std::filesystem::path(scan) / "settings";
    if (config_folder_.empty() && std::filesystem::is_directory(folder)) {
      config_folder_ = folder.string();
    }
  }

  /// File of a stage in the settings.
  [[nodiscard]] std::string StageFile(const std::string& stage) const {
    return (std::filesystem::path(config_folder_) / (stage + ".yaml")).string();
  }

  Console console;
  Json figures;  ///< written to --json when the command succeeds

 private:
  std::string config_folder_;
};

/// The command line and how its command ended.
struct Tool {
  Tool();
  ~Tool();

  std::unique_ptr<CLI::App> app;
  std::string command;  ///< that ran
  Status usage;         ///< of its command line; the command did not run on an error
  Status outcome;
};

/// Checks the names of the .yaml files in a folder of settings: a misspelt one would be ignored.
/// @return error naming the file and the names that are read.
[[nodiscard]] Status CheckConfigFolder(const std::string& folder);

/// What one command adds to the tool.
struct CommandParts {
  std::function<void(Command&)> declare;
  std::function<Status()> check;  ///< of the command line as a whole; an error is one of usage
  std::function<Status(Session&)> body;
};

/// Adds a command with its own options and the common ones. Its body does the work, under the
/// common options; its figures are written.
void AddCommand(Tool& tool, const std::string& name, const std::string& description,
                CommandParts parts);

/// @param declare adds the options of the command. @param run does its work.
/// @param check says what is wrong with options that do not go together.
template <typename Options>
void AddCommand(Tool& tool, const std::string& name, const std::string& description,
                void (*declare)(Command&, Options&),
                Status (*run)(const Options& options, Session& session),
                Status (*check)(const Options& options) = nullptr) {
  // The parser keeps references to the options until the command ran.
  const auto options = std::make_shared<Options>();
  AddCommand(tool, name, description,
             {[options, declare](Command& command) { declare(command, *options); },
              [options, check] { return check != nullptr ? check(*options) : Status(); },
              [options, run](Session& session) { return run(*options, session); }});
}

/// Checks before the work that a file can be written in the end.
/// @param extensions that are known, e.g. {".ply", ".stl"}; empty: any.
/// @return error naming the file and what is wrong.
[[nodiscard]] Status CheckOutputFile(const std::string& path,
                                     const std::vector<std::string>& extensions);

// One function per command, each in its own file.
void AddPatterns(Tool& tool);
void AddTarget(Tool& tool);
void AddCalibrate(Tool& tool);
void AddHandEye(Tool& tool);
void AddTurntable(Tool& tool);
void AddRecalibrate(Tool& tool);
void AddSimulate(Tool& tool);
void AddDecode(Tool& tool);
void AddReconstruct(Tool& tool);
void AddDiagnose(Tool& tool);
void AddResponse(Tool& tool);
void AddSuggest(Tool& tool);
void AddPose(Tool& tool);
void AddRegister(Tool& tool);
void AddFuse(Tool& tool);
void AddInspect(Tool& tool);
void AddImport(Tool& tool);
void AddRun(Tool& tool);

}  // namespace fringe_fusion::cli
