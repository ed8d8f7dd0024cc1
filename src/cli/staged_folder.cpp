#include "staged_folder.hpp"

#include <unistd.h>

#include <algorithm>
#include <system_error>
#include <utility>
#include <vector>

#include "fringe_fusion/io/file.hpp"

namespace fringe_fusion::cli {

namespace fs = std::filesystem;

Result<NeededFolder> NeededFolder::Create(const std::string& folder) {
  std::vector<fs::path> created;
  std::error_code error;
  for (fs::path path = folder; !path.empty() && !fs::exists(path, error);) {
    created.push_back(path);
    if (!path.has_relative_path()) break;
    path = path.parent_path();
  }
  NeededFolder needed(std::move(created));
  if (Status status = MakeFolder(folder); !status) return tl::unexpected(status.error());
  return needed;
}

NeededFolder::~NeededFolder() {
  // Only empty folders can be removed so; the first one that is not keeps all around it.
  std::error_code error;
  for (const fs::path& folder : created_) fs::remove(folder, error);
}

Result<StagedFolder> StagedFolder::Create(const std::string& folder) {
  auto parent = NeededFolder::Create(folder);
  if (!parent) return tl::unexpected(parent.error());
  // The process id keeps two runs into the same folder apart.
  const fs::path staging = fs::path(folder) / fmt::format(".partial-{}", getpid());
  std::error_code error;
  fs::remove_all(staging, error);
  if (Status status = MakeFolder(staging.string()); !status) {
    return tl::unexpected(status.error());
  }
  return StagedFolder(std::move(*parent), folder, staging);
}

StagedFolder::StagedFolder(StagedFolder&& other) noexcept
    : parent_(std::move(other.parent_)),
      target_(std::move(other.target_)),
      staging_(std::exchange(other.staging_, {})) {}

StagedFolder::~StagedFolder() {
  if (staging_.empty()) return;
  std::error_code error;
  fs::remove_all(staging_, error);
}

Status StagedFolder::Commit() {
  std::error_code error;
  std::vector<fs::path> entries;
  for (const auto& entry : fs::directory_iterator(staging_, error)) entries.push_back(entry.path());
  if (error) return Fail("{}: cannot be listed: {}", staging_.string(), error.message());
  std::sort(entries.begin(), entries.end());
  for (const fs::path& entry : entries) {
    const fs::path target = target_ / entry.filename();
    const fs::path old = staging_ / (".old-" + entry.filename().string());
    // A folder cannot be renamed over another one: the earlier one steps aside first and goes with
    // the staging folder.
    if (fs::is_directory(target)) fs::rename(target, old, error);
    if (!error) fs::rename(entry, target, error);
    if (error) {
      std::error_code ignored;
      if (fs::exists(old)) fs::rename(old, target, ignored);
      return Fail("{}: cannot be replaced: {}", target.string(), error.message());
    }
  }
  fs::remove_all(staging_, error);
  staging_.clear();
  return {};
}

}  // namespace fringe_fusion::cli
