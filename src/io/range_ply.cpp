#include <array>
#include <cmath>
#include <limits>

#include "common/constants.hpp"
#include "fringe_fusion/io/file.hpp"
#include "little_endian.hpp"
#include "mesh_formats.hpp"
#include "ply.hpp"
#include "text_lines.hpp"

namespace fringe_fusion::internal {
namespace {

// The file holds no NaN: unknown values of a valid point are written as these, which cannot occur.
constexpr float kUnknownSigma = -1.0F;

// The vertices of the file in their order.
struct Points {
  std::vector<Eigen::Vector3f> points;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Rgb8> colors;
  std::vector<float> sigma_range;
  std::vector<float> sigma_lateral;
};

class VertexReader {
 public:
  VertexReader(const PlyElement& vertex, std::string path) : path_(std::move(path)) {
    for (std::size_t k = 0; k < kNames.size(); ++k) columns_[k] = vertex.Find(kNames[k]);
  }

  [[nodiscard]] Status Append(const PlyRow& row, Points& points) const {
    const Eigen::Vector3f point(Value(row, 0, kNan), Value(row, 1, kNan), Value(row, 2, kNan));
    if (!point.allFinite()) {
      return Fail("{}: vertex {} is not finite: {} {} {}", path_, points.points.size(), point.x(),
                  point.y(), point.z());
    }
    points.points.push_back(point);
    const Eigen::Vector3f normal(Value(row, 3, 0.0F), Value(row, 4, 0.0F), Value(row, 5, 0.0F));
    const bool known = normal.allFinite() && normal.squaredNorm() > 0.0F;
    points.normals.push_back(known ? normal : Eigen::Vector3f::Constant(kNan));
    points.colors.push_back(
        {Byte(row, 6, kPlainColor.r), Byte(row, 7, kPlainColor.g), Byte(row, 8, kPlainColor.b)});
    points.sigma_range.push_back(Sigma(row, 9));
    points.sigma_lateral.push_back(Sigma(row, 10));
    return {};
  }

