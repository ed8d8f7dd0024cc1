#include "fringe_fusion/calibration/detect_target.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "assign_lattice.hpp"
#include "charuco_marker.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "lattice.hpp"
#include "refine_point.hpp"

namespace fringe_fusion {
namespace {

using internal::Assignment;
using internal::Feature;
using internal::FoundMarker;
using internal::Lattice;
using internal::LatticeNode;
using internal::RefinedPoint;

Image<float> Negated(const Image<float>& picture) {
  const float most = *std::max_element(picture.begin(), picture.end());
  Image<float> negated = picture;
  for (float& value : negated) value = most - value;
  return negated;
}

/// 0 to 255, without the brightest thousandth.
Image<std::uint8_t> EightBit(const Image<float>& picture, bool is_mirrored) {
  std::vector<float> values(picture.begin(), picture.end());
  const auto nearly_all =
      values.begin() + static_cast<long>(values.size() - 1 - values.size() / 1000);
  std::nth_element(values.begin(), nearly_all, values.end());
  const float scale = 255.0F / std::max(1.0F, *nearly_all);
  Image<std::uint8_t> bytes(picture.width(), picture.height());
  for (int y = 0; y < picture.height(); ++y) {
    for (int x = 0; x < picture.width(); ++x) {
      const float value = scale * picture(is_mirrored ? picture.width() - 1 - x : x, y);
      bytes(x, y) = static_cast<std::uint8_t>(std::clamp(value, 0.0F, 255.0F));
    }
  }
  return bytes;
}

Result<std::vector<FoundMarker>> FindTargetMarkers(const Image<float>& picture,
                                                   const CalibrationTarget& target) {
  std::vector<FoundMarker> markers =
      internal::FindMarkers(EightBit(picture, false), target.dictionary);
  if (!markers.empty()) return markers;
  const auto behind = internal::FindMarkers(EightBit(picture, true), target.dictionary);
  if (behind.size() >= 3) {
    return Fail("the print is mirrored: its markers read from behind only");
  }
  return Fail("no marker of dictionary {} is seen", target.dictionary);
}

Status CheckPicture(const Image<float>& picture) {
  if (picture.empty()) return Fail("the picture is empty");
  float least = picture[0];
  float most = picture[0];
  for (const float value : picture) {
    if (!std::isfinite(value)) return Fail("the picture has a value that is not finite");
    least = std::min(least, value);
    most = std::max(most, value);
  }
  if (!(most - least >= 5.0F)) {
    return Fail("the picture is blank: its values span {:.1f} DN, at least 5 are needed",
                most - least);
  }
  return {};
}

/// Least distance of a node to the nodes beside it, 0 without any [px].
std::vector<double> LeastSteps(const Lattice& lattice, const std::vector<Feature>& features) {
  std::map<std::pair<int, int>, std::size_t> nodes;
  for (std::size_t i = 0; i < lattice.nodes.size(); ++i) {
    nodes[{lattice.nodes[i].place.x(), lattice.nodes[i].place.y()}] = i;
  }
  const auto pixel = [&](std::size_t i) {
    return features[static_cast<std::size_t>(lattice.nodes[i].feature)].pixel;
  };
  std::vector<double> steps;
  for (std::size_t i = 0; i < lattice.nodes.size(); ++i) {
    double least = 0.0;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const auto other =
            nodes.find({lattice.nodes[i].place.x() + dx, lattice.nodes[i].place.y() + dy});
        if (other == nodes.end() || other->second == i) continue;
        const double distance = (pixel(other->second) - pixel(i)).norm();
        if (least == 0.0 || distance < least) least = distance;
      }
    }
    steps.push_back(least);
  }
  return steps;
}

/// Width of the free ground about each point: to the rim of the next dot, the edge of the ring, or
/// the nearest marker [m].
std::vector<double> FreeGround(const CalibrationTarget& target) {
  const std::vector<Eigen::Vector3d> points = TargetPoints(target);
  std::vector<double> free_m;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double radius_m = DotRadius(target, static_cast<int>(i));
    double least = target.pitch_m - radius_m;
    if (target.kind == TargetKind::kRingDots) {
      least = target.ring_radius_m - radius_m;
    } else if (target.kind == TargetKind::kCharuco) {
      // Diagonally across the margin of a white square.
      least = std::sqrt(0.5) * (target.pitch_m - target.marker_m);
    } else if (HasDots(target.kind)) {
      for (std::size_t k = 0; k < points.size(); ++k) {
        if (k == i) continue;
        const double other_m = DotRadius(target, static_cast<int>(k));
        least = std::min(least, (points[k] - points[i]).norm() - radius_m - other_m);
      }
    }
    free_m.push_back(least);
  }
  return free_m;
}

class Refiner {
 public:
  Refiner(const Image<float>& picture, const CalibrationTarget& target, const DetectConfig& config)
      : picture_(picture), target_(target), config_(config), free_m_(FreeGround(target)) {}

