#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::internal {

enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };
enum class PlyFormat { kAscii, kLittleEndian, kBigEndian };

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;
};

struct PlyElement {
  std::string name;
  std::size_t count = 0;
  std::vector<PlyProperty> properties;

  /// Position of a property by name, -1 if there is none.
  [[nodiscard]] int Find(std::string_view property) const;
};

/// One row of an element: a list of numbers per property, of length 1 for scalars.
using PlyRow = std::vector<std::vector<double>>;
using PlyRowSink =
    std::function<Status(const PlyElement& element, std::size_t row, const PlyRow& values)>;

/// A PLY file of any format and with any properties. Ref: Turk, The PLY polygon file format, 1994.
class PlyReader {
 public:
  /// Reads the file and its header, and refuses counts that the file cannot hold.
  [[nodiscard]] static Result<PlyReader> Open(const std::string& path);

  [[nodiscard]] const std::vector<PlyElement>& elements() const { return elements_; }
  /// The element of this name, nullptr if there is none.
  [[nodiscard]] const PlyElement* Find(std::string_view element) const;
  /// `obj_info KEY VALUES` lines.
  [[nodiscard]] const std::map<std::string, std::string>& obj_info() const { return obj_info_; }

  /// Hands every row of every element to the sink in file order. Stops at the sink's first error.
  [[nodiscard]] Status ReadRows(const PlyRowSink& sink) const;

 private:
  [[nodiscard]] Status ParseHeader();
  [[nodiscard]] Status ParseHeaderLine(const std::vector<std::string_view>& words, int line);
  [[nodiscard]] Status ParseElement(const std::vector<std::string_view>& words, int line);
  [[nodiscard]] Status ParseProperty(const std::vector<std::string_view>& words, int line);
  [[nodiscard]] Status CheckCounts() const;
  [[nodiscard]] Status ReadAscii(const PlyRowSink& sink) const;
  [[nodiscard]] Status ReadBinary(const PlyRowSink& sink) const;

  std::string path_;
  std::string content_;
  std::size_t body_ = 0;  ///< first byte after the header
  int body_line_ = 0;     ///< lines of the header
  PlyFormat format_ = PlyFormat::kAscii;
  std::vector<PlyElement> elements_;
  std::map<std::string, std::string> obj_info_;
};

}  // namespace fringe_fusion::internal
