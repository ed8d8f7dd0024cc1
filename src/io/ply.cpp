#include "ply.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <optional>
#include <utility>

#include "fringe_fusion/io/file.hpp"
#include "text_lines.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr std::array<std::pair<std::string_view, PlyType>, 16> kTypeNames = {
    {{"char", PlyType::kInt8},
     {"int8", PlyType::kInt8},
     {"uchar", PlyType::kUint8},
     {"uint8", PlyType::kUint8},
     {"short", PlyType::kInt16},
     {"int16", PlyType::kInt16},
     {"ushort", PlyType::kUint16},
     {"uint16", PlyType::kUint16},
     {"int", PlyType::kInt32},
     {"int32", PlyType::kInt32},
     {"uint", PlyType::kUint32},
     {"uint32", PlyType::kUint32},
     {"float", PlyType::kFloat32},
     {"float32", PlyType::kFloat32},
     {"double", PlyType::kFloat64},
     {"float64", PlyType::kFloat64}}};

std::optional<PlyType> TypeOf(std::string_view name) {
  for (const auto& [known, type] : kTypeNames) {
    if (name == known) return type;
  }
  return std::nullopt;
}

std::size_t SizeOf(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat32:
      return 4;
    case PlyType::kFloat64:
      return 8;
  }
  return 8;
}

// Fewest bytes that a row can take in the file.
std::size_t LeastRowBytes(const PlyElement& element, PlyFormat format) {
  std::size_t bytes = 0;
  for (const PlyProperty& property : element.properties) {
    if (format == PlyFormat::kAscii) {
      bytes += 2;  // a digit and a separator
    } else {
      bytes += SizeOf(property.is_list ? property.count_type : property.type);
    }
  }
  return bytes;
}

// Takes numbers off a binary body.
class BinaryCursor {
 public:
  BinaryCursor(std::string_view body, bool swap) : rest_(body), swap_(swap) {}

  [[nodiscard]] std::string_view rest() const { return rest_; }

  std::optional<double> Take(PlyType type) {
    switch (type) {
      case PlyType::kInt8:
        return TakeAs<std::int8_t>();
      case PlyType::kUint8:
        return TakeAs<std::uint8_t>();
      case PlyType::kInt16:
        return TakeAs<std::int16_t>();
      case PlyType::kUint16:
        return TakeAs<std::uint16_t>();
      case PlyType::kInt32:
        return TakeAs<std::int32_t>();
      case PlyType::kUint32:
        return TakeAs<std::uint32_t>();
      case PlyType::kFloat32:
        return TakeAs<float>();
      case PlyType::kFloat64:
        return TakeAs<double>();
    }
    return std::nullopt;
  }

 private:
  template <typename T>
  std::optional<double> TakeAs() {
    if (rest_.size() < sizeof(T)) return std::nullopt;
    std::array<char, sizeof(T)> bytes{};
    std::copy_n(rest_.begin(), sizeof(T), bytes.begin());
    if (swap_) std::reverse(bytes.begin(), bytes.end());
    rest_.remove_prefix(sizeof(T));
    T value{};
    std::memcpy(&value, bytes.data(), sizeof(T));
    return static_cast<double>(value);
  }

  std::string_view rest_;
  bool swap_;
};

bool HostIsLittleEndian() {
  const std::uint16_t one = 1;
  unsigned char first = 0;
  std::memcpy(&first, &one, 1);
  return first == 1;
}

// Takes one property off a line of words.
bool TakeWords(const PlyProperty& property, const std::vector<std::string_view>& words,
               std::size_t& next, std::vector<double>& values) {
  values.clear();
  const auto take = [&]() -> std::optional<double> {
    return next < words.size() ? ParseNumber<double>(words[next++]) : std::nullopt;
  };
  double count = 1.0;
  if (property.is_list) {
    const std::optional<double> length = take();
    if (!length || !(*length >= 0.0 && *length <= static_cast<double>(words.size()))) return false;
    count = *length;
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    const std::optional<double> value = take();
    if (!value) return false;
    values.push_back(*value);
  }
  return true;
}

bool IsBlank(std::string_view text) {
  return text.find_first_not_of(" \t\r\n") == std::string_view::npos;
}

}  // namespace

