#include <pcl/PCLPointCloud2.h>
#include <pcl/console/print.h>
#include <pcl/io/pcd_io.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "common/constants.hpp"
#include "fringe_fusion/io/file.hpp"
#include "mesh_formats.hpp"
#include "text_lines.hpp"

namespace fringe_fusion::internal {
namespace {

struct PcdFile {
  pcl::PCLPointCloud2 cloud;
  Eigen::Vector4f origin = Eigen::Vector4f::Zero();
};

// PCL prints its complaints; here they become errors.
class QuietPcl {
 public:
  QuietPcl() : level_(pcl::console::getVerbosityLevel()) {
    pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
  }
  ~QuietPcl() { pcl::console::setVerbosityLevel(level_); }
  QuietPcl(const QuietPcl&) = delete;
  QuietPcl& operator=(const QuietPcl&) = delete;

 private:
  pcl::console::VERBOSITY_LEVEL level_;
};

// What a PCD header says of the amount of data.
struct PcdHeader {
  double width = 0.0;
  double height = 1.0;
  double points = -1.0;
  std::vector<double> sizes;
  std::vector<double> counts;
  std::string data;
  std::string_view body;

  [[nodiscard]] double PointBytes() const {
    double bytes = 0.0;
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      bytes += sizes[i] * (i < counts.size() ? counts[i] : 1.0);
    }
    return bytes;
  }
};

Result<PcdHeader> ParseHeader(std::string_view content, const std::string& path) {
  PcdHeader header;
  TextLines lines(content);
  std::vector<std::string_view> words;
  while (const std::optional<std::string_view> line = lines.Next()) {
    SplitWords(*line, words);
    if (words.empty() || words[0][0] == '#') continue;
    if (words[0] == "DATA") {
      header.data = words.size() > 1 ? std::string(words[1]) : "";
      header.body = lines.rest();
      if (header.points < 0.0) header.points = header.width * header.height;
      return header;
    }
    for (const auto& [key, list] :
         {std::pair("SIZE", &header.sizes), std::pair("COUNT", &header.counts)}) {
      if (words[0] != key) continue;
      for (std::size_t i = 1; i < words.size(); ++i) {
        list->push_back(ParseNumber<double>(words[i]).value_or(-1.0));
        if (!(list->back() >= 1.0 && list->back() <= 1e6)) {
          return Fail("{}: {} has the value '{}'", path, key, words[i]);
        }
      }
    }
    for (const auto& [key, value] :
         {std::pair("WIDTH", &header.width), std::pair("HEIGHT", &header.height),
          std::pair("POINTS", &header.points)}) {
      if (words[0] != key) continue;
      *value = ParseNumber<double>(words.size() > 1 ? words[1] : "").value_or(-1.0);
      if (!(*value >= 0.0 && *value <= 1e10)) {
        return Fail("{}: {} = '{}' must be a whole number from 0", path, key,
                    words.size() > 1 ? words[1] : "");
      }
    }
  }
  return Fail("{}: not a PCD file: no DATA line", path);
}

// PCL trusts its header; a lying one would make it read beyond the file or allocate without limit.
Status CheckHeader(const PcdHeader& header, const std::string& path) {
  if (header.width * header.height != header.points) {
    return Fail("{}: WIDTH x HEIGHT is {} x {}, but POINTS is {}", path, header.width,
                header.height, header.points);
  }
  const double bytes = header.points * header.PointBytes();
  const auto available = static_cast<double>(header.body.size());
  if (header.data == "binary") {
    if (bytes <= available) return {};
    return Fail("{}: the header promises {} points = {} bytes, but {} follow", path, header.points,
                bytes, available);
  }
  if (header.data == "binary_compressed") {
    if (available < 8.0) return Fail("{}: truncated PCD: {} bytes of data", path, available);
    std::array<std::uint32_t, 2> sizes{};
    std::memcpy(sizes.data(), header.body.data(), sizeof(sizes));
    if (sizes[0] + 8.0 <= available && static_cast<double>(sizes[1]) == bytes) return {};
    return Fail("{}: compressed data of {} bytes for {} bytes, but {} and {} are expected", path,
                sizes[0], sizes[1], available - 8.0, bytes);
  }
  if (header.data != "ascii") return Fail("{}: unknown DATA '{}'", path, header.data);
  double num_lines = 0.0;
  TextLines lines(header.body);
  while (const std::optional<std::string_view> line = lines.Next()) {
    num_lines += line->find_first_not_of(" \t") == std::string_view::npos ? 0.0 : 1.0;
  }
  if (num_lines == header.points) return {};
  return Fail("{}: the header promises {} points, but {} lines follow", path, header.points,
              num_lines);
}

Result<PcdFile> ReadPcd(const std::string& path) {
  const Result<std::string> content = ReadFile(path);
  if (!content) return Forward(content);
  const Result<PcdHeader> header = ParseHeader(*content, path);
  if (!header) return Forward(header);
  if (Status status = CheckHeader(*header, path); !status) {
    return tl::unexpected<Error>(status.error());
  }
  PcdFile file;
  if (header->points == 0.0) return file;
  const QuietPcl quiet;
  try {
    Eigen::Quaternionf orientation;
    int version = 0;
    if (pcl::PCDReader().read(path, file.cloud, file.origin, orientation, version) != 0) {
      return Fail("{}: cannot be read as PCD", path);
    }
  } catch (const std::exception& exception) {
    return Fail("{}: cannot be read as PCD: {}", path, exception.what());
  }
  return file;
}

// One scalar field of a cloud.
class Field {
 public:
  Field(const pcl::PCLPointCloud2& cloud, const std::string& name) : cloud_(cloud) {
    for (const pcl::PCLPointField& field : cloud.fields) {
      if (field.name == name) field_ = &field;
    }
  }
  [[nodiscard]] bool exists() const { return field_ != nullptr; }
  [[nodiscard]] float At(std::size_t point) const {
    switch (field_->datatype) {
      case pcl::PCLPointField::FLOAT32:
        return Load<float>(point);
      case pcl::PCLPointField::FLOAT64:
        return static_cast<float>(Load<double>(point));
      case pcl::PCLPointField::INT32:
        return static_cast<float>(Load<std::int32_t>(point));
      case pcl::PCLPointField::UINT32:
        return static_cast<float>(Load<std::uint32_t>(point));
      case pcl::PCLPointField::INT16:
        return static_cast<float>(Load<std::int16_t>(point));
      case pcl::PCLPointField::UINT16:
        return static_cast<float>(Load<std::uint16_t>(point));
      case pcl::PCLPointField::INT8:
        return static_cast<float>(Load<std::int8_t>(point));
      default:
        return static_cast<float>(Load<std::uint8_t>(point));
    }
  }
  // Colour packed as 0x00RRGGBB into the bits of a float or an integer.
  [[nodiscard]] Rgb8 ColorAt(std::size_t point) const {
    const auto packed = Load<std::uint32_t>(point);
    return {static_cast<std::uint8_t>(packed >> 16U), static_cast<std::uint8_t>(packed >> 8U),
            static_cast<std::uint8_t>(packed)};
  }

