#include "fringe_fusion/fusion/view_agreement.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "common/dense.hpp"
#include "common/median.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "model_impl.hpp"
#include "point_sums.hpp"

namespace fringe_fusion {
namespace {

using internal::PointField;
using internal::Sample;
using internal::ViewSamples;
using Views = std::vector<const ViewSamples*>;

constexpr std::size_t kMaxPlaces = 400;
constexpr std::size_t kMinPlaces = 20;

// Distance of a view's sample to the surface of the others.
struct Residual {
  double distance_m = 0.0;
  double sigma_m = 0.0;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
};

std::optional<Residual> ResidualAt(const ViewSamples& view, std::size_t run, std::size_t index,
                                   const Views& others, const FusionConfig& config) {
  const std::array<int, 3> block = internal::UnpackBlock(view.levels[0].runs[run].block);
  const Sample& sample = view.levels[0].samples[index];
  const Eigen::Vector3d position =
      Eigen::Vector3d(block[0], block[1], block[2]) * internal::kBlockSize +
      sample.position.cast<double>();
  const Eigen::Vector3f normal = sample.normal.normalized();
  const PointField field = internal::SumAtPoint(position, normal, others, config.voxel_m);
  if (!(field.sums.weight > 0.0)) return std::nullopt;
  // At the rim of what the others saw their surface is extrapolated.
  constexpr double kMaxOffsetVoxels = 0.7;
  if (!(internal::CentroidOffset(field.sums) <= kMaxOffsetVoxels)) return std::nullopt;
  const internal::Surface surface =
      config.order == 2 ? internal::SphereSurface(field.sums) : internal::PlaneSurface(field.sums);
  if (!std::isfinite(surface.distance)) return std::nullopt;
  Residual residual;
  residual.distance_m = static_cast<double>(surface.distance) * config.voxel_m;
  residual.normal = surface.gradient.cast<double>().normalized();
  const auto weight = static_cast<double>(sample.weight);
  double variance = static_cast<double>(sample.weight_variance) / (weight * weight) +
                    field.variance / (field.sums.weight * field.sums.weight) + field.pose_variance;
  if (view.has_pose_covariance) {
    variance += internal::PoseVariance(view.pose_covariance,
                                       view.T_camera_object * (position * config.voxel_m),
                                       view.T_camera_object.linear() * residual.normal);
  }
  residual.sigma_m = std::sqrt(variance);
  if (!(residual.sigma_m > 0.0)) return std::nullopt;
  return residual;
}

std::vector<Residual> Residuals(const ViewSamples& view, const Views& others,
                                const FusionConfig& config) {
  const internal::SampleSet& set = view.levels[0];
  const std::size_t count = std::min(kMaxPlaces, set.samples.size());
  std::vector<std::optional<Residual>> found(count);
  ParallelFor(static_cast<int>(count), 32, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      const std::size_t index = i * set.samples.size() / count;
      const auto next = std::upper_bound(
          set.runs.begin(), set.runs.end(), index,
          [](std::size_t value, const internal::SampleRun& run) { return value < run.begin; });
      const auto run = static_cast<std::size_t>(next - set.runs.begin()) - 1;
      found[i] = ResidualAt(view, run, index, others, config);
    }
  });
  std::vector<Residual> residuals;
  for (const auto& residual : found) {
    if (residual) residuals.push_back(*residual);
  }
  return residuals;
}

// Least squares of n . t = -r over sigma, with the influence of far residuals bounded.
Eigen::Vector3d ShiftOnto(const std::vector<Residual>& residuals, double scale) {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  for (int iteration = 0; iteration < 5; ++iteration) {
    Eigen::Matrix3d normal_matrix = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const Residual& r : residuals) {
      const double rest = std::abs(r.distance_m + r.normal.dot(shift)) / (r.sigma_m * scale);
      const double weight = 1.0 / (r.sigma_m * r.sigma_m * std::max(1.0, rest));
      normal_matrix += weight * r.normal * r.normal.transpose();
      right -= weight * r.distance_m * r.normal;
    }
    const Eigen::Vector3d values = dense::SymmetricEigenvalues(normal_matrix);
    constexpr double kMinEigenRatio = 0.01;
    if (!(values[0] > kMinEigenRatio * values[2])) return Eigen::Vector3d::Zero();
    shift = dense::SolveSymmetric(normal_matrix, right);
  }
  return shift;
}

