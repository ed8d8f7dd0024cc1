#include <set>

#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/file.hpp"
#include "target_yaml.hpp"

namespace fringe_fusion {
namespace {

using internal::QuotedYaml;
using internal::YamlFields;

// A point is one line of numbers: index, u, v, cov uu, uv, vv of the camera, and the same five of
// the projector where it has them.
constexpr std::size_t kCameraNumbers = 6;
constexpr std::size_t kAllNumbers = 11;

bool IsPositiveDefinite(const Eigen::Matrix2d& covariance) {
  return covariance(0, 0) > 0.0 && covariance(1, 1) > 0.0 && covariance.determinant() > 0.0;
}

void ReadPixel(const std::vector<double>& numbers, std::size_t first, Eigen::Vector2d& pixel,
               Eigen::Matrix2d& covariance_px2) {
  pixel = Eigen::Vector2d(numbers[first], numbers[first + 1]);
  covariance_px2 << numbers[first + 2], numbers[first + 3], numbers[first + 3], numbers[first + 4];
}

Result<PointSighting> ReadPoint(const std::vector<double>& numbers, int num_points) {
  if (numbers.size() != kCameraNumbers && numbers.size() != kAllNumbers) {
    return Fail("has {} numbers, must have {} or {}", numbers.size(), kCameraNumbers, kAllNumbers);
  }
  PointSighting point;
  if (!(numbers[0] >= 0.0 && numbers[0] < num_points) ||
      numbers[0] != static_cast<int>(numbers[0])) {
    return Fail("names point {}, the target has the points 0 to {}", numbers[0], num_points - 1);
  }
  point.point = static_cast<int>(numbers[0]);
  ReadPixel(numbers, 1, point.pixel_camera, point.covariance_camera_px2);
  point.has_projector = numbers.size() == kAllNumbers;
  if (point.has_projector) {
    ReadPixel(numbers, kCameraNumbers, point.pixel_projector, point.covariance_projector_px2);
  }
  for (const double number : numbers) {
    if (!std::isfinite(number)) return Fail("has {}, must be finite", number);
  }
  if (!IsPositiveDefinite(point.covariance_camera_px2) ||
      (point.has_projector && !IsPositiveDefinite(point.covariance_projector_px2))) {
    return Fail("point {} has a covariance that is not positive definite", point.point);
  }
  return point;
}

Status ReadPoints(const std::vector<YAML::Node>& lines, int num_points, TargetSighting& sighting) {
  std::set<int> seen;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    std::vector<double> numbers;
    try {
      numbers = lines[i].as<std::vector<double>>();
    } catch (const YAML::Exception&) {
      return Fail("points[{}] must be a list of numbers", i);
    }
    const Result<PointSighting> point = ReadPoint(numbers, num_points);
    if (!point) return Fail("points[{}] {}", i, point.error().message);
    if (!seen.insert(point->point).second) {
      return Fail("points[{}] names point {} a second time", i, point->point);
    }
    sighting.points.push_back(*point);
  }
  return {};
}

Result<TargetSighting> ReadSighting(const YAML::Node& node, const std::string& owner,
                                    int num_points) {
  TargetSighting sighting;
  YamlFields fields(node, owner);
  fields.Required("name", sighting.name);
  fields.Optional("is_ellipse_centre", sighting.is_ellipse_centre);
  fields.Optional("is_orientation_assumed", sighting.is_orientation_assumed);
  const Status points = ReadPoints(fields.List("points"), num_points, sighting);
  if (!points) fields.Reject(points.error().message);
  if (Status status = fields.Finish(); !status) return tl::unexpected<Error>(status.error());
  return sighting;
}

std::string PixelYaml(const Eigen::Vector2d& pixel, const Eigen::Matrix2d& c) {
  return fmt::format(", {}, {}, {}, {}, {}", pixel.x(), pixel.y(), c(0, 0), c(0, 1), c(1, 1));
}

std::string SightingYaml(const TargetSighting& sighting) {
  std::string text = fmt::format("  - name: {}\n", QuotedYaml(sighting.name));
  if (sighting.is_ellipse_centre) text += "    is_ellipse_centre: true\n";
  if (sighting.is_orientation_assumed) text += "    is_orientation_assumed: true\n";
  text += sighting.points.empty() ? "    points: []\n" : "    points:\n";
  for (const PointSighting& p : sighting.points) {
    text +=
        fmt::format("      - [{}{}", p.point, PixelYaml(p.pixel_camera, p.covariance_camera_px2));
    if (p.has_projector) text += PixelYaml(p.pixel_projector, p.covariance_projector_px2);
    text += "]\n";
  }
  return text;
}

Status CheckSizes(const SightingsFile& file, const std::string& path) {
  if (file.camera_width < 1 || file.camera_height < 1) {
    return Fail("{}: camera size {} x {} must be positive", path, file.camera_width,
                file.camera_height);
  }
  if (file.projector_width < 0 || file.projector_height < 0 ||
      (file.projector_width == 0) != (file.projector_height == 0)) {
    return Fail("{}: projector size {} x {} must be positive, or 0 x 0 for none", path,
                file.projector_width, file.projector_height);
  }
  return {};
}

}  // namespace

Result<SightingsFile> LoadSightings(const std::string& path) {
  const Result<YAML::Node> root = internal::LoadYaml(path);
  if (!root) return Forward(root);
  SightingsFile file;
  YamlFields fields(*root, path);
  fields.Nested("target", [&](YamlFields& target) { internal::ReadTarget(target, file.target); });
  fields.Nested("camera", [&](YamlFields& camera) {
    camera.Required("width", file.camera_width);
    camera.Required("height", file.camera_height);
  });
  if (fields.Has("projector")) {
    fields.Nested("projector", [&](YamlFields& projector) {
      projector.Required("width", file.projector_width);
      projector.Required("height", file.projector_height);
    });
  }
  const std::vector<YAML::Node> sightings = fields.List("sightings");
  Status status = fields.Finish();
  if (status) status = Validate(file.target, path + ": target");
  if (status) status = CheckSizes(file, path);
  if (!status) return tl::unexpected<Error>(status.error());
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    Result<TargetSighting> sighting =
        ReadSighting(sightings[i], fmt::format("{}: sightings[{}]", path, i),
                     file.target.num_columns * file.target.num_rows);
    if (!sighting) return Forward(sighting);
    file.sightings.push_back(std::move(*sighting));
  }
  return file;
}

Status SaveSightings(const SightingsFile& file, const std::string& path) {
  if (Status status = Validate(file.target, path + ": target"); !status) return status;
  if (Status status = CheckSizes(file, path); !status) return status;
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream
        << "# Where the points of a calibration target were seen. A point: index, then u, v and\n"
           "# the covariance uu, uv, vv [px, px^2] in the camera, then in the projector.\n"
           "target:\n";
    std::istringstream lines(internal::TargetYaml(file.target));
    for (std::string line; std::getline(lines, line);) stream << "  " << line << "\n";
    stream << fmt::format("camera: {{width: {}, height: {}}}\n", file.camera_width,
                          file.camera_height);
    if (file.projector_width > 0) {
      stream << fmt::format("projector: {{width: {}, height: {}}}\n", file.projector_width,
                            file.projector_height);
    }
    stream << (file.sightings.empty() ? "sightings: []\n" : "sightings:\n");
    for (const TargetSighting& sighting : file.sightings) stream << SightingYaml(sighting);
    return {};
  });
}

}  // namespace fringe_fusion