 private:
  template <typename T>
  [[nodiscard]] T Load(std::size_t point) const {
    T value{};
    const std::size_t at = point * cloud_.point_step + field_->offset;
    if (at + sizeof(T) <= cloud_.data.size()) std::memcpy(&value, &cloud_.data[at], sizeof(T));
    return value;
  }
  const pcl::PCLPointCloud2& cloud_;
  const pcl::PCLPointField* field_ = nullptr;
};

Eigen::Vector3f At(const std::array<Field, 3>& fields, std::size_t point) {
  return {fields[0].At(point), fields[1].At(point), fields[2].At(point)};
}

bool AllExist(const std::array<Field, 3>& fields) {
  return fields[0].exists() && fields[1].exists() && fields[2].exists();
}

Result<RangeImage> ToRange(const PcdFile& file, const std::string& path) {
  const pcl::PCLPointCloud2& cloud = file.cloud;
  const std::array<Field, 3> position{Field(cloud, "x"), Field(cloud, "y"), Field(cloud, "z")};
  const std::array<Field, 3> normal{Field(cloud, "normal_x"), Field(cloud, "normal_y"),
                                    Field(cloud, "normal_z")};
  const Field rgb = Field(cloud, "rgb").exists() ? Field(cloud, "rgb") : Field(cloud, "rgba");
  const Field sigma_range(cloud, "sigma_range");
  const Field sigma_lateral(cloud, "sigma_lateral");
  RangeImage range = MakeRangeImage(static_cast<int>(cloud.width), static_cast<int>(cloud.height));
  if (range.points.empty()) return range;
  if (!AllExist(position)) return Fail("{}: has no fields x, y, z", path);
  for (std::size_t i = 0; i < range.points.size(); ++i) {
    const Eigen::Vector3f point = At(position, i);
    if (!point.allFinite()) continue;
    range.points[i] = point;
    if (AllExist(normal)) range.normals[i] = At(normal, i);
    range.color[i] = rgb.exists() ? rgb.ColorAt(i) : kPlainColor;
    if (sigma_range.exists()) range.sigma_range[i] = sigma_range.At(i);
    if (sigma_lateral.exists()) range.sigma_lateral[i] = sigma_lateral.At(i);
  }
  range.line_of_sight.camera = file.origin.head<3>();
  return range;
}

// A cloud of float fields, all NaN.
pcl::PCLPointCloud2 MakeCloud(int width, int height, const std::vector<std::string>& names) {
  pcl::PCLPointCloud2 cloud;
  for (const std::string& name : names) {
    pcl::PCLPointField field;
    field.name = name;
    field.offset = static_cast<pcl::uindex_t>(4 * cloud.fields.size());
    field.datatype = pcl::PCLPointField::FLOAT32;
    field.count = 1;
    cloud.fields.push_back(field);
  }
  cloud.width = static_cast<pcl::uindex_t>(width);
  cloud.height = static_cast<pcl::uindex_t>(height);
  cloud.point_step = static_cast<pcl::uindex_t>(4 * names.size());
  cloud.row_step = cloud.point_step * cloud.width;
  return cloud;
}

void Put(std::vector<std::uint8_t>& data, float value) {
  std::array<std::uint8_t, 4> bytes{};
  std::memcpy(bytes.data(), &value, 4);
  data.insert(data.end(), bytes.begin(), bytes.end());
}

void Put(std::vector<std::uint8_t>& data, const Eigen::Vector3f& vector) {
  for (int k = 0; k < 3; ++k) Put(data, vector[k]);
}

void Put(std::vector<std::uint8_t>& data, const Rgb8& color) {
  const std::uint32_t packed = (static_cast<std::uint32_t>(color.r) << 16U) |
                               (static_cast<std::uint32_t>(color.g) << 8U) | color.b;
  float value = 0.0F;
  std::memcpy(&value, &packed, 4);
  Put(data, value);
}

Status WriteCloud(const pcl::PCLPointCloud2& cloud, const Eigen::Vector3f& origin,
                  const std::string& path) {
  std::string bytes;
  try {
    pcl::PCDWriter writer;
    bytes =
        writer.generateHeaderBinary(cloud, Eigen::Vector4f(origin.x(), origin.y(), origin.z(), 0),
                                    Eigen::Quaternionf::Identity());
  } catch (const std::exception& exception) {
    return Fail("{}: cannot be written as PCD: {}", path, exception.what());
  }
  bytes += "DATA binary\n";
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << bytes;
    stream.write(reinterpret_cast<const char*>(cloud.data.data()),
                 static_cast<std::streamsize>(cloud.data.size()));
    return {};
  });
}

}  // namespace