int PlyElement::Find(std::string_view property) const {
  for (std::size_t i = 0; i < properties.size(); ++i) {
    if (properties[i].name == property) return static_cast<int>(i);
  }
  return -1;
}

const PlyElement* PlyReader::Find(std::string_view element) const {
  for (const PlyElement& known : elements_) {
    if (known.name == element) return &known;
  }
  return nullptr;
}

Result<PlyReader> PlyReader::Open(const std::string& path) {
  Result<std::string> content = ReadFile(path);
  if (!content) return Forward(content);
  PlyReader reader;
  reader.path_ = path;
  reader.content_ = std::move(*content);
  if (Status status = reader.ParseHeader(); !status) return tl::unexpected<Error>(status.error());
  if (Status status = reader.CheckCounts(); !status) return tl::unexpected<Error>(status.error());
  return reader;
}

Status PlyReader::ParseHeader() {
  TextLines lines(content_);
  const std::optional<std::string_view> magic = lines.Next();
  if (!magic || *magic != "ply") return Fail("{}: not a PLY file", path_);
  std::vector<std::string_view> words;
  bool has_format = false;
  while (const std::optional<std::string_view> line = lines.Next()) {
    SplitWords(*line, words);
    if (words.empty() || words[0] == "comment") continue;
    if (words[0] == "end_header") {
      if (!has_format) return Fail("{}: the header has no format line", path_);
      body_ = content_.size() - lines.rest().size();
      body_line_ = lines.number();
      return {};
    }
    has_format = has_format || words[0] == "format";
    if (Status status = ParseHeaderLine(words, lines.number()); !status) return status;
  }
  return Fail("{}: the header has no end_header", path_);
}

Status PlyReader::ParseHeaderLine(const std::vector<std::string_view>& words, int line) {
  if (words[0] == "obj_info") {
    if (words.size() < 2) return {};
    std::string value;
    for (std::size_t i = 2; i < words.size(); ++i) {
      value += (i > 2 ? " " : "") + std::string(words[i]);
    }
    obj_info_[std::string(words[1])] = value;
    return {};
  }
  if (words[0] == "format") {
    const std::string_view name = words.size() > 1 ? words[1] : "";
    if (name == "ascii") {
      format_ = PlyFormat::kAscii;
    } else if (name == "binary_little_endian") {
      format_ = PlyFormat::kLittleEndian;
    } else if (name == "binary_big_endian") {
      format_ = PlyFormat::kBigEndian;
    } else {
      return Fail("{}: line {}: unknown format '{}'", path_, line, name);
    }
    return {};
  }
  if (words[0] == "element") return ParseElement(words, line);
  if (words[0] == "property") return ParseProperty(words, line);
  return Fail("{}: line {}: unknown header keyword '{}'", path_, line, words[0]);
}

Status PlyReader::ParseElement(const std::vector<std::string_view>& words, int line) {
  if (words.size() != 3) return Fail("{}: line {}: element needs a name and a count", path_, line);
  const std::optional<long long> count = ParseNumber<long long>(words[2]);
  if (!count || *count < 0) {
    return Fail("{}: line {}: element {} has the count '{}', must be a whole number from 0", path_,
                line, words[1], words[2]);
  }
  if (Find(words[1]) != nullptr) {
    return Fail("{}: line {}: element {} occurs twice", path_, line, words[1]);
  }
  PlyElement element;
  element.name = std::string(words[1]);
  element.count = static_cast<std::size_t>(*count);
  elements_.push_back(std::move(element));
  return {};
}

Status PlyReader::ParseProperty(const std::vector<std::string_view>& words, int line) {
  if (elements_.empty()) return Fail("{}: line {}: property before any element", path_, line);
  const bool is_list = words.size() > 1 && words[1] == "list";
  if (words.size() != (is_list ? 5U : 3U)) {
    return Fail("{}: line {}: a property needs its type and its name", path_, line);
  }
  const std::string_view type_name = words[words.size() - 2];
  const std::optional<PlyType> type = TypeOf(type_name);
  const std::optional<PlyType> count_type = TypeOf(is_list ? words[2] : "uchar");
  if (!type || !count_type) {
    return Fail("{}: line {}: property {} has the unknown type '{}'", path_, line, words.back(),
                type ? words[2] : type_name);
  }
  PlyProperty property;
  property.name = std::string(words.back());
  property.type = *type;
  property.is_list = is_list;
  property.count_type = *count_type;
  PlyElement& element = elements_.back();
  if (element.Find(property.name) >= 0) {
    return Fail("{}: line {}: property {} occurs twice", path_, line, property.name);
  }
  element.properties.push_back(std::move(property));
  return {};
}

