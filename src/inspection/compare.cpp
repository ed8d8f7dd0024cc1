#include "fringe_fusion/inspection/compare.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <nanoflann.hpp>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/inspection/surface_distance.hpp"
#include "surface_samples.hpp"

namespace fringe_fusion {
namespace {

constexpr float kFar = std::numeric_limits<float>::quiet_NaN();
constexpr int kGrain = 2048;

// nanoflann's view of the vertices of a cloud.
struct CloudAdaptor {
  const std::vector<Eigen::Vector3f>& points;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
  [[nodiscard]] double kdtree_get_pt(std::size_t index, std::size_t axis) const {
    return static_cast<double>(points[index][static_cast<Eigen::Index>(axis)]);
  }
  template <typename BoundingBox>
  bool kdtree_get_bbox(BoundingBox& /*box*/) const {
    return false;
  }
};
using CloudTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, CloudAdaptor, double>,
                                        CloudAdaptor, 3>;

// The distance to a surface or, where there are no faces, to the nearest point of a cloud.
class Target {
 public:
  [[nodiscard]] static Result<Target> Create(const Mesh& mesh, const std::string& owner) {
    Target target;
    if (mesh.faces.empty()) {
      target.cloud_ = std::make_unique<CloudAdaptor>(CloudAdaptor{mesh.vertices});
      target.tree_ = std::make_unique<CloudTree>(3, *target.cloud_);
      return target;
    }
    Result<SurfaceDistance> surface = SurfaceDistance::Create(mesh);
    if (!surface) return Fail("inspection: {}: {}", owner, surface.error().message);
    target.surface_ = std::make_unique<SurfaceDistance>(std::move(*surface));
    return target;
  }

  // Signed for surfaces; NaN beyond the limit.
  [[nodiscard]] float Distance(const Eigen::Vector3d& query, double max_distance_m) const {
    if (surface_) {
      const std::optional<NearestPoint> nearest = surface_->Nearest(query, max_distance_m);
      return nearest ? static_cast<float>(nearest->distance_m) : kFar;
    }
    std::uint32_t index = 0;
    double squared = 0.0;
    tree_->knnSearch(query.data(), 1, &index, &squared);
    const double distance = std::sqrt(squared);
    return distance <= max_distance_m ? static_cast<float>(distance) : kFar;
  }

 private:
  std::unique_ptr<SurfaceDistance> surface_;
  std::unique_ptr<CloudAdaptor> cloud_;
  std::unique_ptr<CloudTree> tree_;
};

// Distances of `count` points to a target, NaN beyond the limit. Reports in twenty steps.
template <typename PointAt>
Result<std::vector<float>> Distances(int count, const PointAt& point_at, const Target& target,
                                     double max_distance_m, const Progress& progress,
                                     const std::string& stage) {
  constexpr int kSteps = 20;
  std::vector<float> distances(static_cast<std::size_t>(count), kFar);
  for (int step = 0; step < kSteps; ++step) {
    if (!progress(stage, static_cast<double>(step) / kSteps)) return Fail("{}", kCancelled);
    const int first = static_cast<int>(static_cast<std::int64_t>(count) * step / kSteps);
    const int last = static_cast<int>(static_cast<std::int64_t>(count) * (step + 1) / kSteps);
    ParallelFor(last - first, kGrain, [&](int begin, int end) {
      for (int i = first + begin; i < first + end; ++i) {
        distances[static_cast<std::size_t>(i)] = target.Distance(point_at(i), max_distance_m);
      }
    });
  }
  return distances;
}

// Value of the given rank, 0..1, by the nearest rank.
double Quantile(std::vector<float>& values, double rank) {
  const auto index =
      static_cast<std::ptrdiff_t>(std::floor(rank * static_cast<double>(values.size() - 1) + 0.5));
  std::nth_element(values.begin(), values.begin() + index, values.end());
  return static_cast<double>(values[static_cast<std::size_t>(index)]);
}

DistanceStatistics Summarize(const std::vector<float>& distances) {
  DistanceStatistics statistics;
  std::vector<float> magnitudes;
  magnitudes.reserve(distances.size());
  double sum = 0.0;
  double sum_of_squares = 0.0;
  for (const float distance : distances) {
    if (std::isnan(distance)) {
      ++statistics.num_far;
      continue;
    }
    const auto value = static_cast<double>(distance);
    sum += value;
    sum_of_squares += value * value;
    magnitudes.push_back(std::abs(distance));
  }
  statistics.count = magnitudes.size();
  if (magnitudes.empty()) return statistics;
  const auto count = static_cast<double>(magnitudes.size());
  statistics.mean_m = sum / count;
  statistics.rms_m = std::sqrt(sum_of_squares / count);
  statistics.median_abs_m = Quantile(magnitudes, 0.5);
  statistics.p95_abs_m = Quantile(magnitudes, 0.95);
  statistics.max_abs_m = Quantile(magnitudes, 1.0);
  return statistics;
}

Status CheckVertices(const Mesh& mesh, const char* owner) {
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!mesh.vertices[i].allFinite()) {
      return Fail("inspection: {}: vertex {} is not finite", owner, i);
    }
  }
  const auto num_vertices = static_cast<int>(mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    if (mesh.faces[i].minCoeff() < 0 || mesh.faces[i].maxCoeff() >= num_vertices) {
      return Fail("inspection: {}: face {} names a vertex outside [0, {})", owner, i, num_vertices);
    }
  }
  if (!mesh.filled_faces.empty() && mesh.filled_faces.size() != mesh.faces.size()) {
    return Fail("inspection: {}: {} face flags for {} faces", owner, mesh.filled_faces.size(),
                mesh.faces.size());
  }
  return {};
}

