#include "fringe_fusion/planning/occupancy_map.hpp"

#include <octomap/OcTree.h>
#include <octomap/octomap.h>

#include <algorithm>
#include <cmath>
#include <ostream>
#include <sstream>
#include <utility>

#include "fringe_fusion/io/file.hpp"

namespace fringe_fusion {
namespace {

octomap::point3d ToOctomap(const Eigen::Vector3d& point) {
  return {static_cast<float>(point.x()), static_cast<float>(point.y()),
          static_cast<float>(point.z())};
}

bool KeyLess(const octomap::OcTreeKey& a, const octomap::OcTreeKey& b) {
  return std::lexicographical_compare(a.k, a.k + 3, b.k, b.k + 3);
}

void MakeDistinct(std::vector<octomap::OcTreeKey>& keys) {
  std::sort(keys.begin(), keys.end(), KeyLess);
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
}

// Every n-th pixel in both directions, so that at most max_points remain, spread over the image.
// Past the image size one pixel remains, so the search ends.
std::vector<Eigen::Vector3f> EvenSubset(const RangeImage& range, int max_points) {
  int stride = 1;
  while (true) {
    std::vector<Eigen::Vector3f> points;
    for (int y = 0; y < range.height; y += stride) {
      for (int x = 0; x < range.width; x += stride) {
        if (IsValid(range, x, y)) points.push_back(range.points(x, y));
      }
    }
    if (points.size() <= static_cast<std::size_t>(max_points)) return points;
    const double excess = static_cast<double>(points.size()) / max_points;
    stride = std::max(stride + 1, static_cast<int>(stride * std::sqrt(excess)));
  }
}

// One device's ray to a point, in the camera frame.
struct Ray {
  Eigen::Vector3d origin;
  Eigen::Vector3d end;
};

std::vector<Ray> RaysTo(const Eigen::Vector3f& point, const LineOfSight& line_of_sight,
                        double max_range_m) {
  const Eigen::Vector3d end = point.cast<double>();
  std::vector<Ray> rays;
  if (line_of_sight.directional) {
    // Parallel rays have no origin: the way that the sensor can have looked through is taken.
    rays.push_back({end + line_of_sight.camera.cast<double>().normalized() * max_range_m, end});
  } else {
    rays.push_back({line_of_sight.camera.cast<double>(), end});
  }
  if (line_of_sight.projector) rays.push_back({line_of_sight.projector->cast<double>(), end});
  return rays;
}

struct CellRay {
  octomap::OcTreeKey key;
  std::size_t device = 0;
  std::size_t index = 0;  // order of insertion, to make the sort unique
  Ray ray;
};

bool CellRayLess(const CellRay& a, const CellRay& b) {
  if (a.key != b.key) return KeyLess(a.key, b.key);
  if (a.device != b.device) return a.device < b.device;
  return a.index < b.index;
}

}  // namespace

struct OccupancyMap::Impl {
  explicit Impl(const OccupancyConfig& occupancy_config)
      : config(occupancy_config), tree(occupancy_config.resolution_m) {}
  OccupancyConfig config;
  octomap::OcTree tree;

  [[nodiscard]] Result<std::vector<CellRay>> MakeRays(const View& view) const;
  [[nodiscard]] std::vector<Cell> Cells(bool occupied) const;
};

// Rays of one device that end in the same cell cross nearly the same cells: one of them is enough.
Result<std::vector<CellRay>> OccupancyMap::Impl::MakeRays(const View& view) const {
  std::vector<CellRay> rays;
  for (const Eigen::Vector3f& point : EvenSubset(view.range, config.max_points_per_view)) {
    const Eigen::Vector3d point_object = view.pose.T_object_camera * point.cast<double>();
    octomap::OcTreeKey key;
    if (!tree.coordToKeyChecked(ToOctomap(point_object), key)) {
      return Fail("view {} ({}): a point at {} m is outside the map of {} cells of {} m", view.id,
                  view.name, point_object.norm(), 65536, config.resolution_m);
    }
    const std::vector<Ray> of_point = RaysTo(point, view.range.line_of_sight, config.max_range_m);
    for (std::size_t device = 0; device < of_point.size(); ++device) {
      rays.push_back({key, device, rays.size(), of_point[device]});
    }
  }
  std::sort(rays.begin(), rays.end(), CellRayLess);
  const auto same = [](const CellRay& a, const CellRay& b) {
    return a.key == b.key && a.device == b.device;
  };
  rays.erase(std::unique(rays.begin(), rays.end(), same), rays.end());
  return rays;
}

std::vector<OccupancyMap::Cell> OccupancyMap::Impl::Cells(bool occupied) const {
  std::vector<Cell> cells;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (tree.isNodeOccupied(*leaf) != occupied) continue;
    cells.push_back(
        {Eigen::Vector3f(static_cast<float>(leaf.getX()), static_cast<float>(leaf.getY()),
                         static_cast<float>(leaf.getZ())),
         static_cast<float>(leaf.getSize()), static_cast<float>(leaf->getOccupancy())});
  }
  return cells;
}

