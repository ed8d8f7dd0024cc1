#pragma once

#include <string>
#include <utility>
#include <vector>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

/// One page for people: headings, tables of figures, pictures. Written as HTML without scripts.
struct Report {
  struct Table {
    std::string title;
    std::vector<std::string> header;
    std::vector<std::vector<std::string>> rows;
  };
  struct Picture {
    std::string caption;
    std::string file;  ///< relative to the report
  };
  std::string title;
  std::vector<std::string> paragraphs;
  std::vector<Table> tables;
  std::vector<Picture> pictures;
  std::vector<Table> details;  ///< long tables, below the pictures
};

/// Writes the page atomically (temporary file, then rename). @return error naming the path.
[[nodiscard]] Status WriteReport(const Report& report, const std::string& path);

}  // namespace fringe_fusion
