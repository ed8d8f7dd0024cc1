#include "fringe_fusion/registration/view_surface.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>
#include <optional>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

double Median(std::vector<double>& values) {
  if (values.empty()) return kNan;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Typical distance of horizontally adjacent points: the yardstick for depth steps.
double PixelStep(const RangeImage& range) {
  std::vector<double> steps;
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x + 1 < range.width; ++x) {
      const double step = (range.points(x + 1, y) - range.points(x, y)).norm();
      if (step > 0.0) steps.push_back(step);  // NaN fails
    }
  }
  return Median(steps);
}

bool OnBorder(const RangeImage& range, int x, int y, double max_step) {
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if (!range.points.Contains(x + dx, y + dy)) return true;
      const double step = (range.points(x + dx, y + dy) - range.points(x, y)).norm();
      if (!(step <= max_step)) return true;
    }
  }
  return false;
}

// Variance along the normal: sigma_range^2 (r.n)^2 + sigma_lateral^2 (1 - (r.n)^2).
double NormalVariance(const RangeImage& range, int x, int y) {
  const double along = range.sigma_range(x, y);
  if (!(along > 0.0) || !std::isfinite(along)) return kNan;
  double across = range.sigma_lateral(x, y);
  if (!(across > 0.0) || !std::isfinite(across)) across = along;
  const Eigen::Vector3f ray = DirectionToCamera(range.line_of_sight, range.points(x, y));
  const double cosine = ray.dot(range.normals(x, y));
  const double cosine2 = std::min(1.0, cosine * cosine);
  return along * along * cosine2 + across * across * (1.0 - cosine2);
}

struct Pixel {
  int x = 0;
  int y = 0;
  int point = 0;
};

// Picks at most one pixel of each square block: even in the image whatever the share of valid
// pixels. The block side is searched so that the count comes close to, and never above, the limit.
std::vector<int> SampleEvenly(const std::vector<Pixel>& pixels, int width, int max_samples) {
  const auto pick = [&](double side) {
    std::vector<int> chosen;
    const auto columns = static_cast<std::size_t>(width / side) + 1;
    std::vector<int> last_row(columns, -1);
    for (const Pixel& pixel : pixels) {
      const auto column = static_cast<std::size_t>(pixel.x / side);
      const int row = static_cast<int>(pixel.y / side);
      if (last_row[column] == row) continue;
      last_row[column] = row;
      chosen.push_back(pixel.point);
    }
    return chosen;
  };
  std::vector<int> best = pick(1.0);
  if (static_cast<int>(best.size()) <= max_samples) return best;
  double low = 1.0;
  double high = 2.0;
  while (static_cast<int>((best = pick(high)).size()) > max_samples) high *= 2.0;
  for (int step = 0; step < 8; ++step) {
    const double side = 0.5 * (low + high);
    std::vector<int> chosen = pick(side);
    const bool fits = static_cast<int>(chosen.size()) <= max_samples;
    (fits ? high : low) = side;
    if (fits) best = std::move(chosen);
  }
  return best;
}

