#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <exception>
#include <string>
#include <vector>

#include "command.hpp"
#include "fringe_fusion/common/progress.hpp"

namespace fringe_fusion::cli {
namespace {

constexpr int kFailed = 1;
constexpr int kUsage = 2;
constexpr int kInterrupted = 130;  // what shells report for a program ended by SIGINT

void PrintError(const std::string& command, std::string message) {
  // One line, whatever a library put into its message.
  std::replace(message.begin(), message.end(), '\n', ' ');
  fmt::print(stderr, "fringe{}{}: {}\n", command.empty() ? "" : " ", command, message);
}

void Describe(Tool& tool) {
  tool.app->name("fringe");
  tool.app->description(
      "Structured-light scanning on files: the same input and settings give the same bytes on any "
      "number of threads.");
  tool.app->footer(
      "Lengths in files are metres unless an option says otherwise. Errors go to stderr in one "
      "line;\nthe exit status is 0 on success, 1 on bad data, 2 on a bad command line, 130 when "
      "interrupted.");
  tool.app->set_version_flag("--version", "fringe_fusion " FRINGE_FUSION_VERSION);
  tool.app->require_subcommand(1);
  AddPatterns(tool);
  AddTarget(tool);
  AddCalibrate(tool);
  AddHandEye(tool);
  AddTurntable(tool);
  AddRecalibrate(tool);
  AddSimulate(tool);
  AddDecode(tool);
  AddReconstruct(tool);
  AddDiagnose(tool);
  AddResponse(tool);
  AddSuggest(tool);
  AddPose(tool);
  AddRegister(tool);
  AddFuse(tool);
  AddInspect(tool);
#ifdef FRINGE_FUSION_WITH_ROS
  AddImport(tool);
#endif
  AddRun(tool);
}

/// The command that was being read when the command line turned out wrong; "" before any.
std::string CommandBeingRead(const Tool& tool) {
  const std::vector<CLI::App*> commands = tool.app->get_subcommands();
  return commands.empty() ? "" : commands.front()->get_name();
}

/// What is wrong with a command line.
std::string UsageError(const Tool& tool, const CLI::ParseError& error, int argc, char** argv) {
  const bool names_command = argc > 1 && argv[1][0] != '-' && argv[1][0] != '\0';
  if (!CommandBeingRead(tool).empty() || !names_command) return error.what();
  std::vector<std::string> names;
  for (const CLI::App* command : tool.app->get_subcommands({})) {
    names.push_back(command->get_name());
  }
  return fmt::format("unknown command '{}', must be one of {}", argv[1], fmt::join(names, " "));
}

int Run(int argc, char** argv) {
  const InterruptGuard guard;
  Tool tool;
  Describe(tool);
  try {
    tool.app->parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return tool.app->exit(error);  // --help, --version
    PrintError(CommandBeingRead(tool), UsageError(tool, error, argc, argv));
    return kUsage;
  } catch (const std::exception& error) {
    PrintError(tool.command, error.what());
    return kFailed;
  }
  if (!tool.usage) {
    PrintError(tool.command, tool.usage.error().message);
    return kUsage;
  }
  if (tool.outcome) return 0;
  PrintError(tool.command, tool.outcome.error().message);
  return InterruptGuard::Pending() ? kInterrupted : kFailed;
}

}  // namespace
}  // namespace fringe_fusion::cli

int main(int argc, char** argv) { return fringe_fusion::cli::Run(argc, argv); }
