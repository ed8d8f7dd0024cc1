#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace fringe_fusion::cli {

/// How a call of the offline tool ended.
struct Outcome {
  int exit_status = -1;
  std::string out;
  std::string err;
};

/// Runs `fringe` with the given arguments, waits for it and collects what it printed.
/// @param pending_signal is waiting for the program when it starts, as if the user had pressed
/// Ctrl-C at once; 0: none.
Outcome RunFringe(const std::vector<std::string>& arguments, int pending_signal = 0);

/// Text or bytes of a whole file; fails the test when it cannot be read.
std::string ReadBytes(const std::filesystem::path& path);
void WriteBytes(const std::filesystem::path& path, const std::string& bytes);

/// Replaces the first occurrence of `from` in a file; fails the test when there is none.
void ReplaceInFile(const std::filesystem::path& path, const std::string& from,
                   const std::string& to);

/// Takes the prior pose out of a view.yaml.
void RemovePrior(const std::filesystem::path& view_yaml);

/// Names of all files below a folder, sorted, relative to it.
std::vector<std::string> ListFiles(const std::filesystem::path& folder);

/// A folder of the test's own, removed at the end.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const std::string& name);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const {
    return path_ / name;
  }

 private:
  std::filesystem::path path_;
};

/// Writes settings of a small, quick simulated scan: a 160 x 120 camera, a 320 x 200 projector,
/// noise and pose errors of the usual size.
void WriteSmallCellConfig(const std::filesystem::path& folder);

}  // namespace fringe_fusion::cli
