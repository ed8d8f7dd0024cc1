#include "fringe_fusion/calibration/drift.hpp"

#include <algorithm>
#include <cmath>

#include "cell_data.hpp"
#include "common/constants.hpp"
#include "common/dense.hpp"

namespace fringe_fusion {
namespace {

using bundle::kCamera;
using bundle::kNumModel;
using bundle::kProjector;

constexpr int kDriftIterations = 20;
constexpr Eigen::Index kPoseAt = 2 * kNumModel;  // first parameter of T_projector_camera

/// The parameters that may have moved: all but the distortion.
std::vector<Eigen::Index> MovingParameters() {
  std::vector<Eigen::Index> indices;
  for (Eigen::Index device = 0; device < 2; ++device) {
    for (Eigen::Index k = 0; k < 4; ++k) indices.push_back(device * kNumModel + k);
  }
  for (Eigen::Index k = kPoseAt; k < kNumCellParameters; ++k) indices.push_back(k);
  return indices;
}

/// Covariance of what is known before the view: the earlier one and what may have moved since.
Eigen::MatrixXd PriorCovariance(const CellCalibration& before, const CellCovariance& covariance,
                                const DriftConfig& config,
                                const std::vector<Eigen::Index>& moving) {
  CellVector sigma = CellVector::Zero();
  const double focal = config.sigma_focal_ratio;
  const double principal = config.sigma_principal_px;
  sigma.head<4>() << focal * before.camera.fx, focal * before.camera.fy, principal, principal;
  sigma.segment<4>(kNumModel) << focal * before.projector.fx, focal * before.projector.fy,
      principal, principal;
  sigma.segment<3>(kPoseAt).setConstant(config.sigma_rotation_deg * kRadPerDeg);
  sigma.tail<3>().setConstant(1e-3 * config.sigma_translation_mm);
  CellCovariance all = covariance;
  all.diagonal() += sigma.cwiseAbs2();
  return all(moving, moving);
}

/// One sighting before a cell, its pose and the parameters that move.
struct DriftProblem {
  bundle::CellProblem problem;
  bundle::State state;
  bundle::Options options;

