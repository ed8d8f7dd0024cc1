#pragma once

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

namespace fringe_fusion::test {

/// A real matrix of a MATLAB file, column by column.
struct MatMatrix {
  std::vector<int> size;
  std::vector<double> values;
};

/// Just enough of MATLAB 5 files (little endian) to read a compressed matrix of doubles. Elements
/// are a type, a byte count and data, padded to 8 bytes; short ones share one word with their type.
/// Ref: MathWorks, "MAT-File Format", chapter 1.
class MatReader {
 public:
  explicit MatReader(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    if (bytes_.size() < kHeader) throw std::runtime_error(path + ": no MATLAB file");
  }

  [[nodiscard]] MatMatrix Read(const std::string& name) const {
    std::size_t at = kHeader;
    while (at + 8 <= bytes_.size()) {
      const Element compressed = Next(bytes_, at);
      if (compressed.type != kCompressed) continue;
      const std::vector<char> plain = Inflate(compressed);
      std::size_t inside = 0;
      const Element matrix = Next(plain, inside);
      std::size_t part = 8;
      Next(plain, part);  // flags
      const Element size = Next(plain, part);
      const Element label = Next(plain, part);
      if (matrix.type != kMatrix || std::string(label.data, label.size) != name) continue;
      const Element values = Next(plain, part);
      if (values.type != kDouble) throw std::runtime_error(name + ": not of doubles");
      return {Copy<int>(size), Copy<double>(values)};
    }
    throw std::runtime_error(name + ": not in the MATLAB file");
  }

 private:
  static constexpr std::size_t kHeader = 128;
  static constexpr std::uint32_t kDouble = 9;
  static constexpr std::uint32_t kMatrix = 14;
  static constexpr std::uint32_t kCompressed = 15;

  struct Element {
    std::uint32_t type = 0;
    std::size_t size = 0;
    const char* data = nullptr;
  };

  static Element Next(const std::vector<char>& bytes, std::size_t& at) {
    std::uint32_t words[2] = {0, 0};
    if (at + 8 > bytes.size()) throw std::runtime_error("MATLAB file: truncated");
    std::memcpy(words, bytes.data() + at, 8);
    Element element{words[0] & 0xFFFFU, words[0] >> 16U, bytes.data() + at + 4};
    if (element.size == 0) element = {words[0], words[1], bytes.data() + at + 8};
    const bool is_short = element.data == bytes.data() + at + 4;
    if (!is_short && at + 8 + element.size > bytes.size()) {
      throw std::runtime_error("MATLAB file: truncated");
    }
    const std::size_t padded =
        element.type == kCompressed ? element.size : (element.size + 7) / 8 * 8;
    at += is_short ? 8 : 8 + padded;
    return element;
  }

  static std::vector<char> Inflate(const Element& element) {
    z_stream stream{};
    if (inflateInit(&stream) != Z_OK) throw std::runtime_error("zlib: no memory");
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(element.data));
    stream.avail_in = static_cast<uInt>(element.size);
    std::vector<char> plain(std::size_t{1} << 20U);
    int status = Z_OK;
    while (status == Z_OK) {
      if (stream.total_out == plain.size()) plain.resize(2 * plain.size());
      stream.next_out = reinterpret_cast<Bytef*>(plain.data() + stream.total_out);
      stream.avail_out = static_cast<uInt>(plain.size() - stream.total_out);
      status = inflate(&stream, Z_NO_FLUSH);
    }
    plain.resize(stream.total_out);
    inflateEnd(&stream);
    if (status != Z_STREAM_END) throw std::runtime_error("MATLAB file: damaged");
    return plain;
  }

  template <typename T>
  static std::vector<T> Copy(const Element& element) {
    std::vector<T> values(element.size / sizeof(T));
    std::memcpy(values.data(), element.data, values.size() * sizeof(T));
    return values;
  }

  std::vector<char> bytes_;
};

}  // namespace fringe_fusion::test
