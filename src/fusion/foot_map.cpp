#include "fringe_fusion/fusion/foot_map.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "border_taper.hpp"
#include "fringe_fusion/fusion/variational_surface.hpp"
#include "fringe_fusion/registration/view_surface.hpp"
#include "unsupported.hpp"
#include "view_samples.hpp"

namespace fringe_fusion {
namespace {

// A view with its points prepared for neighbour search; the rules differ in where the foot lies.
class ViewFeet : public FootMap {
 public:
  ViewFeet(const View& view, ViewSurface surface, double reach_m)
      : view_(view),
        surface_(std::move(surface)),
        T_camera_object_(view.pose.T_object_camera.inverse()),
        reach_m_(reach_m) {}

  [[nodiscard]] int view_id() const override { return view_.id; }

  [[nodiscard]] std::optional<Foot> At(const Eigen::Vector3d& point_object) const override {
    if (!point_object.allFinite()) return std::nullopt;
    const std::optional<Foot> foot = FootOf(T_camera_object_ * point_object);
    if (!foot || !(foot->taper > 0.0) || !(foot->variance > 0.0)) return std::nullopt;
    Foot placed = *foot;
    placed.position = view_.pose.T_object_camera * foot->position;
    placed.normal = view_.pose.T_object_camera.linear() * foot->normal;
    if (!((placed.position - point_object).norm() <= reach_m_)) return std::nullopt;
    return placed;
  }

 protected:
  // In the frame of the camera.
  [[nodiscard]] virtual std::optional<Foot> FootOf(const Eigen::Vector3d& point) const = 0;

  [[nodiscard]] std::optional<SurfacePoint> NearestTo(const Eigen::Vector3d& point) const {
    const int index = surface_.Nearest(point.cast<float>(), static_cast<float>(reach_m_));
    if (index < 0) return std::nullopt;
    return surface_.points()[static_cast<std::size_t>(index)];
  }

  // What the measured point nearest to a foot states.
  [[nodiscard]] Foot Describe(const Eigen::Vector3d& position, const Eigen::Vector3d& normal,
                              const SurfacePoint& nearest) const {
    constexpr double kTaperPx = 5.0;
    const double t = std::min(1.0, nearest.border ? 0.0 : nearest.border_px / kTaperPx);
    Foot foot{position, normal, nearest.variance, t * t * (3.0 - 2.0 * t)};
    foot.variance += internal::PoseVariance(view_.pose.covariance, position, normal);
    return foot;
  }

  [[nodiscard]] const View& view() const { return view_; }

 private:
  const View& view_;
  ViewSurface surface_;
  Transform T_camera_object_;
  double reach_m_;
};

class NearestFeet : public ViewFeet {
 public:
  using ViewFeet::ViewFeet;

 private:
  [[nodiscard]] std::optional<Foot> FootOf(const Eigen::Vector3d& point) const override {
    const auto nearest = NearestTo(point);
    if (!nearest) return std::nullopt;
    return Describe(nearest->point.cast<double>(), nearest->normal.cast<double>(), *nearest);
  }
};

class NormalFeet : public ViewFeet {
 public:
  using ViewFeet::ViewFeet;

 private:
  [[nodiscard]] std::optional<Foot> FootOf(const Eigen::Vector3d& point) const override {
    const auto nearest = NearestTo(point);
    if (!nearest) return std::nullopt;
    const Eigen::Vector3d normal = nearest->normal.cast<double>();
    const double height = normal.dot(point - nearest->point.cast<double>());
    return Describe(point - height * normal, normal, *nearest);
  }
};

class SightFeet : public ViewFeet {
 public:
  SightFeet(const View& view, ViewSurface surface, GridProjection projection, double reach_m)
      : ViewFeet(view, std::move(surface), reach_m), projection_(projection) {}

