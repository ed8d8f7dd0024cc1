#include "fringe_fusion/io/config_yaml.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "yaml_fields.hpp"

namespace fringe_fusion::internal {

struct YamlReader::File {
  std::string path;
  MissingKeys missing;
  YAML::Node root;
  std::set<std::string> known;
  Status status;

  Status Load() {
    try {
      root = YAML::LoadFile(path);
      // A file of comments alone states nothing.
      if (root.IsNull() && missing == MissingKeys::kTakeDefaults) root = YAML::Load("{}");
      if (!root.IsMap()) return Fail("{}: not a YAML map", path);
    } catch (const YAML::BadFile&) {
      return Fail("{}: cannot be read", path);
    } catch (const YAML::Exception& exception) {
      return Fail("{}: {}", path, exception.what());
    }
    return {};
  }

  // The value of a key as a T; the value there is, where the key is missing.
  template <typename T>
  T Read(const char* name, T value, const std::string& expected) {
    known.insert(name);
    if (!status) return value;
    try {
      const YAML::Node field = root[name];
      if (!field) {
        if (missing == MissingKeys::kTakeDefaults) return value;
        status = Fail("{}: required key '{}' is missing", path, name);
        return value;
      }
      try {
        return field.as<T>();
      } catch (const YAML::Exception&) {
        status =
            Fail("{}: key '{}' has the value '{}', must be {}", path, name, Shown(field), expected);
      }
    } catch (const YAML::Exception& exception) {
      status = Fail("{}: {}", path, exception.what());
    }
    return value;
  }

  // Keys that no field has, or that occur twice.
  [[nodiscard]] Status CheckKeys() const {
    std::set<std::string> seen;
    for (const auto& entry : root) {
      const auto key = entry.first.as<std::string>();
      if (known.count(key) == 0) return Fail("{}: unknown key '{}'", path, key);
      if (!seen.insert(key).second) return Fail("{}: the key '{}' occurs twice", path, key);
    }
    return {};
  }
};

YamlReader::YamlReader(const std::string& path, MissingKeys missing)
    : file_(std::make_unique<File>()) {
  file_->path = path;
  file_->missing = missing;
  file_->status = file_->Load();
}

YamlReader::~YamlReader() = default;

void YamlReader::Read(const char* name, bool& value) {
  value = file_->Read(name, value, "true or false");
}

void YamlReader::Read(const char* name, int& value) {
  value = file_->Read(name, value, "a whole number");
}

void YamlReader::Read(const char* name, double& value) {
  value = file_->Read(name, value, "a number");
}

void YamlReader::Read(const char* name, std::string& value) {
  value = file_->Read(name, std::move(value), "a text");
}

void YamlReader::ReadList(const char* name, double* values, std::size_t count) {
  const std::string expected = fmt::format("a list of {} numbers", count);
  const std::vector<double> before(values, values + count);
  const std::vector<double> read = file_->Read(name, before, expected);
  if (read.size() == count) {
    std::copy(read.begin(), read.end(), values);
  } else if (file_->status) {
    file_->status = Fail("{}: key '{}' has the value '{}', must be {}", file_->path, name,
                         Shown(file_->root[name]), expected);
  }
}

Status YamlReader::Finish() const {
  if (!file_->status) return file_->status;
  try {
    return file_->CheckKeys();
  } catch (const YAML::Exception& exception) {
    return Fail("{}: {}", file_->path, exception.what());
  }
}

}  // namespace fringe_fusion::internal
