#include "options.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <sstream>

#include "fringe_fusion/io/opencv_calibration.hpp"

namespace fringe_fusion::cli {

Option Option::Required() const {
  option_->required();
  return *this;
}

Option Option::TypeName(const std::string& name) const {
  option_->type_name(name);
  return *this;
}

Option Option::ShowDefault() const {
  option_->capture_default_str();
  return *this;
}

Option Option::InRange(int low, int high) const {
  option_->check(CLI::Range(low, high));
  return *this;
}

Option Option::InRange(double low, double high) const {
  option_->check(CLI::Range(low, high));
  return *this;
}

Option Option::AtLeastZero() const {
  option_->check(CLI::Validator(
      [](const std::string& text) {
        double value = 0.0;
        const bool is_valid = CLI::detail::lexical_cast(text, value) && value >= 0.0;
        return is_valid ? std::string() : fmt::format("{} must be >= 0", text);
      },
      ">= 0"));
  return *this;
}

Option Option::OneOf(const std::vector<std::string>& values) const {
  option_->check(CLI::IsMember(values));
  return *this;
}

Option Option::Delimiter(char delimiter) const {
  option_->delimiter(delimiter);
  return *this;
}

Option Option::Needs(const Option& other) const {
  option_->needs(other.option_);
  return *this;
}

Option Option::Excludes(const Option& other) const {
  option_->excludes(other.option_);
  return *this;
}

Option Command::AddOption(const std::string& name, std::string& value,
                          const std::string& description) {
  return Option(app_->add_option(name, value, description));
}

Option Command::AddOption(const std::string& name, int& value, const std::string& description) {
  return Option(app_->add_option(name, value, description));
}

Option Command::AddOption(const std::string& name, double& value, const std::string& description) {
  return Option(app_->add_option(name, value, description));
}

Option Command::AddOption(const std::string& name, std::array<double, 3>& value,
                          const std::string& description) {
  return Option(app_->add_option(name, value, description));
}

Option Command::AddFlag(const std::string& name, bool& value, const std::string& description) {
  return Option(app_->add_flag(name, value, description));
}

bool Command::HasOption(const std::string& name) const {
  return app_->get_option_no_throw(name) != nullptr;
}

Result<PictureSize> ParsePictureSize(const std::string& option, const std::string& text) {
  PictureSize size;
  char cross = 0;
  std::istringstream stream(text);
  stream >> size.width >> cross >> size.height;
  if (!stream || cross != 'x' || stream.peek() != std::istringstream::traits_type::eof() ||
      size.width < 1 || size.height < 1) {
    return Fail("{} '{}' must be like 1280x800", option, text);
  }
  return size;
}

}  // namespace fringe_fusion::cli
