#pragma once

#include <functional>
#include <ostream>
#include <string>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

/// What a finished write has survived: a crash of the program, or also a power cut.
enum class Durability {
  kClosed,  ///< handed to the operating system; for the many frames of a scan
  kSynced,  ///< on the disk
};

/// Writes a file through a temporary sibling that is renamed at the end, so that an earlier result
/// survives any failure (full disk, unwritable folder, crash). A device or pipe is written
/// directly.
/// @param write fills the stream; its failure and stream errors become the returned error.
/// @return error naming the path and the cause, e.g. "No space left on device".
[[nodiscard]] Status WriteAtomically(const std::string& path,
                                     const std::function<Status(std::ostream&)>& write,
                                     Durability durability = Durability::kSynced);

/// Whole file. @return error naming the path.
[[nodiscard]] Result<std::string> ReadFile(const std::string& path);

/// Creates a folder and its parents. @return error naming the path and the cause.
[[nodiscard]] Status MakeFolder(const std::string& path);

}  // namespace fringe_fusion
