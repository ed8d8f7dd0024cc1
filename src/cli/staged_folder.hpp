#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::cli {

/// A folder that a command needs. What had to be created for it goes again at the end of life
/// when nothing was put into it.
class NeededFolder {
 public:
  /// @return error naming the folder.
  [[nodiscard]] static Result<NeededFolder> Create(const std::string& folder);

  NeededFolder(NeededFolder&& other) noexcept : created_(std::exchange(other.created_, {})) {}
  NeededFolder& operator=(NeededFolder&&) = delete;
  ~NeededFolder();

 private:
  explicit NeededFolder(std::vector<std::filesystem::path> created)
      : created_(std::move(created)) {}

  std::vector<std::filesystem::path> created_;  ///< innermost first
};

/// A result of several files that appears as a whole: it is built in a hidden folder inside the
/// target and moved into place at the end, so that a failure leaves earlier results untouched.
class StagedFolder {
 public:
  /// Creates `folder` and an empty hidden folder in it; a folder that was not there before goes
  /// again when nothing is committed. @return error naming the folder.
  [[nodiscard]] static Result<StagedFolder> Create(const std::string& folder);

  StagedFolder(StagedFolder&& other) noexcept;
  StagedFolder& operator=(StagedFolder&&) = delete;
  ~StagedFolder();  ///< discards what was not committed

  /// Where to write.
  [[nodiscard]] std::string path() const { return staging_.string(); }

  /// Moves everything into the target; a file or folder of the same name is replaced as a whole.
  /// @return error naming the entry that could not be moved.
  [[nodiscard]] Status Commit();

 private:
  StagedFolder(NeededFolder parent, std::filesystem::path target, std::filesystem::path staging)
      : parent_(std::move(parent)), target_(std::move(target)), staging_(std::move(staging)) {}

  NeededFolder parent_;  ///< first member: it looks at the folder when the rest is gone
  std::filesystem::path target_;
  std::filesystem::path staging_;
};

}  // namespace fringe_fusion::cli
