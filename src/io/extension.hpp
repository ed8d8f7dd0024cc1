#pragma once

#include <cctype>
#include <filesystem>
#include <string>

namespace fringe_fusion::internal {

/// Extension of a file in lower case with its point, e.g. ".ply"; "" without one.
inline std::string LowerExtension(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

}  // namespace fringe_fusion::internal