 private:
  // Point and normal between four pixels; nothing where one of them is invalid.
  struct Surfel {
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  };
  [[nodiscard]] std::optional<Surfel> Between(const Eigen::Vector2f& pixel) const {
    const RangeImage& range = view().range;
    const Eigen::Vector2f low = pixel.array().floor();
    if (!(low.minCoeff() >= 0.0F) || !(low.x() < static_cast<float>(range.width - 1)) ||
        !(low.y() < static_cast<float>(range.height - 1))) {
      return std::nullopt;
    }
    Surfel surfel;
    for (int corner = 0; corner < 4; ++corner) {
      const int dx = corner & 1;
      const int dy = corner >> 1;
      const int x = static_cast<int>(low.x()) + dx;
      const int y = static_cast<int>(low.y()) + dy;
      if (!range.points(x, y).allFinite() || !range.normals(x, y).allFinite()) return std::nullopt;
      const Eigen::Vector2f t = pixel - low;
      const auto share =
          static_cast<double>((dx == 1 ? t.x() : 1.0F - t.x()) * (dy == 1 ? t.y() : 1.0F - t.y()));
      surfel.point += share * range.points(x, y).cast<double>();
      surfel.normal += share * range.normals(x, y).cast<double>();
    }
    surfel.normal.normalize();
    return surfel;
  }

  [[nodiscard]] std::optional<Foot> FootOf(const Eigen::Vector3d& point) const override {
    const auto pixel = projection_.Project(point.cast<float>());
    const auto surfel = pixel ? Between(*pixel) : std::nullopt;
    if (!surfel) return std::nullopt;
    const Eigen::Vector3d sight =
        DirectionToCamera(view().range.line_of_sight, point.cast<float>()).cast<double>();
    const double cosine = surfel->normal.dot(sight);
    constexpr double kMinCosine = 0.17364818;  // 80 deg
    if (!(cosine > kMinCosine)) return std::nullopt;
    const Eigen::Vector3d foot = point - surfel->normal.dot(point - surfel->point) / cosine * sight;
    const auto nearest = NearestTo(foot);
    if (!nearest) return std::nullopt;
    return Describe(foot, surfel->normal, *nearest);
  }

  GridProjection projection_;
};

class VariationalFeet : public ViewFeet {
 public:
  VariationalFeet(const View& view, ViewSurface surface, VariationalSurface fit, double reach_m)
      : ViewFeet(view, std::move(surface), reach_m), fit_(std::move(fit)) {}

 private:
  [[nodiscard]] std::optional<Foot> FootOf(const Eigen::Vector3d& point) const override {
    const FieldSample at = fit_.Query(view().pose.T_object_camera * point);
    if (!at.supported) return std::nullopt;
    const Eigen::Vector3d normal =
        view().pose.T_object_camera.linear().transpose() * at.gradient.cast<double>().normalized();
    const Eigen::Vector3d position = point - static_cast<double>(at.distance) * normal;
    const auto nearest = NearestTo(position);
    if (!nearest) return std::nullopt;
    return Describe(position, normal, *nearest);
  }

