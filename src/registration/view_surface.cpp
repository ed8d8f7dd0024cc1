#include "fringe_fusion/registration/view_surface.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>
#include <optional>

#include "common/constants.hpp"
#include "common/median.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion {
namespace {

// A neighbour on an oblique surface is several steps away; a jump is many.
constexpr double kMaxStepRatio = 8.0;
constexpr int kTargetsPerSample = 3;  // at the coarser levels
constexpr int kWindowPx = 2;
constexpr int kMaxWindowPx = 8;
constexpr int kMaxClimbs = 12;

// Typical distance of horizontally adjacent points: the yardstick for depth steps.
double PixelStep(const RangeImage& range) {
  std::vector<double> steps;
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x + 1 < range.width; ++x) {
      const double step = (range.points(x + 1, y) - range.points(x, y)).norm();
      if (step > 0.0) steps.push_back(step);  // NaN fails
    }
  }
  return steps.empty() ? kNan : Median(std::move(steps));
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

// Borrows the buffers of two vectors: they stay where they are when their owner is moved.
struct PointAdaptor {
  const SurfacePoint* first = nullptr;
  const int* members = nullptr;
  std::size_t count = 0;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return count; }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t dimension) const {
    return first[members[i]].point[static_cast<Eigen::Index>(dimension)];
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

// Chessboard distance to the nearest pixel that is a border or holds no point, up to 255.
Image<std::uint8_t> BorderDistance(const RangeImage& range) {
  const double max_step = kMaxStepRatio * PixelStep(range);
  Image<std::uint8_t> distance(range.width, range.height, 0);
  ParallelFor(range.height, 16, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < range.width; ++x) {
        const bool inner = range.points(x, y).allFinite() && !OnBorder(range, x, y, max_step);
        distance(x, y) = inner ? 255 : 0;
      }
    }
  });
  const auto relax = [&](int x, int y, int dx, int dy) {
    const int near = distance.Contains(x + dx, y + dy) ? distance(x + dx, y + dy) + 1 : 1;
    if (near < distance(x, y)) distance(x, y) = static_cast<std::uint8_t>(near);
  };
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x < range.width; ++x) {
      for (const auto& [dx, dy] : {std::pair(-1, 0), {-1, -1}, {0, -1}, {1, -1}}) {
        relax(x, y, dx, dy);
      }
    }
  }
  for (int y = range.height - 1; y >= 0; --y) {
    for (int x = range.width - 1; x >= 0; --x) {
      for (const auto& [dx, dy] : {std::pair(1, 0), {1, 1}, {0, 1}, {-1, 1}}) relax(x, y, dx, dy);
    }
  }
  return distance;
}

bool InSet(PixelSet set, int x, int y) {
  if (set == PixelSet::kAll) return true;
  return (x + y) % 2 == (set == PixelSet::kRegistration ? 0 : 1);
}

}  // namespace

struct ViewSurface::Index {
  using Tree =
      nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointAdaptor>,
                                          PointAdaptor, 3, int>;
  std::vector<int> members;
  PointAdaptor adaptor;
  Tree tree;
  Index(const std::vector<SurfacePoint>& points, std::vector<int> of)
      : members(std::move(of)),
        adaptor{points.data(), members.data(), members.size()},
        tree(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(12)) {}
};

ViewSurface::ViewSurface() = default;
ViewSurface::ViewSurface(ViewSurface&&) noexcept = default;
ViewSurface& ViewSurface::operator=(ViewSurface&&) noexcept = default;
ViewSurface::~ViewSurface() = default;

void ViewSurface::AddPoints(const View& view, PixelSet set) {
  const RangeImage& range = view.range;
  const Image<std::uint8_t> border_px = BorderDistance(range);
  line_of_sight_ = range.line_of_sight;
  projection_ = GridProjection::Fit(range);
  if (projection_) grid_ = Image<int>(range.width, range.height, -1);
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x < range.width; ++x) {
      if (!InSet(set, x, y) || !range.points(x, y).allFinite()) continue;
      const Eigen::Vector3f& normal = range.normals(x, y);
      if (!(std::abs(normal.squaredNorm() - 1.0F) < 1e-2F)) continue;
      SurfacePoint point;
      point.point = range.points(x, y);
      point.normal = normal.normalized();
      point.variance = NormalVariance(range, x, y);
      point.border_px = border_px(x, y);
      point.border = point.border_px == 0;
      if (projection_) grid_(x, y) = static_cast<int>(points_.size());
      pixels_.push_back(y * range.width + x);
      points_.push_back(point);
    }
  }
}

