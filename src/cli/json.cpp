#include "json.hpp"

#include <cmath>

#include "fringe_fusion/io/file.hpp"

namespace fringe_fusion::cli {
namespace {

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      quoted += fmt::format("\\u{:04x}", static_cast<unsigned>(static_cast<unsigned char>(c)));
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

std::string Indented(const std::string& text) {
  std::string indented;
  for (const char c : text) {
    indented += c;
    if (c == '\n') indented += "  ";
  }
  return indented;
}

}  // namespace

Json& Json::SetText(const std::string& key, std::string text) {
  for (auto& member : members_) {
    if (member.first == key) {
      member.second = std::move(text);
      return *this;
    }
  }
  members_.emplace_back(key, std::move(text));
  return *this;
}

std::string Json::NumberText(double value) {
  return std::isfinite(value) ? fmt::format("{}", value) : "null";
}

Json& Json::Set(const std::string& key, const std::string& value) {
  return SetText(key, Quoted(value));
}

Json& Json::Set(const std::string& key, const Json& value) { return SetText(key, value.Text()); }

Json& Json::Set(const std::string& key, const std::vector<Json>& values) {
  if (values.empty()) return SetText(key, "[]");
  std::string text = "[";
  for (std::size_t i = 0; i < values.size(); ++i) {
    text += (i == 0 ? "\n  " : ",\n  ") + Indented(values[i].Text());
  }
  return SetText(key, text + "\n]");
}

std::string Json::Text() const {
  if (members_.empty()) return "{}";
  std::string text = "{";
  for (std::size_t i = 0; i < members_.size(); ++i) {
    text += (i == 0 ? "\n  " : ",\n  ") + Quoted(members_[i].first) + ": " +
            Indented(members_[i].second);
  }
  return text + "\n}";
}

Status WriteJson(const Json& json, const std::string& path) {
  return WriteAtomically(path, [&json](std::ostream& stream) -> Status {
    stream << json.Text() << '\n';
    return {};
  });
}

}  // namespace fringe_fusion::cli