  VariationalSurface fit_;
};

Result<std::unique_ptr<FootMap>> MakeVariational(const View& view, ViewSurface surface,
                                                 double reach_m) {
  VariationalConfig config;
  config.voxel_m = std::max(reach_m / 2.0, internal::PointSpacing(view.range));
  const auto points = MeasuredPoints({view}, config);
  if (!points) return Forward(points);
  auto fit = VariationalSurface::Fit(*points, config);
  if (!fit) return Fail("view {} ({}): {}", view.id, view.name, fit.error().message);
  return std::make_unique<VariationalFeet>(view, std::move(surface), std::move(*fit), reach_m);
}

struct Candidate {
  const FootMap* map = nullptr;
  Foot foot;
  Eigen::Vector3d v = Eigen::Vector3d::Zero();  // x - pi(x)
  double weight = 0.0;
};

bool Agree(const Candidate& a, const Candidate& b) {
  constexpr double kMinCosine = 0.70710678;
  constexpr double kMaxSigmas = 4.0;
  if (!(a.foot.normal.dot(b.foot.normal) > kMinCosine)) return false;
  const Eigen::Vector3d normal = (a.foot.normal + b.foot.normal).normalized();
  return std::abs(normal.dot(a.v - b.v)) <
         kMaxSigmas * std::sqrt(a.foot.variance + b.foot.variance);
}

// The largest set of views that agree with one of them; of equal ones that nearest to the point.
std::vector<Candidate> Quorum(const std::vector<Candidate>& candidates) {
  std::vector<Candidate> best;
  double nearest = 0.0;
  for (const Candidate& middle : candidates) {
    std::vector<Candidate> agreeing;
    std::copy_if(candidates.begin(), candidates.end(), std::back_inserter(agreeing),
                 [&](const Candidate& other) { return Agree(middle, other); });
    const double distance = middle.v.norm();
    if (agreeing.size() < best.size()) continue;
    if (agreeing.size() == best.size() && !(distance < nearest)) continue;
    best = std::move(agreeing);
    nearest = distance;
  }
  return best;
}

}  // namespace

Result<std::unique_ptr<FootMap>> MakeFootMap(const View& view, FootRule rule, double reach_m) {
  if (!(reach_m > 0.0)) return Fail("foot map: reach_m = {} must be positive", reach_m);
  if (Status status = Validate(view); !status) return Forward<void>(status);
  constexpr int kMaxSamples = 1000;
  auto surface = ViewSurface::Make(view, PixelSet::kAll, kMaxSamples);
  if (!surface) return Forward(surface);
  if (!surface->states_sigma()) return Fail("view {} ({}): states no sigma", view.id, view.name);
  switch (rule) {
    case FootRule::kNearestPoint:
      return std::make_unique<NearestFeet>(view, std::move(*surface), reach_m);
    case FootRule::kNormalFoot:
      return std::make_unique<NormalFeet>(view, std::move(*surface), reach_m);
    case FootRule::kVariational:
      return MakeVariational(view, std::move(*surface), reach_m);
    case FootRule::kLineOfSight:
      break;
  }
  const auto projection = GridProjection::Fit(view.range);
  if (!projection) {
    return Fail("view {} ({}): its points do not lie on the rays of a grid", view.id, view.name);
  }
  return std::make_unique<SightFeet>(view, std::move(*surface), *projection, reach_m);
}

ConsensusDistance DistanceByFeet(const std::vector<const FootMap*>& views,
                                 const Eigen::Vector3d& point_object) {
  std::vector<Candidate> candidates;
  for (const FootMap* view : views) {
    const std::optional<Foot> foot = view->At(point_object);
    if (!foot) continue;
    candidates.push_back(
        {view, *foot, point_object - foot->position, foot->taper / foot->variance});
  }
  ConsensusDistance result;
  result.field = internal::Unsupported();
  const std::vector<Candidate> agreeing = Quorum(candidates);
  if (agreeing.empty()) return result;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (const Candidate& view : agreeing) normal += view.weight * view.foot.normal;
  normal.normalize();
  double weight = 0.0;
  double sum = 0.0;
  double variance = 0.0;
  for (const Candidate& view : agreeing) {
    weight += view.weight;
    sum += view.weight * normal.dot(view.v);
    variance += view.weight * view.weight * view.foot.variance;
    result.view_ids.push_back(view.map->view_id());
  }
  result.field.supported = true;
  result.field.distance = static_cast<float>(sum / weight);
  result.field.gradient = normal.cast<float>();
  result.field.sigma = static_cast<float>(std::sqrt(variance) / weight);
  result.field.weight = static_cast<float>(weight);
  result.field.num_views = static_cast<int>(agreeing.size());
  return result;
}

}  // namespace fringe_fusion
