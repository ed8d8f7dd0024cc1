#pragma once

#include <array>
#include <string>
#include <vector>

#include "fringe_fusion/common/result.hpp"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace fringe_fusion {
struct PictureSize;
}

namespace fringe_fusion::cli {

/// An option of a command; the parser owns it. Its calls can be chained. The parser's own header is
/// kept out of the commands: it takes longer to compile than most of them.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}

  Option Required() const;
  /// @param name of the value in the help, e.g. "MESH.ply".
  Option TypeName(const std::string& name) const;
  /// Shows the value that the variable has now as the default.
  Option ShowDefault() const;
  /// Lies the value outside, the command line is wrong.
  Option InRange(int low, int high) const;
  Option InRange(double low, double high) const;
  Option AtLeastZero() const;
  Option OneOf(const std::vector<std::string>& values) const;
  /// Between the values of an array.
  Option Delimiter(char delimiter) const;
  /// The other option must, or must not, be given too.
  Option Needs(const Option& other) const;
  Option Excludes(const Option& other) const;

 private:
  CLI::Option* option_;
};

/// The command line of one command.
class Command {
 public:
  explicit Command(CLI::App& app) : app_(&app) {}

  /// @param name e.g. "--out". @param value is set when the option is given and must live until the
  /// command ran.
  Option AddOption(const std::string& name, std::string& value, const std::string& description);
  Option AddOption(const std::string& name, int& value, const std::string& description);
  Option AddOption(const std::string& name, double& value, const std::string& description);
  Option AddOption(const std::string& name, std::array<double, 3>& value,
                   const std::string& description);
  /// @param value is set to true.
  Option AddFlag(const std::string& name, bool& value, const std::string& description);
  [[nodiscard]] bool HasOption(const std::string& name) const;

 private:
  CLI::App* app_;
};

/// @param text like "1280x800" [px]. @return error naming the option.
[[nodiscard]] Result<PictureSize> ParsePictureSize(const std::string& option,
                                                   const std::string& text);

}  // namespace fringe_fusion::cli
