#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <string>

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
  tool.app.name("fringe");
  tool.app.description(
      "Structured-light scanning on files: the same input and settings give the same bytes on any "
      "number of threads.");
  tool.app.footer(
      "Lengths in files are metres unless an option says otherwise. Errors go to stderr in one "
      "line;\nthe exit status is 0 on success, 1 on bad data, 2 on a bad command line, 130 when "
      "interrupted.");
  tool.app.require_subcommand(1);
  AddPatterns(tool);
  AddSimulate(tool);
  AddDecode(tool);
  AddReconstruct(tool);
  AddPose(tool);
  AddRegister(tool);
  AddFuse(tool);
  AddInspect(tool);
#ifdef FRINGE_FUSION_WITH_ROS
  AddImport(tool);
#endif
  AddRun(tool);
}

int Run(int argc, char** argv) {
  const InterruptGuard guard;
  Tool tool;
  Describe(tool);
  try {
    tool.app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return tool.app.exit(error);  // --help
    PrintError("", error.what());
    return kUsage;
  } catch (const std::exception& error) {
    PrintError(tool.command, error.what());
    return kFailed;
  }
  if (tool.outcome) return 0;
  PrintError(tool.command, tool.outcome.error().message);
  return InterruptGuard::Pending() ? kInterrupted : kFailed;
}

}  // namespace
}  // namespace fringe_fusion::cli

int main(int argc, char** argv) { return fringe_fusion::cli::Run(argc, argv); }