void ViewSurface::AddLevels(int width, int max_samples) {
  std::vector<Pixel> inner;
  std::vector<Pixel> all;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Pixel pixel{pixels_[i] % width, pixels_[i] / width, static_cast<int>(i)};
    all.push_back(pixel);
    if (!points_[i].border) inner.push_back(pixel);
  }
  num_inner_ = static_cast<int>(inner.size());
  for (std::size_t level = 0; level < kNumLevels; ++level) {
    const int limit = std::max(50, max_samples >> (2 * (kNumLevels - 1 - level)));
    samples_[level] = SampleEvenly(inner, width, std::min(limit, max_samples));
    const bool finest = level + 1 == kNumLevels;
    if (finest && projection_) break;
    std::vector<int> members;
    if (finest) {
      for (const Pixel& pixel : all) members.push_back(pixel.point);
    } else {
      members = SampleEvenly(all, width, kTargetsPerSample * limit);
      const double ratio = static_cast<double>(all.size()) / static_cast<double>(members.size());
      margins_[level] = std::max(1, static_cast<int>(std::lround(0.5 * std::sqrt(ratio))));
    }
    indices_[level] = std::make_unique<Index>(points_, std::move(members));
  }
}

Result<ViewSurface> ViewSurface::Make(const View& view, PixelSet set, int max_samples) {
  ViewSurface surface;
  surface.AddPoints(view, set);
  const bool any = std::any_of(surface.points_.begin(), surface.points_.end(),
                               [](const SurfacePoint& point) { return !point.border; });
  if (!any) {
    return Fail("view {} ({}): none of its {} points has a normal and eight neighbours", view.id,
                view.name, CountValid(view.range));
  }
  surface.AddLevels(view.range.width, max_samples);
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
    steps.push_back(static_cast<double>(StepAt(i)));
    const double variance = points_[static_cast<std::size_t>(i)].variance;
    states_sigma_ = states_sigma_ || variance > 0.0;
  }
  radius_m_ = std::sqrt(sum / static_cast<double>(probes.size()));
  steps.erase(std::remove_if(steps.begin(), steps.end(), [](double step) { return !(step > 0.0); }),
              steps.end());
  spacing_m_ = steps.empty() ? 0.0 : Median(std::move(steps));
}

// Distance from a point to its nearest neighbour; NaN if it has none.
float ViewSurface::StepAt(int i) const {
  const Eigen::Vector3f& point = points_[static_cast<std::size_t>(i)].point;
  if (!projection_) {
    std::array<int, 2> nearest = {-1, -1};
    std::array<float, 2> squared = {0.0F, 0.0F};
    const Index& index = *indices_.back();
    return index.tree.knnSearch(point.data(), 2, nearest.data(), squared.data()) == 2
               ? std::sqrt(squared[1])
               : std::numeric_limits<float>::quiet_NaN();
  }
  const int x0 = pixels_[static_cast<std::size_t>(i)] % grid_.width();
  const int y0 = pixels_[static_cast<std::size_t>(i)] / grid_.width();
  float best = std::numeric_limits<float>::infinity();
  for (int y = y0 - kWindowPx; y <= y0 + kWindowPx; ++y) {
    for (int x = x0 - kWindowPx; x <= x0 + kWindowPx; ++x) {
      if (!grid_.Contains(x, y) || grid_(x, y) < 0 || grid_(x, y) == i) continue;
      best = std::min(best, (points_[static_cast<std::size_t>(grid_(x, y))].point - point).norm());
    }
  }
  return best < std::numeric_limits<float>::infinity() ? best
                                                       : std::numeric_limits<float>::quiet_NaN();
}

int ViewSurface::BestOf(int x0, int y0, int half, const Eigen::Vector3f& point_camera) const {
  int best = -1;
  float best_squared = std::numeric_limits<float>::infinity();
  const int x_end = std::min(x0 + half, grid_.width() - 1);
  const int y_end = std::min(y0 + half, grid_.height() - 1);
  for (int y = std::max(0, y0 - half); y <= y_end; ++y) {
    const int* row = grid_.row(y);
    for (int x = std::max(0, x0 - half); x <= x_end; ++x) {
      if (row[x] < 0) continue;
      const float squared =
          (points_[static_cast<std::size_t>(row[x])].point - point_camera).squaredNorm();
      if (squared < best_squared) {
        best_squared = squared;
        best = row[x];
      }
    }
  }
  return best;
}