Status PlyReader::CheckCounts() const {
  // The last ASCII line may end without a line break.
  std::size_t left = content_.size() - body_ + (format_ == PlyFormat::kAscii ? 1 : 0);
  for (const PlyElement& element : elements_) {
    const std::size_t row = LeastRowBytes(element, format_);
    if (row == 0 && element.count > 0) {
      return Fail("{}: element {} has no properties", path_, element.name);
    }
    if (element.count > 0 && element.count > left / row) {
      return Fail(
          "{}: the header promises {} rows of element {} of at least {} bytes, but only {} "
          "bytes are left",
          path_, element.count, element.name, row, left);
    }
    left -= element.count * row;
  }
  return {};
}

Status PlyReader::ReadRows(const PlyRowSink& sink) const {
  return format_ == PlyFormat::kAscii ? ReadAscii(sink) : ReadBinary(sink);
}

Status PlyReader::ReadAscii(const PlyRowSink& sink) const {
  TextLines lines(std::string_view(content_).substr(body_));
  std::vector<std::string_view> words;
  for (const PlyElement& element : elements_) {
    PlyRow row(element.properties.size());
    for (std::size_t i = 0; i < element.count; ++i) {
      do {
        const std::optional<std::string_view> line = lines.Next();
        if (!line) {
          return Fail("{}: the header promises {} rows of element {}, but the file ends after {}",
                      path_, element.count, element.name, i);
        }
        SplitWords(*line, words);
      } while (words.empty());
      std::size_t next = 0;
      for (std::size_t k = 0; k < row.size(); ++k) {
        if (!TakeWords(element.properties[k], words, next, row[k])) {
          return Fail("{}: line {}: row {} of element {} has no valid {} ({} words)", path_,
                      body_line_ + lines.number(), i, element.name, element.properties[k].name,
                      words.size());
        }
      }
      if (next != words.size()) {
        return Fail("{}: line {}: row {} of element {} has {} words, but its properties need {}",
                    path_, body_line_ + lines.number(), i, element.name, words.size(), next);
      }
      if (Status status = sink(element, i, row); !status) return status;
    }
  }
  if (!IsBlank(lines.rest())) {
    return Fail("{}: line {}: more rows than the header promises", path_,
                body_line_ + lines.number() + 1);
  }
  return {};
}

Status PlyReader::ReadBinary(const PlyRowSink& sink) const {
  const bool little = format_ == PlyFormat::kLittleEndian;
  BinaryCursor cursor(std::string_view(content_).substr(body_), little != HostIsLittleEndian());
  for (const PlyElement& element : elements_) {
    PlyRow row(element.properties.size());
    for (std::size_t i = 0; i < element.count; ++i) {
      for (std::size_t k = 0; k < row.size(); ++k) {
        const PlyProperty& property = element.properties[k];
        std::optional<double> count = 1.0;
        if (property.is_list) count = cursor.Take(property.count_type);
        const double capacity =
            static_cast<double>(cursor.rest().size()) / static_cast<double>(SizeOf(property.type));
        if (!count || !(*count >= 0.0) || !(*count <= capacity)) {
          return Fail(
              "{}: the file ends in row {} of {} of element {}: {} needs {} values, {} bytes "
              "are left",
              path_, i, element.count, element.name, property.name, count.value_or(1.0),
              cursor.rest().size());
        }
        row[k].clear();
        for (std::size_t n = 0; n < static_cast<std::size_t>(*count); ++n) {
          row[k].push_back(cursor.Take(property.type).value_or(0.0));
        }
      }
      if (Status status = sink(element, i, row); !status) return status;
    }
  }
  if (!IsBlank(cursor.rest())) {
    return Fail("{}: {} bytes follow the rows that the header promises", path_,
                cursor.rest().size());
  }
  return {};
}

}  // namespace fringe_fusion::internal
