#pragma once

#include <functional>
#include <ostream>
#include <string>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

/// Writes a file through a temporary sibling that is renamed at the end, so that an earlier result
/// survives any failure (full disk, unwritable folder, crash).
/// @param write fills the stream; its failure and stream errors become the returned error.
[[nodiscard]] Status WriteAtomically(const std::string& path,
                                     const std::function<Status(std::ostream&)>& write);

/// Whole file. @return error naming the path.
[[nodiscard]] Result<std::string> ReadFile(const std::string& path);

/// Creates a folder and its parents. @return error naming the path and the cause.
[[nodiscard]] Status MakeFolder(const std::string& path);

}  // namespace fringe_fusion