ViewAgreement Agreement(const ViewSamples& view, const Views& others, const FusionConfig& config) {
  ViewAgreement agreement;
  agreement.view_id = view.id;
  const std::vector<Residual> residuals = Residuals(view, others, config);
  agreement.num_points = static_cast<int>(residuals.size());
  agreement.ratio = std::numeric_limits<double>::quiet_NaN();
  if (residuals.size() < kMinPlaces) return agreement;
  std::vector<double> distances;
  std::vector<double> ratios;
  for (const Residual& r : residuals) {
    distances.push_back(std::abs(r.distance_m));
    ratios.push_back(std::abs(r.distance_m) / r.sigma_m);
  }
  constexpr double kSigmaOfMedian = 1.4826;
  agreement.offset_m = Median(std::move(distances));
  agreement.ratio = kSigmaOfMedian * Median(std::move(ratios));
  agreement.shift_m = ShiftOnto(residuals, 2.0);
  return agreement;
}

// Index of the view that stands out, or -1.
int StandsOut(const std::vector<ViewAgreement>& agreements) {
  constexpr double kMinRatio = 3.0;
  constexpr double kMinFactor = 2.0;
  std::vector<double> ratios;
  int worst = -1;
  for (std::size_t i = 0; i < agreements.size(); ++i) {
    const ViewAgreement& a = agreements[i];
    if (a.displaced || !std::isfinite(a.ratio)) continue;
    ratios.push_back(a.ratio);
    if (worst < 0 || a.ratio > agreements[static_cast<std::size_t>(worst)].ratio) {
      worst = static_cast<int>(i);
    }
  }
  // Of two that disagree nobody knows which is right.
  if (ratios.size() < 3) return -1;
  const double ratio = agreements[static_cast<std::size_t>(worst)].ratio;
  return ratio > kMinRatio && ratio > kMinFactor * Median(std::move(ratios)) ? worst : -1;
}

}  // namespace

std::vector<ViewAgreement> CompareViews(const ImplicitModel& model) {
  const ImplicitModel::Impl& impl = model.impl();
  std::vector<ViewAgreement> agreements(impl.views.size());
  Views in_place;
  for (const auto& [id, view] : impl.views) in_place.push_back(&view);
  for (;;) {
    std::size_t index = 0;
    for (const auto& [id, view] : impl.views) {
      Views others = in_place;
      others.erase(std::remove(others.begin(), others.end(), &view), others.end());
      const bool displaced = agreements[index].displaced;
      agreements[index] = Agreement(view, others, impl.config);
      agreements[index++].displaced = displaced;
    }
    const int worst = StandsOut(agreements);
    if (worst < 0) return agreements;
    ViewAgreement& found = agreements[static_cast<std::size_t>(worst)];
    found.displaced = true;
    in_place.erase(std::remove(in_place.begin(), in_place.end(), &impl.views.at(found.view_id)),
                   in_place.end());
  }
}

std::vector<int> ImplicitModel::SupportingViews(const Eigen::Vector3d& point_object) const {
  const Eigen::Vector3d position = point_object / impl_->config.voxel_m;
  if (!(position.cwiseAbs().maxCoeff() < internal::kMaxVoxelCoordinate - 1)) return {};
  Views views;
  for (const auto& [id, view] : impl_->views) views.push_back(&view);
  const FieldSample sample = Query(point_object);
  if (!sample.supported) return {};
  const Eigen::Vector3f normal = sample.gradient.normalized();
  return internal::SumAtPoint(position, normal, views, impl_->config.voxel_m).view_ids;
}

}  // namespace fringe_fusion
