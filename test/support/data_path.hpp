#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace fringe_fusion::test_support {

/// Where the captured data of other people lies: FRINGE_FUSION_DATA, else ../shared/data beside
/// the repository. The tests read it in place.
inline std::string DataPath(const std::string& relative) {
  const char* folder = std::getenv("FRINGE_FUSION_DATA");
  const std::filesystem::path root = folder != nullptr && *folder != '\0'
                                         ? std::filesystem::path(folder)
                                         : std::filesystem::path(SOURCE_DIR) / "../shared/data";
  return (root / relative).lexically_normal().string();
}

}  // namespace fringe_fusion::test_support

/// Skips the test when a path of DataPath() does not exist; the summary of scripts/test counts
/// these lines. A macro because the skip must return from the test itself.
#define FRINGE_FUSION_REQUIRE_DATA(path)            \
  if (!std::filesystem::exists(path)) {             \
    GTEST_SKIP() << "skipped: no data at " << path; \
  }                                                 \
  static_assert(true, "the macro is used like a statement")