OccupancyMap::OccupancyMap(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
OccupancyMap::OccupancyMap(OccupancyMap&&) noexcept = default;
OccupancyMap& OccupancyMap::operator=(OccupancyMap&&) noexcept = default;
OccupancyMap::~OccupancyMap() = default;

Result<OccupancyMap> OccupancyMap::Create(const OccupancyConfig& config) {
  if (Status status = CheckBounds(config, "occupancy"); !status) return Forward(status);
  return OccupancyMap(std::make_unique<Impl>(config));
}

Status OccupancyMap::AddView(const View& view) {
  if (Status status = Validate(view); !status) return status;
  const Result<std::vector<CellRay>> rays = impl_->MakeRays(view);
  if (!rays) return Forward(rays);
  std::vector<octomap::OcTreeKey> occupied;
  std::vector<octomap::OcTreeKey> free;
  octomap::KeyRay crossed;
  for (const CellRay& cell : *rays) {
    const Eigen::Vector3d along = cell.ray.end - cell.ray.origin;
    const double range_m = along.norm();
    const bool in_range = range_m <= impl_->config.max_range_m * (1.0 + 1e-9);
    const Eigen::Vector3d end =
        in_range ? cell.ray.end
                 : Eigen::Vector3d(cell.ray.origin + along * (impl_->config.max_range_m / range_m));
    if (in_range) occupied.push_back(cell.key);
    const Transform& T_object_camera = view.pose.T_object_camera;
    // An origin outside the map leaves no free cells; the end is inside.
    if (impl_->tree.computeRayKeys(ToOctomap(T_object_camera * cell.ray.origin),
                                   ToOctomap(T_object_camera * end), crossed)) {
      free.insert(free.end(), crossed.begin(), crossed.end());
    }
  }
  MakeDistinct(occupied);
  MakeDistinct(free);
  // Within one view a cell that holds a point is occupied, even if other rays pass through it.
  std::vector<octomap::OcTreeKey> only_free;
  std::set_difference(free.begin(), free.end(), occupied.begin(), occupied.end(),
                      std::back_inserter(only_free), KeyLess);
  constexpr bool kLazy = true;
  for (const auto& key : only_free) impl_->tree.updateNode(key, false, kLazy);
  for (const auto& key : occupied) impl_->tree.updateNode(key, true, kLazy);
  impl_->tree.updateInnerOccupancy();
  impl_->tree.prune();
  return {};
}

std::vector<OccupancyMap::Cell> OccupancyMap::OccupiedCells() const { return impl_->Cells(true); }
std::vector<OccupancyMap::Cell> OccupancyMap::FreeCells() const { return impl_->Cells(false); }
double OccupancyMap::resolution_m() const { return impl_->config.resolution_m; }

std::vector<std::int8_t> OccupancyMap::BinaryData() const {
  std::ostringstream stream;
  impl_->tree.writeBinaryData(stream);
  const std::string bytes = stream.str();
  return {bytes.begin(), bytes.end()};
}

std::string OccupancyMap::TreeType() const { return impl_->tree.getTreeType(); }

Status OccupancyMap::WriteBinary(const std::string& path) const {
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    if (!impl_->tree.writeBinaryConst(stream)) return Fail("{}: cannot be written", path);
    return {};
  });
}

}  // namespace fringe_fusion