// Borrows the buffer of a vector of points: it stays where it is when its owner is moved.
struct PointAdaptor {
  const SurfacePoint* first = nullptr;
  std::size_t count = 0;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return count; }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t dimension) const {
    return first[i].point[static_cast<Eigen::Index>(dimension)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

// The single nearest point within a radius; a tie goes to the lower index.
class NearestWithin {
 public:
  using DistanceType = float;
  explicit NearestWithin(float squared_radius) : worst_(squared_radius) {}
  // Names are those that nanoflann calls.
  [[nodiscard]] bool full() const { return true; }
  [[nodiscard]] float worstDist() const { return worst_; }
  bool addPoint(float squared_distance, int index) {
    if (squared_distance < worst_ || (squared_distance == worst_ && index < index_)) {
      worst_ = squared_distance;
      index_ = index;
    }
    return true;
  }
  [[nodiscard]] int index() const { return index_; }

 private:
  float worst_;
  int index_ = -1;
};

}  // namespace

struct ViewSurface::Index {
  using Tree =
      nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointAdaptor>,
                                          PointAdaptor, 3, int>;
  PointAdaptor adaptor;
  Tree tree;
  explicit Index(const std::vector<SurfacePoint>& points)
      : adaptor{points.data(), points.size()},
        tree(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(12)) {}
};

ViewSurface::ViewSurface() = default;
ViewSurface::ViewSurface(ViewSurface&&) noexcept = default;
ViewSurface& ViewSurface::operator=(ViewSurface&&) noexcept = default;
ViewSurface::~ViewSurface() = default;

Result<ViewSurface> ViewSurface::Make(const View& view, PixelSet set, int max_samples) {
  const RangeImage& range = view.range;
  const int parity = set == PixelSet::kRegistration ? 0 : 1;
  // A neighbour on an oblique surface is several steps away; a jump is many.
  const double max_step = 8.0 * PixelStep(range);
  ViewSurface surface;
  surface.line_of_sight_ = range.line_of_sight;
  std::vector<Pixel> inner;
  for (int y = 0; y < range.height; ++y) {
    for (int x = (y + parity) % 2; x < range.width; x += 2) {
      if (!range.points(x, y).allFinite()) continue;
      const Eigen::Vector3f& normal = range.normals(x, y);
      if (!(std::abs(normal.squaredNorm() - 1.0F) < 1e-2F)) continue;
      SurfacePoint point;
      point.point = range.points(x, y);
      point.normal = normal.normalized();
      point.variance = NormalVariance(range, x, y);
      point.border = OnBorder(range, x, y, max_step);
      if (!point.border) inner.push_back({x, y, static_cast<int>(surface.points_.size())});
      surface.points_.push_back(point);
    }
  }
  if (inner.empty()) {
    return Fail("view {} ({}): none of its {} points has a normal and eight neighbours", view.id,
                view.name, CountValid(range));
  }
  surface.num_inner_ = static_cast<int>(inner.size());
  for (int level = 0; level < kNumLevels; ++level) {
    const int limit = std::max(50, max_samples >> (2 * (kNumLevels - 1 - level)));
    surface.samples_[static_cast<std::size_t>(level)] =
        SampleEvenly(inner, range.width, std::min(limit, max_samples));
  }
  surface.index_ = std::make_unique<Index>(surface.points_);
  surface.Measure();
  return surface;
}

void ViewSurface::Measure() {
  lower_ = points_.front().point;
  upper_ = lower_;
  for (const SurfacePoint& point : points_) {
    lower_ = lower_.cwiseMin(point.point);
    upper_ = upper_.cwiseMax(point.point);
  }
  const std::vector<int>& probes = samples(1);
  for (const int i : probes) centroid_ += points_[static_cast<std::size_t>(i)].point.cast<double>();
  centroid_ /= static_cast<double>(probes.size());
  double sum = 0.0;
  std::vector<double> steps;
  for (const int i : probes) {
    const Eigen::Vector3f& point = points_[static_cast<std::size_t>(i)].point;
    sum += (point.cast<double>() - centroid_).squaredNorm();
    std::array<int, 2> nearest = {-1, -1};
    std::array<float, 2> squared = {0.0F, 0.0F};
    if (index_->tree.knnSearch(point.data(), 2, nearest.data(), squared.data()) == 2) {
      steps.push_back(std::sqrt(static_cast<double>(squared[1])));
    }
  }
  radius_m_ = std::sqrt(sum / static_cast<double>(probes.size()));
  spacing_m_ = steps.empty() ? 0.0 : Median(steps);
}

int ViewSurface::Nearest(const Eigen::Vector3f& point_camera, float radius_m) const {
  const Eigen::Vector3f margin = Eigen::Vector3f::Constant(radius_m);
  if (!((point_camera - lower_ + margin).minCoeff() >= 0.0F)) return -1;
  if (!((upper_ + margin - point_camera).minCoeff() >= 0.0F)) return -1;
  NearestWithin nearest(radius_m * radius_m);
  index_->tree.findNeighbors(nearest, point_camera.data(), nanoflann::SearchParams());
  return nearest.index();
}

bool ViewSurface::FacesSensor(const Eigen::Vector3f& point_camera,
                              const Eigen::Vector3f& normal_camera) const {
  return normal_camera.dot(DirectionToCamera(line_of_sight_, point_camera)) > 0.0F;
}

void ViewSurface::FillUnknownVariance(double variance) {
  for (SurfacePoint& point : points_) {
    if (!(point.variance > 0.0)) point.variance = variance;
  }
}

Result<SurfaceSet> MakeSurfaces(const std::vector<View>& views, PixelSet set, int max_samples) {
  std::vector<std::optional<Result<ViewSurface>>> made(views.size());
  ParallelFor(static_cast<int>(views.size()), 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const auto index = static_cast<std::size_t>(i);
      made[index] = ViewSurface::Make(views[index], set, max_samples);
    }
  });
  SurfaceSet out;
  std::vector<double> known;
  for (std::optional<Result<ViewSurface>>& surface : made) {
    if (!*surface) return Forward(*surface);
    for (const int i : (*surface)->samples(1)) {
      const double variance = (*surface)->points()[static_cast<std::size_t>(i)].variance;
      if (variance > 0.0) known.push_back(variance);
    }
    out.max_spacing_m = std::max(out.max_spacing_m, (*surface)->spacing_m());
    out.surfaces.push_back(std::move(**surface));
  }
  out.sigma_known = !known.empty();
  const double common = out.sigma_known ? Median(known) : 1.0;
  for (ViewSurface& surface : out.surfaces) surface.FillUnknownVariance(common);
  return out;
}

}  // namespace fringe_fusion