 private:
  static constexpr std::array<const char*, 11> kNames = {
      "x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "sigma_range", "sigma_lateral"};

  [[nodiscard]] float Value(const PlyRow& row, std::size_t name, float missing) const {
    const int column = columns_[name];
    if (column < 0 || row[static_cast<std::size_t>(column)].size() != 1) return missing;
    return static_cast<float>(row[static_cast<std::size_t>(column)][0]);
  }
  [[nodiscard]] std::uint8_t Byte(const PlyRow& row, std::size_t name, std::uint8_t missing) const {
    const float value = Value(row, name, static_cast<float>(missing));
    return static_cast<std::uint8_t>(std::min(255.0F, std::max(0.0F, value)));
  }
  [[nodiscard]] float Sigma(const PlyRow& row, std::size_t name) const {
    const float sigma = Value(row, name, kUnknownSigma);
    return sigma >= 0.0F ? sigma : kNan;
  }

  std::array<int, kNames.size()> columns_{};
  std::string path_;
};

// Numbers of an obj_info line; empty when there is none.
Result<std::vector<double>> InfoNumbers(const PlyReader& reader, const std::string& key,
                                        std::size_t count, const std::string& path) {
  std::vector<double> numbers;
  const auto found = reader.obj_info().find(key);
  if (found == reader.obj_info().end()) return numbers;
  std::vector<std::string_view> words;
  SplitWords(found->second, words);
  for (const std::string_view word : words) {
    const std::optional<double> number = ParseNumber<double>(word);
    if (!number || !std::isfinite(*number)) {
      return Fail("{}: obj_info {} = {} must be numbers", path, key, found->second);
    }
    numbers.push_back(*number);
  }
  if (numbers.size() != count) {
    return Fail("{}: obj_info {} = {} must have {} numbers", path, key, found->second, count);
  }
  return numbers;
}

Result<std::optional<Eigen::Vector3f>> InfoVector(const PlyReader& reader, const std::string& key,
                                                  const std::string& path) {
  const auto numbers = InfoNumbers(reader, key, 3, path);
  if (!numbers) return Forward(numbers);
  if (numbers->empty()) return std::optional<Eigen::Vector3f>();
  return std::optional<Eigen::Vector3f>(Eigen::Vector3d(numbers->data()).cast<float>());
}

Status ReadInfo(const PlyReader& reader, const std::string& path, RangeImage& range) {
  const auto camera = InfoVector(reader, "camera_origin", path);
  if (!camera) return tl::unexpected<Error>(camera.error());
  const auto projector = InfoVector(reader, "projector_origin", path);
  if (!projector) return tl::unexpected<Error>(projector.error());
  const auto direction = InfoVector(reader, "line_of_sight", path);
  if (!direction) return tl::unexpected<Error>(direction.error());
  range.line_of_sight.directional = direction->has_value();
  if (*camera) range.line_of_sight.camera = **camera;
  if (*direction) range.line_of_sight.camera = **direction;
  range.line_of_sight.projector = *projector;
  for (const auto& [key, stamp] : {std::pair("first_stamp_ns", &RangeImage::first_stamp_ns),
                                   std::pair("last_stamp_ns", &RangeImage::last_stamp_ns)}) {
    const auto found = reader.obj_info().find(key);
    if (found == reader.obj_info().end()) continue;
    const std::optional<std::int64_t> value = ParseNumber<std::int64_t>(found->second);
    if (!value) return Fail("{}: obj_info {} = {} must be a number", path, key, found->second);
    range.*stamp = *value;
  }
  return {};
}

struct GridSize {
  int width = 0;
  int height = 0;
};

// Size of the grid; without a range_grid the cloud is one long row.
Result<GridSize> FindSize(const PlyReader& reader, const std::string& path) {
  const PlyElement* grid = reader.Find("range_grid");
  if (grid == nullptr) {
    return GridSize{static_cast<int>(reader.Find("vertex")->count), 1};
  }
  GridSize size;
  for (const auto& [key, value] :
       {std::pair("num_cols", &size.width), std::pair("num_rows", &size.height)}) {
    const auto numbers = InfoNumbers(reader, key, 1, path);
    if (!numbers) return Forward(numbers);
    if (numbers->empty()) return Fail("{}: has a range_grid, but no obj_info {}", path, key);
    const double number = (*numbers)[0];
    if (!(number >= 1.0 && number <= 1e6) || number != std::floor(number)) {
      return Fail("{}: obj_info {} = {} is outside [1, 1000000]", path, key, number);
    }
    *value = static_cast<int>(number);
  }
  const auto expected =
      static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height);
  if (grid->count != expected) {
    return Fail("{}: range_grid has {} rows, but num_cols x num_rows is {} x {} = {}", path,
                grid->count, size.width, size.height, expected);
  }
  return size;
}

void Place(const Points& from, std::size_t i, std::size_t pixel, RangeImage& range) {
  range.points[pixel] = from.points[i];
  range.normals[pixel] = from.normals[i];
  range.color[pixel] = from.colors[i];
  range.sigma_range[pixel] = from.sigma_range[i];
  range.sigma_lateral[pixel] = from.sigma_lateral[i];
}

Result<RangeImage> ReadRangeElements(const PlyReader& reader, const std::string& path) {
  const PlyElement* vertex = reader.Find("vertex");
  if (vertex == nullptr) return Fail("{}: has no element 'vertex'", path);
  for (const char* name : {"x", "y", "z"}) {
    if (vertex->Find(name) < 0) return Fail("{}: element vertex has no {}", path, name);
  }
  const Result<GridSize> size = FindSize(reader, path);
  if (!size) return Forward(size);
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> grid;  // vertex of each pixel
  Points points;
  const VertexReader vertices(*vertex, path);
  const Status status = reader.ReadRows(
      [&](const PlyElement& element, std::size_t index, const PlyRow& row) -> Status {
        if (element.name == "vertex") return vertices.Append(row, points);
        if (element.name != "range_grid") return {};
        const bool empty = row.empty() || row[0].empty();
        grid.push_back(empty ? kNone : static_cast<std::size_t>(std::max(0.0, row[0][0])));
        if (empty || (row[0].size() == 1 && row[0][0] >= 0.0 &&
                      row[0][0] < static_cast<double>(vertex->count))) {
          return {};
        }
        return Fail(
            "{}: row {} of range_grid names {} vertices, the first is {}, must be one in "
            "[0, {})",
            path, index, row[0].size(), row[0][0], vertex->count);
      });
  if (!status) return tl::unexpected<Error>(status.error());
  RangeImage range = MakeRangeImage(size->width, size->height);
  if (Status info = ReadInfo(reader, path, range); !info) {
    return tl::unexpected<Error>(info.error());
  }
  if (reader.Find("range_grid") == nullptr) {
    for (std::size_t i = 0; i < points.points.size(); ++i) Place(points, i, i, range);
  }
  for (std::size_t pixel = 0; pixel < grid.size(); ++pixel) {
    if (grid[pixel] != kNone) Place(points, grid[pixel], pixel, range);
  }
  return range;
}

std::string InfoLine(const char* key, const Eigen::Vector3f& vector) {
  return fmt::format("obj_info {} {} {} {}\n", key, vector.x(), vector.y(), vector.z());
}

std::string Header(const RangeImage& range, int num_points) {
  const LineOfSight& sight = range.line_of_sight;
  std::string text = "ply\nformat binary_little_endian 1.0\ncomment fringe_fusion, metres\n";
  text += fmt::format("obj_info num_cols {}\nobj_info num_rows {}\n", range.width, range.height);
  text += InfoLine(sight.directional ? "line_of_sight" : "camera_origin", sight.camera);
  if (sight.projector) text += InfoLine("projector_origin", *sight.projector);
  text += fmt::format("obj_info first_stamp_ns {}\nobj_info last_stamp_ns {}\n",
                      range.first_stamp_ns, range.last_stamp_ns);
  text += fmt::format("element vertex {}\n", num_points);
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) {
    text += fmt::format("property float {}\n", name);
  }
  text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  text += "property float sigma_range\nproperty float sigma_lateral\n";
  text += fmt::format("element range_grid {}\nproperty list uchar int vertex_indices\n",
                      range.points.size());
  return text + "end_header\n";
}

void PutPoint(const RangeImage& range, std::size_t i, std::string& bytes) {
  const Eigen::Vector3f normal =
      range.normals[i].allFinite() ? range.normals[i] : Eigen::Vector3f::Zero().eval();
  for (int k = 0; k < 3; ++k) PutFloat(bytes, range.points[i][k]);
  for (int k = 0; k < 3; ++k) PutFloat(bytes, normal[k]);
  PutByte(bytes, range.color[i].r);
  PutByte(bytes, range.color[i].g);
  PutByte(bytes, range.color[i].b);
  for (const float sigma : {range.sigma_range[i], range.sigma_lateral[i]}) {
    PutFloat(bytes, std::isfinite(sigma) ? sigma : kUnknownSigma);
  }
}

}  // namespace

Result<RangeImage> ReadRangePly(const std::string& path) {
  const Result<PlyReader> reader = PlyReader::Open(path);
  if (!reader) return Forward(reader);
  return ReadRangeElements(*reader, path);
}

Status WriteRangePly(const RangeImage& range, const std::string& path) {
  std::string bytes = Header(range, CountValid(range));
  for (std::size_t i = 0; i < range.points.size(); ++i) {
    if (range.points[i].allFinite()) PutPoint(range, i, bytes);
  }
  std::int32_t next = 0;
  for (const Eigen::Vector3f& point : range.points) {
    const bool valid = point.allFinite();
    PutByte(bytes, valid ? 1 : 0);
    if (valid) PutInt32(bytes, next++);
  }
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return {};
  });
}

}  // namespace fringe_fusion::internal