  void FitTarget() { problem.FitPose(state, options, 0, 10); }
  [[nodiscard]] bundle::DeviceSums Sums() const {
    const auto sums = problem.Sums(state, options);
    bundle::DeviceSums both = sums[kCamera];
    both.Add(sums[kProjector]);
    return both;
  }
  [[nodiscard]] double RmsPx() const {
    const bundle::DeviceSums sums = Sums();
    return std::sqrt(sums.sum_px2 / std::max(1, sums.count));
  }
};

Result<DriftProblem> StartDrift(const CellCalibration& before, const CalibrationTarget& target,
                                const TargetSighting& sighting, const DriftConfig& config) {
  const auto data = bundle::ScreenSightings(target, {sighting}, {}, CalibrationConfig{});
  if (!data) return Forward(data);
  if (!data->reasons.front().empty()) {
    return Fail("{}: {}", sighting.name, data->reasons.front());
  }
  const bundle::Station& station = data->stations.front();
  const auto num_both = static_cast<int>(station.seen[kProjector].size());
  if (num_both < config.min_points) {
    return Fail("{}: {} points are seen by both devices, {} are needed", sighting.name, num_both,
                config.min_points);
  }
  DriftProblem out{bundle::CellProblem(data->stations, data->points, data->nominal_shifts), {}, {}};
  out.state.devices = {before.camera, before.projector};
  out.state.T_projector_camera = before.T_projector_camera;
  out.state.points_target = data->points;
  out.state.blocks.resize(1);
  out.state.blocks.front().T_camera_target =
      bundle::PlanePose(data->homographies[kCamera].front()->H, before.camera);
  out.options.huber_sigma = config.huber_sigma;
  out.FitTarget();
  if (!std::isfinite(out.problem.Cost(out.state, out.options))) {
    return Fail("{}: the target finds no place before both devices", sighting.name);
  }
  return out;
}

/// What the view tells, in units of what was known: whitened by the prior, along its own axes.
struct ToldDirections {
  Eigen::MatrixXd root;      ///< parameters per whitened unit, prior = root root^T
  Eigen::MatrixXd whitener;  ///< inverse of root
  Eigen::MatrixXd axes;      ///< told directions, whitened
  Eigen::VectorXd ratios;    ///< information of the view over that of the prior
};

ToldDirections FindTold(const DriftProblem& drift, const Eigen::MatrixXd& prior,
                        const std::vector<Eigen::Index>& moving, double min_ratio) {
  const Eigen::MatrixXd hessian =
      drift.problem.Reduce(drift.state, drift.options, 0.0).hessian(moving, moving);
  // Scaled first: pixels, radians and metres.
  const Eigen::VectorXd scale = prior.diagonal().cwiseSqrt();
  const Eigen::MatrixXd correlation =
      scale.cwiseInverse().asDiagonal() * prior * scale.cwiseInverse().asDiagonal();
  const dense::SymmetricEigen known = dense::DecomposeSymmetric(correlation);
  ToldDirections told;
  told.root =
      scale.asDiagonal() * known.vectors * known.values.cwiseMax(1e-12).cwiseSqrt().asDiagonal();
  told.whitener = known.values.cwiseMax(1e-12).cwiseSqrt().cwiseInverse().asDiagonal() *
                  known.vectors.transpose() * scale.cwiseInverse().asDiagonal();
  const Eigen::MatrixXd whitened =
      dense::Propagate(told.root.transpose(), 0.5 * (hessian + hessian.transpose()));
  const dense::SymmetricEigen news = dense::DecomposeSymmetric(whitened);
  Eigen::Index first = 0;
  while (first < news.values.size() && !(news.values[first] >= min_ratio)) ++first;
  const Eigen::Index num = news.values.size() - first;
  told.axes = news.vectors.rightCols(num).rowwise().reverse();
  told.ratios = news.values.tail(num).reverse();
  return told;
}

/// Gauss-Newton along the told directions alone, the prior included.
/// @return the change, whitened along them.
Eigen::VectorXd MoveAlong(const ToldDirections& told, const std::vector<Eigen::Index>& moving,
                          DriftProblem& drift) {
  const Eigen::MatrixXd basis = told.root * told.axes;
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(told.ratios.size());
  for (int iteration = 0; iteration < kDriftIterations; ++iteration) {
    const bundle::Reduced reduced = drift.problem.Reduce(drift.state, drift.options, 0.0);
    const Eigen::VectorXd gradient =
        basis.transpose() * Eigen::VectorXd(reduced.gradient(moving)) + moved;
    Eigen::MatrixXd hessian = dense::Propagate(basis.transpose(), reduced.hessian(moving, moving));
    hessian.diagonal().array() += 1.0;
    const Eigen::VectorXd step = -dense::SolveSymmetric(hessian, gradient);
    if (!step.allFinite()) break;
    moved += step;
    Eigen::VectorXd all = Eigen::VectorXd::Zero(kNumCellParameters);
    all(moving) = basis * step;
    bundle::MoveShared(drift.state, all);
    drift.FitTarget();
    if (step.norm() < 1e-9 * (1.0 + moved.norm())) break;
  }
  return moved;
}

/// The parameters that make up most of a direction, by what each may have moved.
std::string DirectionWords(const Eigen::VectorXd& axis, const Eigen::VectorXd& sigma,
                           const std::vector<Eigen::Index>& moving) {
  std::vector<Eigen::Index> order(moving.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Eigen::Index>(i);
  const Eigen::VectorXd share = axis.cwiseQuotient(sigma).cwiseAbs();
  std::sort(order.begin(), order.end(),
            [&](Eigen::Index a, Eigen::Index b) { return share[a] > share[b]; });
  std::string words;
  for (std::size_t i = 0; i < order.size() && i < 3; ++i) {
    if (i > 0 && share[order[i]] < 0.3 * share[order[0]]) break;
    words += fmt::format(
        "{}{}", i > 0 ? " with " : "",
        CellParameterName(static_cast<int>(moving[static_cast<std::size_t>(order[i])])));
  }
  return words;
}

void FillDriftWords(DriftResult& result) {
  std::string changes;
  for (int k = 0; k < kNumCellParameters; ++k) {
    if (!(std::abs(result.change[k]) > 3.0 * result.sigma_change[k])) continue;
    const bool is_rotation = k >= kPoseAt && k < kPoseAt + 3;
    const double unit = is_rotation ? kDegPerRad : k >= kPoseAt ? 1e3 : 1.0;
    changes +=
        fmt::format("{}{} by {:.4g} +- {:.2g} {}", changes.empty() ? "" : ", ",
                    CellParameterName(k), unit * result.change[k], unit * result.sigma_change[k],
                    is_rotation    ? "deg"
                    : k >= kPoseAt ? "mm"
                                   : "px");
  }
  result.words = fmt::format(
      "{}: the view tells {} directions of 14, rms {:.3f} px before, {:.3f} px after; the change "
      "is "
      "{:.1f} times what noise makes{}{}",
      result.has_moved ? "the cell has moved" : "the cell has not moved beyond noise",
      result.num_observed, result.rms_before_px, result.rms_after_px, std::sqrt(result.chi2_ratio),
      changes.empty() ? "" : "; beyond 3 sigma: ", changes);
}

}  // namespace

Result<DriftResult> UpdateCell(const CellCalibration& before, const CellCovariance& covariance,
                               const CalibrationTarget& target, const TargetSighting& sighting,
                               const DriftConfig& config) {
  Status status = CheckBounds(config, "drift");
  if (status) status = Validate(before, "cell");
  if (!status) return tl::unexpected<Error>(status.error());
  if (!covariance.allFinite()) return Fail("the covariance of the cell is not finite");
  auto drift = StartDrift(before, target, sighting, config);
  if (!drift) return Forward(drift);
  DriftResult result;
  result.rms_before_px = drift->RmsPx();
  const std::vector<Eigen::Index> moving = MovingParameters();
  const Eigen::MatrixXd prior = PriorCovariance(before, covariance, config, moving);
  const ToldDirections told = FindTold(*drift, prior, moving, config.min_information_ratio);
  result.num_observed = static_cast<int>(told.ratios.size());
  const Eigen::VectorXd moved = MoveAlong(told, moving, *drift);
  result.rms_after_px = drift->RmsPx();
  if (!(result.rms_after_px <= config.max_rms_px)) {
    return Fail(
        "{}: after the update the points still miss by {:.2f} px, limit {} px: this is not the "
        "cell or not the target of the calibration",
        sighting.name, result.rms_after_px, config.max_rms_px);
  }
  const double farthest = moved.size() > 0 ? moved.cwiseAbs().maxCoeff() : 0.0;
  if (!(farthest <= config.max_moved_sigma)) {
    return Fail(
        "{}: the cell has moved by {:.1f} standard deviations of what one view may correct, limit "
        "{}: calibrate it anew",
        sighting.name, farthest, config.max_moved_sigma);
  }
  result.calibration = before;
  result.calibration.camera = drift->state.devices[kCamera];
  result.calibration.projector = drift->state.devices[kProjector];
  result.calibration.T_projector_camera = drift->state.T_projector_camera;
  result.calibration.rms_px = result.rms_after_px;
  const Eigen::MatrixXd basis = told.root * told.axes;
  // Told directions shrink from the prior's 1 to 1 / (1 + ratio); their change has the rest.
  const Eigen::VectorXd rest = (1.0 + told.ratios.array()).inverse();
  const Eigen::VectorXd gain = 1.0 - rest.array();
  result.covariance = covariance;
  result.covariance(moving, moving) = prior - basis * gain.asDiagonal() * basis.transpose();
  result.change(moving) = basis * moved;
  // Without any drift a told direction moves by the noise of the view and by the error that the
  // earlier calibration had.
  const Eigen::MatrixXd earlier =
      dense::Propagate(told.axes.transpose() * told.whitener, covariance(moving, moving).eval());
  const Eigen::VectorXd noise = gain.array().square() / told.ratios.array();
  result.sigma_change(moving) =
      Eigen::MatrixXd(basis * noise.asDiagonal() * basis.transpose()).diagonal().cwiseSqrt();
  double chi2 = 0.0;
  for (Eigen::Index i = 0; i < moved.size(); ++i) {
    chi2 += moved[i] * moved[i] / (noise[i] + gain[i] * gain[i] * earlier(i, i));
    result.observed.push_back(DirectionWords(basis.col(i), prior.diagonal().cwiseSqrt(), moving));
  }
  result.chi2_ratio = moved.size() > 0 ? chi2 / static_cast<double>(moved.size()) : 0.0;
  result.has_moved = result.chi2_ratio > config.max_chi2_ratio;
  FillDriftWords(result);
  return result;
}

}  // namespace fringe_fusion
