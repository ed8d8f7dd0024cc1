#pragma once

#include <filesystem>
#include <string>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::cli {

/// A result of several files that appears as a whole: it is built in a hidden folder inside the
/// target and moved into place at the end, so that a failure leaves earlier results untouched.
class StagedFolder {
 public:
  /// Creates `folder` and an empty hidden folder in it. @return error naming the folder.
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
  StagedFolder(std::filesystem::path target, std::filesystem::path staging)
      : target_(std::move(target)), staging_(std::move(staging)) {}

  std::filesystem::path target_;
  std::filesystem::path staging_;
};

}  // namespace fringe_fusion::cli
