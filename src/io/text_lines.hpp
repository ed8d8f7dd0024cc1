#pragma once

#include <charconv>
#include <optional>
#include <string_view>
#include <vector>

namespace fringe_fusion::internal {

/// Walks over the lines of a text held by someone else; a carriage return at the end is dropped.
class TextLines {
 public:
  explicit TextLines(std::string_view text) : rest_(text) {}

  /// The next line, none at the end.
  std::optional<std::string_view> Next() {
    if (rest_.empty()) return std::nullopt;
    const std::size_t length = rest_.find('\n');
    std::string_view line = rest_.substr(0, length);
    rest_.remove_prefix(length == std::string_view::npos ? rest_.size() : length + 1);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    ++number_;
    return line;
  }
  /// What follows the last line handed out.
  [[nodiscard]] std::string_view rest() const { return rest_; }
  /// Number of the last line handed out, from 1.
  [[nodiscard]] int number() const { return number_; }

 private:
  std::string_view rest_;
  int number_ = 0;
};

/// Splits at blanks and tabs into `words`, which is reused to spare allocations.
inline void SplitWords(std::string_view line, std::vector<std::string_view>& words) {
  words.clear();
  constexpr std::string_view kBlank = " \t\r\n\v\f";
  std::size_t begin = line.find_first_not_of(kBlank);
  while (begin != std::string_view::npos) {
    const std::size_t end = line.find_first_of(kBlank, begin);
    words.push_back(line.substr(begin, end - begin));
    begin = end == std::string_view::npos ? end : line.find_first_not_of(kBlank, end);
  }
}

/// The whole word as a number (also nan and inf), independent of the locale.
template <typename Number>
[[nodiscard]] std::optional<Number> ParseNumber(std::string_view word) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  Number value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return std::nullopt;
  return value;
}

}  // namespace fringe_fusion::internal