  [[nodiscard]] std::optional<RefinedPoint> Refine(const Feature& feature, int point,
                                                   double step_px) const {
    std::optional<RefinedPoint> refined;
    if (HasDots(target_.kind)) {
      // The blurred rim of the next shape must not reach in.
      const double px_per_m = MinorRadius(feature) / DotRadius(target_, point);
      const double reach = px_per_m * free_m_[static_cast<std::size_t>(point)] - 2.0;
      if (!(reach >= 1.0)) return std::nullopt;
      refined = internal::RefineDot(picture_, feature, reach, config_);
    } else {
      constexpr double kMaxRadius = 14.0;
      double radius = std::min(0.42 * step_px, kMaxRadius);
      if (target_.kind == TargetKind::kCharuco) {
        const double px_per_m = step_px / target_.pitch_m;
        radius = std::min(radius, px_per_m * free_m_[static_cast<std::size_t>(point)] - 1.0);
      }
      if (!(radius >= 3.5)) return std::nullopt;
      refined = internal::RefineCorner(picture_, feature, radius, config_);
    }
    if (!refined) return std::nullopt;
    const bool is_good = refined->contrast_dn > 0.0 &&
                         refined->residual_dn < config_.max_residual_ratio * refined->contrast_dn;
    if (!is_good) return std::nullopt;
    return refined;
  }

 private:
  static double MinorRadius(const Feature& dot) {
    const double half_trace = 0.5 * dot.shape.trace();
    const double spread =
        std::sqrt(std::max(0.0, half_trace * half_trace - dot.shape.determinant()));
    return 1.0 / std::sqrt(half_trace + spread);
  }

  const Image<float>& picture_;
  const CalibrationTarget& target_;
  const DetectConfig& config_;
  std::vector<double> free_m_;
};

std::vector<PointSighting> RefinePoints(const Image<float>& picture, const Lattice& lattice,
                                        const std::vector<Feature>& features,
                                        const std::vector<int>& points,
                                        const CalibrationTarget& target,
                                        const DetectConfig& config) {
  const std::vector<double> steps = LeastSteps(lattice, features);
  const Refiner refiner(picture, target, config);
  std::vector<std::optional<RefinedPoint>> refined(points.size());
  ParallelFor(static_cast<int>(points.size()), 4, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      if (points[i] < 0) continue;
      const Feature& feature = features[static_cast<std::size_t>(lattice.nodes[i].feature)];
      refined[i] = refiner.Refine(feature, points[i], steps[i]);
    }
  });
  std::vector<PointSighting> sightings;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!refined[i]) continue;
    PointSighting sighting;
    sighting.point = points[i];
    sighting.pixel_camera = refined[i]->pixel;
    sighting.covariance_camera_px2 = refined[i]->covariance_px2;
    sightings.push_back(sighting);
  }
  std::sort(sightings.begin(), sightings.end(),
            [](const PointSighting& a, const PointSighting& b) { return a.point < b.point; });
  return sightings;
}

}  // namespace

Image<float> GreyPicture(const FramePixels& pixels) {
  return std::visit(
      [](const auto& image) {
        Image<float> grey(image.width(), image.height());
        for (std::size_t i = 0; i < grey.size(); ++i) grey[i] = static_cast<float>(image[i]);
        return grey;
      },
      pixels);
}

Result<TargetSighting> DetectTarget(const Image<float>& picture, const CalibrationTarget& target,
                                    const DetectConfig& config) {
  Status status = CheckBounds(config, "detect");
  if (status) status = Validate(target, "target");
  if (status) status = CheckPicture(picture);
  if (!status) return tl::unexpected<Error>(status.error());
  const bool has_dots = HasDots(target.kind);
  const Image<float> looked_at = target.light_on_dark ? Negated(picture) : picture;
  const std::vector<Feature> features =
      has_dots ? internal::FindDots(looked_at, config) : internal::FindCorners(looked_at, config);
  // More than the target has would show that it is another one.
  const int enough = target.num_columns * target.num_rows;
  const Lattice lattice = has_dots ? internal::GrowDotLattice(features, enough)
                                   : internal::GrowCornerLattice(features, enough);
  constexpr std::size_t kLeastNodes = 6;
  if (lattice.nodes.size() < kLeastNodes) {
    return Fail("no lattice of {} is seen, only {} single ones", has_dots ? "dots" : "corners",
                features.size());
  }
  std::vector<FoundMarker> markers;
  if (target.kind == TargetKind::kCharuco) {
    Result<std::vector<FoundMarker>> found = FindTargetMarkers(picture, target);
    if (!found) return Forward(found);
    markers = std::move(*found);
  }
  const Result<Assignment> assignment =
      internal::AssignLattice(lattice, features, target, markers, config);
  if (!assignment) return Forward(assignment);
  TargetSighting sighting;
  sighting.is_ellipse_centre = has_dots;
  sighting.is_orientation_assumed = assignment->is_orientation_assumed;
  sighting.points = RefinePoints(looked_at, lattice, features, assignment->points, target, config);
  if (!(static_cast<double>(sighting.points.size()) >= config.min_points_ratio * enough)) {
    return Fail(
        "only {} of the target's {} points could be located, at least {:.0f} % are needed: the "
        "picture may be blurred, saturated or too coarse",
        sighting.points.size(), enough, 100.0 * config.min_points_ratio);
  }
  return sighting;
}

}  // namespace fringe_fusion
