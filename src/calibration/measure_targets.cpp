#include <algorithm>
#include <cmath>

#include "cell_data.hpp"
#include "chain_run.hpp"
#include "common/dense.hpp"
#include "common/median.hpp"

namespace fringe_fusion::chain {
namespace {

using bundle::kCamera;
using bundle::kProjector;

constexpr int kFitIterations = 12;
// A pose that is stated as exact: far below what any device repeats.
constexpr double kExactRotationRad = 1e-7;
constexpr double kExactTranslationM = 1e-8;
constexpr double kMaxBadRatio = 0.3;  // of the points of a pose

Matrix6d WithFloor(const Matrix6d& covariance) {
  Matrix6d out = covariance;
  out.diagonal().head<3>().array() += kExactRotationRad * kExactRotationRad;
  out.diagonal().tail<3>().array() += kExactTranslationM * kExactTranslationM;
  return out;
}

Eigen::Vector3d MiddleOf(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d low = points.front();
  Eigen::Vector3d high = low;
  for (const Eigen::Vector3d& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  return 0.5 * (low + high);
}

/// What each sighting gives alone, before any device is known.
class SightingFit {
 public:
  SightingFit(const bundle::CellData& data, const TargetView& view, const PointLimits& limits)
      : limits_(limits),
        model_{bundle::CellProblem(data.stations, data.points, data.nominal_shifts), {}, {}} {
    bundle::State& state = model_.state;
    state.devices = {view.devices.camera, view.devices.projector};
    state.T_projector_camera = view.devices.T_projector_camera;
    state.points_target = data.points;
    state.blocks.resize(data.nominal_shifts.size());
    model_.options.huber_sigma = limits.huber_sigma;
    for (std::size_t i = 0; i < data.stations.size(); ++i) {
      reasons_.push_back(data.reasons[i]);
      num_bad_.push_back(0);
      if (!data.reasons[i].empty()) continue;
      state.blocks[i].T_camera_target =
          bundle::PlanePose(data.homographies[kCamera][i]->H, view.devices.camera);
      model_.problem.FitPose(state, model_.options, i, kFitIterations);
    }
  }

  void Run() {
    SetMedianScale();
    FitAll();
    SetMedianScale();
    DropBadPoints();
    FitAll();
    SetFullScale();
    FitAll();
  }

  [[nodiscard]] Measured Finish() {
    Measured out;
    out.reasons = reasons_;
    out.num_rejected_points = num_bad_;
    out.middle_target = MiddleOf(model_.state.points_target);
    out.sigma_scale = std::max(model_.options.scale[kCamera], model_.options.scale[kProjector]);
    for (std::size_t i = 0; i < reasons_.size(); ++i) {
      const Transform& T = model_.state.blocks[i].T_camera_target;
      const bundle::StationSums sums = model_.problem.Sum(model_.state, model_.options, i);
      const Matrix6d information = sums.hessian.block<6, 6>(kNumCellParameters, kNumCellParameters);
      const auto covariance = dense::SolvePositive(information, Matrix6d::Identity());
      const bool is_good =
          std::isfinite(sums.cost) && T.matrix().allFinite() && covariance && T(2, 3) > 0.0;
      if (out.reasons[i].empty() && !is_good) {
        out.reasons[i] = "its points do not determine the pose of the target";
      }
      out.T_camera_target.push_back(T);
      out.information.push_back(information);
      out.covariance.push_back(is_good ? Matrix6d(*covariance) : Matrix6d::Zero());
    }
    out.points.emplace(std::move(model_));
    return out;
  }

 private:
  [[nodiscard]] bool IsIn(std::size_t i) const { return reasons_[i].empty(); }

  void FitAll() {
    for (std::size_t i = 0; i < reasons_.size(); ++i) {
      if (IsIn(i)) model_.problem.FitPose(model_.state, model_.options, i, kFitIterations);
    }
  }

  [[nodiscard]] bundle::Residual MissOf(std::size_t i, const bundle::Observation& seen,
                                        std::size_t device) const {
    return bundle::CellProblem::Miss(model_.state, model_.problem.stations()[i], seen, device,
                                     model_.options);
  }

  void SetMedianScale() {
    for (const std::size_t device : {kCamera, kProjector}) {
      std::vector<double> components;
      for (std::size_t i = 0; i < reasons_.size(); ++i) {
        if (!IsIn(i)) continue;
        for (const bundle::Observation& seen : model_.problem.stations()[i].seen[device]) {
          const Eigen::Vector2d e = MissOf(i, seen, device).e;
          components.push_back(std::abs(e.x()));
          components.push_back(std::abs(e.y()));
        }
      }
      constexpr double kMadOfNormal = 1.4826;
      if (!components.empty()) Raise(device, kMadOfNormal * Median(std::move(components)));
    }
  }

  void SetFullScale() {
    const auto sums = model_.problem.Sums(model_.state, model_.options);
    int num_poses = 0;
    for (const std::string& reason : reasons_) num_poses += reason.empty() ? 1 : 0;
    const int num_rows = 2 * (sums[kCamera].count + sums[kProjector].count);
    if (num_rows <= 6 * num_poses) return;
    const double share = 1.0 - 6.0 * num_poses / num_rows;
    for (const std::size_t device : {kCamera, kProjector}) {
      if (sums[device].count == 0) continue;
      Raise(device, std::sqrt(sums[device].chi2 / (2.0 * sums[device].count * share)));
    }
  }

  /// Residuals below the stated noise are no reason to promise more.
  void Raise(std::size_t device, double factor) {
    double& scale = model_.options.scale[device];
    if (std::isfinite(factor)) scale = std::max(1.0, scale * factor);
  }

  void DropBadPoints() {
    std::vector<bundle::Station>& stations = model_.problem.stations();
    for (std::size_t i = 0; i < stations.size(); ++i) {
      if (!IsIn(i)) continue;
      for (const std::size_t device : {kCamera, kProjector}) {
        std::vector<bundle::Observation>& seen = stations[i].seen[device];
        std::vector<bundle::Observation> good;
        for (const bundle::Observation& observation : seen) {
          if (MissOf(i, observation, device).e.norm() <= limits_.reject_sigma) {
            good.push_back(observation);
          }
        }
        const std::size_t num_bad = seen.size() - good.size();
        if (static_cast<double>(num_bad) > kMaxBadRatio * static_cast<double>(seen.size())) {
          reasons_[i] = fmt::format(
              "{} of {} points in the {} miss the target by more than {} standard deviations",
              num_bad, seen.size(), device == kCamera ? "camera" : "projector",
              limits_.reject_sigma);
          stations[i].seen = {};
          break;
        }
        num_bad_[i] += static_cast<int>(num_bad);
        seen = std::move(good);
      }
    }
  }

  PointLimits limits_;
  PointModel model_;
  std::vector<std::string> reasons_;
  std::vector<int> num_bad_;
};

}  // namespace

Result<Measured> MeasureTargets(const std::vector<DevicePose>& names,
                                const std::vector<TargetPose>& poses) {
  Measured out;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const TargetPose& pose = poses[i];
    if (!pose.T_camera_target.matrix().allFinite() || !pose.covariance.allFinite()) {
      return Fail("{}: the target pose has a number that is not finite", names[i].name);
    }
    const Matrix6d covariance = WithFloor(pose.covariance);
    const auto information = dense::SolvePositive(covariance, Matrix6d::Identity());
    if (!information) {
      return Fail("{}: the covariance of the target pose is not positive definite", names[i].name);
    }
    out.T_camera_target.push_back(pose.T_camera_target);
    out.covariance.push_back(covariance);
    out.information.push_back(0.5 * (*information + information->transpose()));
    out.reasons.emplace_back();
    out.num_rejected_points.push_back(0);
  }
  return out;
}

Result<Measured> MeasureTargets(const std::vector<TargetSighting>& sightings,
                                const TargetView& view, const PointLimits& limits) {
  const bool has_projector = view.devices.projector.width > 0;
  Status status =
      has_projector ? Validate(view.devices, "devices") : Validate(view.devices.camera, "camera");
  if (!status) return tl::unexpected<Error>(status.error());
  std::vector<TargetSighting> seen = sightings;
  for (TargetSighting& sighting : seen) {
    if (sighting.is_orientation_assumed) {
      return Fail(
          "{}: the target looks the same turned round, so its pose is not known: use one with "
          "marked dots, or with an odd and an even number of rows and columns",
          sighting.name);
    }
    if (has_projector) continue;
    for (PointSighting& point : sighting.points) point.has_projector = false;
  }
  const auto data = bundle::ScreenSightings(view.target, seen, {}, CalibrationConfig{});
  if (!data) return Forward(data);
  SightingFit fit(*data, view, limits);
  fit.Run();
  return fit.Finish();
}

TargetCost PoseCostOf(const Measured& measured) {
  return [&measured](std::size_t k, const Transform& T_camera_target, const LensVector& /*lens*/) {
    const Vector6d e = Log(measured.T_camera_target[k].inverse() * T_camera_target);
    const Matrix6d J = LogJacobian(e);
    const Matrix6d weighted = J.transpose() * measured.information[k];
    TargetTerms terms;
    terms.hessian = weighted * J;
    terms.gradient = weighted * e;
    terms.cost = e.dot(measured.information[k] * e);
    return terms;
  };
}

void SetLens(const CameraModel& stated, const LensVector& change, CameraModel& model) {
  model = stated;
  model.fx += change[0];
  model.fy += change[1];
  model.cx += change[2];
  model.cy += change[3];
  for (std::size_t k = 0; k < model.distortion.size(); ++k) {
    model.distortion[k] += change[4 + static_cast<Eigen::Index>(k)];
  }
}

TargetCost PointCostOf(PointModel& points, const CameraModel& stated) {
  return
      [&points, stated](std::size_t k, const Transform& T_camera_target, const LensVector& lens) {
        SetLens(stated, lens, points.state.devices[kCamera]);
        points.state.blocks[k].T_camera_target = T_camera_target;
        const bundle::StationSums sums = points.problem.Sum(points.state, points.options, k);
        TargetTerms terms;
        terms.hessian = sums.hessian.block<6, 6>(kNumCellParameters, kNumCellParameters);
        terms.gradient = sums.gradient.segment<6>(kNumCellParameters);
        terms.cost = sums.cost;
        terms.by_lens = sums.hessian.block<6, kNumLens>(kNumCellParameters, 0);
        terms.lens_hessian = sums.hessian.topLeftCorner<kNumLens, kNumLens>();
        terms.lens_gradient = sums.gradient.head<kNumLens>();
        return terms;
      };
}

}  // namespace fringe_fusion::chain