int ViewSurface::NearestOnGrid(const Eigen::Vector3f& point_camera, float radius_m) const {
  const auto pixel = projection_->Project(point_camera);
  if (!pixel) return -1;
  const int x = static_cast<int>(std::lround(pixel->x()));
  const int y = static_cast<int>(std::lround(pixel->y()));
  int best = BestOf(x, y, kWindowPx, point_camera);
  if (best < 0) {  // a hole: look as far as the radius reaches
    const double reach = spacing_m_ > 0.0 ? static_cast<double>(radius_m) / spacing_m_ : 0.0;
    const int half = std::min(kMaxWindowPx, static_cast<int>(reach) + 1);
    if (half > kWindowPx) best = BestOf(x, y, half, point_camera);
  }
  if (best < 0) return -1;
  for (int step = 0; step < kMaxClimbs; ++step) {
    const int at = pixels_[static_cast<std::size_t>(best)];
    const int next = BestOf(at % grid_.width(), at / grid_.width(), kWindowPx, point_camera);
    if (next == best) break;
    best = next;
  }
  const float squared =
      (points_[static_cast<std::size_t>(best)].point - point_camera).squaredNorm();
  return squared < radius_m * radius_m ? best : -1;
}

int ViewSurface::Nearest(const Eigen::Vector3f& point_camera, float radius_m, int level) const {
  const Eigen::Vector3f margin = Eigen::Vector3f::Constant(radius_m);
  if (!((point_camera - lower_ + margin).minCoeff() >= 0.0F)) return -1;
  if (!((upper_ + margin - point_camera).minCoeff() >= 0.0F)) return -1;
  const std::unique_ptr<Index>& index = indices_[static_cast<std::size_t>(level)];
  if (!index) return NearestOnGrid(point_camera, radius_m);
  NearestWithin nearest(radius_m * radius_m);
  index->tree.findNeighbors(nearest, point_camera.data(), nanoflann::SearchParams());
  return nearest.index() < 0 ? -1 : index->members[static_cast<std::size_t>(nearest.index())];
}

std::optional<float> ViewSurface::InFront(const Eigen::Vector3f& point_camera) const {
  if (!projection_) return std::nullopt;
  const auto pixel = projection_->Project(point_camera);
  if (!pixel) return std::nullopt;
  const int x0 = static_cast<int>(std::lround(pixel->x()));
  const int y0 = static_cast<int>(std::lround(pixel->y()));
  std::optional<float> least;
  // On an oblique surface the depth changes much within a pixel, at a step by any amount.
  for (int y = y0 - 1; y <= y0 + 1; ++y) {
    for (int x = x0 - 1; x <= x0 + 1; ++x) {
      if (!grid_.Contains(x, y) || grid_(x, y) < 0) continue;
      const Eigen::Vector3f& measured = points_[static_cast<std::size_t>(grid_(x, y))].point;
      const float in_front =
          (point_camera - measured).dot(DirectionToCamera(line_of_sight_, measured));
      least = least ? std::min(*least, in_front) : in_front;
    }
  }
  return least;
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
  for (std::optional<Result<ViewSurface>>& surface : made) {
    if (!*surface) return Forward(*surface);
    out.surfaces.push_back(std::move(**surface));
  }
  FinishSurfaces(out);
  return out;
}

void FinishSurfaces(SurfaceSet& set) {
  std::vector<double> known;
  for (const ViewSurface& surface : set.surfaces) {
    if (surface.states_sigma()) {
      for (const int i : surface.samples(1)) {
        const double variance = surface.points()[static_cast<std::size_t>(i)].variance;
        if (variance > 0.0) known.push_back(variance);
      }
    }
    set.max_spacing_m = std::max(set.max_spacing_m, surface.spacing_m());
  }
  set.sigma_known = !known.empty();
  const double common = set.sigma_known ? Median(known) : 1.0;
  for (ViewSurface& surface : set.surfaces) surface.FillUnknownVariance(common);
}

}  // namespace fringe_fusion