Status CheckInput(const Mesh& model, const Mesh& reference, const InspectionConfig& config,
                  const std::optional<std::vector<std::uint8_t>>& reference_visible) {
  if (Status status = CheckBounds(config, "inspection"); !status) return status;
  if (model.vertices.empty()) return Fail("inspection: the model has no vertices");
  if (reference.faces.empty()) return Fail("inspection: the reference has no faces");
  if (Status status = CheckVertices(model, "model"); !status) return status;
  if (Status status = CheckVertices(reference, "reference"); !status) return status;
  if (reference_visible && reference_visible->size() != reference.faces.size()) {
    return Fail("inspection: {} visibility flags for {} faces of the reference",
                reference_visible->size(), reference.faces.size());
  }
  return {};
}

// The mesh without the faces that close holes. A vertex of such faces alone is not measured
// either; `measured` tells.
Mesh MeasuredPart(const Mesh& mesh, bool ignore_filled, std::vector<std::uint8_t>& measured) {
  Mesh part;
  part.vertices = mesh.vertices;
  measured.assign(mesh.vertices.size(), mesh.faces.empty() ? 1 : 0);
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const bool filled = !mesh.filled_faces.empty() && mesh.filled_faces[i] != 0;
    if (filled && ignore_filled) continue;
    part.faces.push_back(mesh.faces[i]);
    for (const int vertex : mesh.faces[i]) measured[static_cast<std::size_t>(vertex)] = 1;
  }
  return part;
}

// Signed deviation of every measured vertex of the model, NaN for the others.
Result<std::vector<float>> VertexDeviations(const Mesh& model,
                                            const std::vector<std::uint8_t>& measured,
                                            const Target& reference, const InspectionConfig& config,
                                            const Progress& progress) {
  Result<std::vector<float>> deviations = Distances(
      static_cast<int>(model.vertices.size()),
      [&](int i) -> Eigen::Vector3d {
        return model.vertices[static_cast<std::size_t>(i)].cast<double>();
      },
      reference, config.max_distance_m, progress, "inspect vertices");
  if (!deviations) return deviations;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    if (measured[i] == 0) (*deviations)[i] = kFar;
  }
  return deviations;
}

// Distances of samples spread evenly over a mesh: vertices alone would weigh fine parts more.
Result<std::vector<float>> SampleDistances(const Mesh& mesh, const std::vector<std::uint8_t>& use,
                                           const Target& target, const InspectionConfig& config,
                                           const Progress& progress, const char* owner) {
  const auto samples = internal::SurfaceSamples::Create(mesh, use, config.sample_spacing_m);
  if (!samples) return Fail("inspection: {}: {}", owner, samples.error().message);
  return Distances(
      samples->count(), [&](int i) { return samples->At(i); }, target, config.max_distance_m,
      progress, std::string("inspect ") + owner);
}

// Statistics of no sample at all would read like a perfect fit.
Status CheckSomeInReach(const InspectionResult& result, const Mesh& model, const Mesh& reference,
                        double max_distance_m) {
  if (result.model_to_reference.count > 0 && result.reference_to_model.count > 0) return {};
  return Fail(
      "inspection: no sample of the {} lies within max_distance_m = {:g} m of the other: the model "
      "has a diagonal of {:.4g} m, the reference of {:.4g} m; do unit and frame agree?",
      result.model_to_reference.count > 0 ? "reference" : "model", max_distance_m,
      BoxDiagonal(model), BoxDiagonal(reference));
}

double CoveredRatio(const std::vector<float>& distances, double complete_distance_m) {
  std::size_t covered = 0;
  for (const float distance : distances) {
    covered += std::abs(static_cast<double>(distance)) <= complete_distance_m ? 1U : 0U;
  }
  return static_cast<double>(covered) / static_cast<double>(distances.size());
}

}  // namespace

Result<InspectionResult> Compare(const Mesh& model, const Mesh& reference,
                                 const InspectionConfig& config,
                                 const std::optional<std::vector<std::uint8_t>>& reference_visible,
                                 const Progress& progress) {
  if (Status status = CheckInput(model, reference, config, reference_visible); !status) {
    return tl::unexpected<Error>(status.error());
  }
  std::vector<std::uint8_t> measured;
  const Mesh part = MeasuredPart(model, config.ignore_filled, measured);
  if (part.faces.empty() && !model.faces.empty()) {
    return Fail("inspection: all {} faces of the model close holes", model.faces.size());
  }
  const Result<Target> to_reference = Target::Create(reference, "reference");
  if (!to_reference) return Forward(to_reference);
  const Result<Target> to_model = Target::Create(part, "model");
  if (!to_model) return Forward(to_model);

  InspectionResult result;
  Result<std::vector<float>> deviations =
      VertexDeviations(model, measured, *to_reference, config, progress);
  if (!deviations) return Forward(deviations);
  result.deviation_m = std::move(*deviations);
  if (part.faces.empty()) {
    result.model_to_reference = Summarize(result.deviation_m);
  } else {
    const auto distances = SampleDistances(part, {}, *to_reference, config, progress, "model");
    if (!distances) return Forward(distances);
    result.model_to_reference = Summarize(*distances);
  }
  const auto back =
      SampleDistances(reference, reference_visible.value_or(std::vector<std::uint8_t>()), *to_model,
                      config, progress, "reference");
  if (!back) return Forward(back);
  result.reference_to_model = Summarize(*back);
  result.completeness_ratio = CoveredRatio(*back, config.complete_distance_m);
  if (Status status = CheckSomeInReach(result, model, reference, config.max_distance_m); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return result;
}

}  // namespace fringe_fusion