Result<RangeImage> ReadRangePcd(const std::string& path) {
  const Result<PcdFile> file = ReadPcd(path);
  if (!file) return Forward(file);
  return ToRange(*file, path);
}

Result<Mesh> ReadMeshPcd(const std::string& path) {
  const Result<PcdFile> file = ReadPcd(path);
  if (!file) return Forward(file);
  const Result<RangeImage> range = ToRange(*file, path);
  if (!range) return Forward(range);
  Mesh mesh;
  const bool has_normals = Field(file->cloud, "normal_x").exists();
  const bool has_colors = Field(file->cloud, "rgb").exists() || Field(file->cloud, "rgba").exists();
  const Field sigma(file->cloud, "sigma");
  for (std::size_t i = 0; i < range->points.size(); ++i) {
    if (!range->points[i].allFinite()) continue;
    mesh.vertices.push_back(range->points[i]);
    if (has_normals) mesh.normals.push_back(range->normals[i]);
    if (has_colors) mesh.colors.push_back(range->color[i]);
    if (sigma.exists()) mesh.sigma.push_back(sigma.At(i));
  }
  return mesh;
}

Status WriteMeshPcd(const Mesh& mesh, const std::string& path) {
  std::vector<std::string> names = {"x", "y", "z"};
  if (!mesh.normals.empty()) names.insert(names.end(), {"normal_x", "normal_y", "normal_z"});
  if (!mesh.colors.empty()) names.emplace_back("rgb");
  if (!mesh.sigma.empty()) names.emplace_back("sigma");
  pcl::PCLPointCloud2 cloud = MakeCloud(static_cast<int>(mesh.vertices.size()), 1, names);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    Put(cloud.data, mesh.vertices[i]);
    if (!mesh.normals.empty()) Put(cloud.data, mesh.normals[i]);
    if (!mesh.colors.empty()) Put(cloud.data, mesh.colors[i]);
    if (!mesh.sigma.empty()) Put(cloud.data, mesh.sigma[i]);
  }
  return WriteCloud(cloud, Eigen::Vector3f::Zero(), path);
}

Status WriteRangePcd(const RangeImage& range, const std::string& path) {
  pcl::PCLPointCloud2 cloud = MakeCloud(
      range.width, range.height,
      {"x", "y", "z", "normal_x", "normal_y", "normal_z", "rgb", "sigma_range", "sigma_lateral"});
  for (std::size_t i = 0; i < range.points.size(); ++i) {
    const bool valid = range.points[i].allFinite();
    const Eigen::Vector3f nothing = Eigen::Vector3f::Constant(kNan);
    Put(cloud.data, valid ? range.points[i] : nothing);
    Put(cloud.data, valid ? range.normals[i] : nothing);
    Put(cloud.data, range.color[i]);
    Put(cloud.data, valid ? range.sigma_range[i] : kNan);
    Put(cloud.data, valid ? range.sigma_lateral[i] : kNan);
  }
  return WriteCloud(cloud, range.line_of_sight.camera, path);
}

}  // namespace fringe_fusion::internal
