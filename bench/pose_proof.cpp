// Error of pose and self-calibration over the Cramer-Rao bound, and the truth of the stated
// covariances, by Monte Carlo; the bounds follow from central differences at the truth.
//   pose_proof [share of the runs, default 1]
#include <Eigen/Cholesky>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <optional>
#include <string>

#include "fringe_fusion/pose/self_calibration.hpp"
#include "fringe_fusion/pose/stations.hpp"
#include "fringe_fusion/pose/view_pose.hpp"
#include "test/pose/lit_scene.hpp"
#include "test/pose/station_scene.hpp"

namespace fringe_fusion {
namespace {

using testing::EpipolarScene;
using testing::SameSigma;
using testing::StationScene;

constexpr double kStep = 1e-6;
constexpr double kSigmaPx = 0.08;
const IntrinsicsPrior kFreeFocal{kFree, 0.0, 0.0};
const IntrinsicsPrior kFreeAll{kFree, kFree, kFree};

/// One estimate: its error and stated covariance in the unknowns of the bound.
struct Draw {
  Eigen::VectorXd error;
  Eigen::MatrixXd covariance;
};
using Experiment = std::function<std::optional<Draw>(unsigned seed)>;

/// Runs an experiment and prints one row; false when a limit is passed.
bool Report(const std::string& name, int runs, double max_ratio, const Eigen::MatrixXd& information,
            const Experiment& experiment) {
  double ratio2 = 0.0;
  double nees = 0.0;
  int failures = 0;
  const auto dof = static_cast<double>(information.rows());
  for (int run = 0; run < runs; ++run) {
    const std::optional<Draw> draw = experiment(1000U + static_cast<unsigned>(run));
    if (!draw) {
      ++failures;
      continue;
    }
    ratio2 += draw->error.dot(information * draw->error) / dof;
    nees += draw->error.dot(draw->covariance.ldlt().solve(draw->error)) / dof;
  }
  const double count = runs - failures;
  const double ratio = std::sqrt(ratio2 / count);
  nees /= count;
  // Three standard errors around the window that many runs must keep.
  const double spread = 3.0 * std::sqrt(2.0 / (count * dof));
  const bool passed = failures == 0 && ratio <= max_ratio + 0.5 * spread && nees >= 0.9 - spread &&
                      nees <= 1.1 + spread;
  std::printf(
      "%-34s %5d runs x %2.0f dof, %d failed: error / bound %.3f (limit %.1f), "
      "squared error / covariance %.3f%s\n",
      name.c_str(), runs, dof, failures, ratio, max_ratio, nees, passed ? "" : "  MISSED");
  std::fflush(stdout);
  return passed;
}

int Runs(double share, int runs) {
  return std::max(2, static_cast<int>(std::lround(share * runs)));
}

/// The nominal devices with focal lengths multiplied, distortion kept as a map of pixels.
CameraModel WithFocal(CameraModel model, double factor) {
  const double f2 = factor * factor;
  model.fx *= factor;
  model.fy *= factor;
  model.distortion = {model.distortion[0] * f2, model.distortion[1] * f2 * f2,
                      model.distortion[2] * factor, model.distortion[3] * factor,
                      model.distortion[4] * f2 * f2 * f2};
  return model;
}

bool RelativePoses(double share) {
  const EpipolarScene scene = testing::MakeEpipolarScene();
  const testing::SigmaOf spread = [](int i) {
    return Eigen::Vector2d(0.02 + 0.58 * ((i * 7919) % 101) / 100.0,
                           0.02 + 0.58 * ((i * 104729) % 97) / 96.0);
  };
  bool passed = true;
  for (const bool equal : {true, false}) {
    const testing::SigmaOf sigma = equal ? SameSigma(kSigmaPx) : spread;
    auto clean = testing::MakeMatches(scene, 36, 36, SameSigma(1e-9), 0);
    for (std::size_t i = 0; i < clean.size(); ++i) {
      clean[i].covariance_px2 = sigma(static_cast<int>(i)).cwiseAbs2().asDiagonal();
    }
    const auto run = [&](unsigned seed) -> std::optional<Draw> {
      const auto pose =
          EstimateRelativePose(testing::MakeMatches(scene, 36, 36, sigma, seed), scene.devices, {});
      if (!pose) return std::nullopt;
      return Draw{testing::PoseError(pose->T_observed_anchor, scene.T_projector_camera),
                  pose->covariance};
    };
    passed &= Report(equal ? "E6 relative pose, .08 px" : "E6 relative pose, .02 to .6 px",
                     Runs(share, 450), 1.1, testing::NumericInformation(scene, clean), run);
  }
  return passed;
}

/// Information of (omega, d, log f_anchor, log f_observed).
Eigen::MatrixXd PairInformation(const EpipolarScene& scene, const std::vector<Match>& matches) {
  const Transform& T = scene.T_projector_camera;
  const Eigen::Vector3d t = T.translation().normalized();
  const Matrix32d basis = TangentBasis(t);
  const auto residual = [&](const Match& match, int k, double h) {
    Eigen::Matrix<double, 7, 1> step = Eigen::Matrix<double, 7, 1>::Zero();
    step[k] = h;
    Transform moved = Transform::Identity();
    moved.linear() = T.linear() * ExpRotation(step.head<3>());
    moved.translation() = (t + basis * step.segment<2>(3)).normalized();
    const DevicePair devices{WithFocal(scene.devices.anchor, std::exp(step[5])),
                             WithFocal(scene.devices.observed, std::exp(step[6]))};
    const EpipolarResidual r = ResidualOf(match, devices, moved);
    return r.distance_px / r.sigma;
  };
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(7, 7);
  for (const Match& match : matches) {
    Eigen::VectorXd jacobian(7);
    for (int k = 0; k < 7; ++k) {
      jacobian[k] = (residual(match, k, kStep) - residual(match, k, -kStep)) / (2.0 * kStep);
    }
    information += jacobian * jacobian.transpose();
  }
  return information;
}

bool Pairs(double share) {
  bool passed = true;
  for (const double pitch_deg : {2.0, 5.0}) {
    const EpipolarScene scene = testing::PitchedScene(pitch_deg);
    auto clean = testing::MakeMatches(scene, 50, 50, SameSigma(1e-9), 0);
    for (Match& match : clean) {
      match.covariance_px2 = kSigmaPx * kSigmaPx * Eigen::Matrix2d::Identity();
    }
    const Eigen::MatrixXd information = PairInformation(scene, clean);
    const Eigen::VectorXd bound = information.inverse().diagonal().cwiseSqrt();
    const auto run = [&](unsigned seed) -> std::optional<Draw> {
      const auto matches = testing::MakeMatches(scene, 50, 50, SameSigma(kSigmaPx), seed);
      const DevicePair nominal{WithFocal(scene.devices.anchor, 1.05),
                               WithFocal(scene.devices.observed, 0.96)};
      const auto result = SelfCalibratePair(matches, nominal, kFreeFocal, kFreeFocal, {});
      if (!result) {
        std::printf("  %s\n", result.error().message.c_str());
        return std::nullopt;
      }
      Draw draw;
      draw.error = Eigen::VectorXd(7);
      draw.error << testing::PoseError(result->pose.T_observed_anchor, scene.T_projector_camera),
          std::log(scene.devices.anchor.fx / result->devices.anchor.fx),
          std::log(scene.devices.observed.fx / result->devices.observed.fx);
      draw.covariance = result->covariance;
      return draw;
    };
    std::printf(
        "one pair, projector pitched by %.0f deg: bound of the focal lengths %.3f %% and "
        "%.3f %%\n",
        pitch_deg, 100.0 * bound[5], 100.0 * bound[6]);
    passed &= Report("E7 self-calibration of one pair", Runs(share, 300), 1.2, information, run);
  }
  return passed;
}

/// Everything that the stations have in common, moved by a step of (4 + 4 intrinsics, 6 each).
StationScene Moved(const StationScene& scene, const Eigen::VectorXd& step) {
  StationScene moved = scene;
  const auto move = [](CameraModel& model, const Eigen::Vector4d& by) {
    model.fx *= std::exp(by[0]);
    model.fy *= std::exp(by[0]);
    model.cx += by[1];
    model.cy += by[2];
    model.distortion[0] += by[3];
  };
  move(moved.devices.anchor, step.segment<4>(0));
  move(moved.devices.observed, step.segment<4>(4));
  for (std::size_t i = 0; i < scene.T_station_anchor.size(); ++i) {
    const Vector6d xi = step.segment<6>(static_cast<Eigen::Index>(8 + 6 * i));
    moved.T_station_anchor[i] = scene.T_station_anchor[i] * Exp(xi);
  }
  return moved;
}

/// Columns that are free: station 0 keeps its distance, held intrinsics are left out.
Eigen::MatrixXd FreeColumns(const StationScene& scene, bool free_intrinsics) {
  const auto size = static_cast<Eigen::Index>(8 + 6 * scene.T_station_anchor.size());
  const Transform& first = scene.T_station_anchor.front();
  Eigen::MatrixXd all = Eigen::MatrixXd::Identity(size, size);
  all.block<3, 2>(11, 11) =
      first.linear().transpose() * TangentBasis(first.translation().normalized());
  Eigen::MatrixXd basis(size, size - 1 - (free_intrinsics ? 0 : 8));
  Eigen::Index column = 0;
  for (Eigen::Index k = free_intrinsics ? 0 : 8; k < size; ++k) {
    if (k == 13) continue;
    basis.col(column++) = all.col(k);
  }
  return basis;
}

Eigen::VectorXd TrackResidual(const StationScene& scene, const TrackSet& tracks, std::size_t first,
                              std::size_t end, double depth) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(2 * (end - first)));
  for (std::size_t k = first; k < end; ++k) {
    const TrackObservation& seen = tracks.observations[k];
    const Eigen::Vector2d ray =
        Undistort(scene.devices.anchor, tracks.anchor_px[static_cast<std::size_t>(seen.track)]);
    const Transform& T = scene.T_station_anchor[static_cast<std::size_t>(seen.station)];
    out.segment<2>(static_cast<Eigen::Index>(2 * (k - first))) =
        Project(scene.devices.observed, T * (depth * ray.homogeneous())) / kSigmaPx;
  }
  return out;
}

/// Schur complement of all depths, by central differences.
Eigen::MatrixXd StationInformation(const StationScene& scene, const TrackSet& tracks,
                                   const Eigen::MatrixXd& basis) {
  const auto depth_of = testing::Relief(0.035);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(basis.cols(), basis.cols());
  std::vector<StationScene> high;
  std::vector<StationScene> low;
  for (Eigen::Index k = 0; k < basis.cols(); ++k) {
    high.push_back(Moved(scene, kStep * basis.col(k)));
    low.push_back(Moved(scene, -kStep * basis.col(k)));
  }
  std::size_t first = 0;
  while (first < tracks.observations.size()) {
    const int track = tracks.observations[first].track;
    std::size_t end = first;
    while (end < tracks.observations.size() && tracks.observations[end].track == track) ++end;
    const double depth = depth_of(
        Undistort(scene.devices.anchor, tracks.anchor_px[static_cast<std::size_t>(track)]));
    const auto rows = static_cast<Eigen::Index>(2 * (end - first));
    Eigen::MatrixXd J(rows, basis.cols());
    for (Eigen::Index k = 0; k < basis.cols(); ++k) {
      const auto i = static_cast<std::size_t>(k);
      J.col(k) = (TrackResidual(high[i], tracks, first, end, depth) -
                  TrackResidual(low[i], tracks, first, end, depth)) /
                 (2.0 * kStep);
    }
    const Eigen::VectorXd d = (TrackResidual(scene, tracks, first, end, depth + kStep) -
                               TrackResidual(scene, tracks, first, end, depth - kStep)) /
                              (2.0 * kStep);
    const Eigen::VectorXd cross = J.transpose() * d;
    information += J.transpose() * J - cross * cross.transpose() / d.squaredNorm();
    first = end;
  }
  return information;
}

/// Error of a solution as the step that leads from it to the truth.
Eigen::VectorXd StationError(const StationsSolution& solution, const StationScene& truth) {
  Eigen::VectorXd error(static_cast<Eigen::Index>(8 + 6 * truth.T_station_anchor.size()));
  const auto difference = [](const CameraModel& to, const CameraModel& from) {
    return Eigen::Vector4d(std::log(to.fx / from.fx), to.cx - from.cx, to.cy - from.cy,
                           to.distortion[0] - from.distortion[0]);
  };
  error.segment<4>(0) = difference(truth.devices.anchor, solution.devices.anchor);
  error.segment<4>(4) = difference(truth.devices.observed, solution.devices.observed);
  for (std::size_t i = 0; i < truth.T_station_anchor.size(); ++i) {
    error.segment<6>(static_cast<Eigen::Index>(8 + 6 * i)) =
        Log(solution.T_station_anchor[i].inverse() * truth.T_station_anchor[i]);
  }
  return error;
}

bool Stations(double share) {
  bool passed = true;
  struct Case {
    int num_stations;
    bool free;
    const char* name;
  };
  for (const Case& one : {Case{2, false, "E10 two stations, devices known"},
                          Case{4, false, "E10 four stations, devices known"},
                          Case{4, true, "E7 four rolled stations, all free"}}) {
    const StationScene scene = testing::MakeStationScene(one.num_stations, one.free ? 90.0 : 0.0);
    const Eigen::MatrixXd basis = FreeColumns(scene, one.free);
    const Eigen::MatrixXd information =
        StationInformation(scene, testing::MakeTracks(scene, 30, 30, kSigmaPx, 1), basis);
    const IntrinsicsPrior prior = one.free ? kFreeAll : IntrinsicsPrior{};
    double focal2 = 0.0;
    int count = 0;
    const auto run = [&](unsigned seed) -> std::optional<Draw> {
      TrackSet tracks = testing::MakeTracks(scene, 30, 30, kSigmaPx, seed);
      if (one.free) {
        tracks.devices.anchor.fx = tracks.devices.anchor.fy = 2330.0;
        tracks.devices.anchor.cx += 4.0;
        tracks.devices.observed.fx = tracks.devices.observed.fy = 5750.0;
        tracks.devices.observed.cy -= 6.0;
      }
      const auto result = SolveStations(tracks, prior, prior, testing::BaselineOf(scene), {}, {});
      if (!result) {
        std::printf("  %s\n", result.error().message.c_str());
        return std::nullopt;
      }
      const Eigen::VectorXd error = StationError(*result, scene);
      focal2 += error[0] * error[0] + error[4] * error[4];
      count += 2;
      return Draw{basis.transpose() * error, basis.transpose() * result->joint_covariance * basis};
    };
    passed &= Report(one.name, Runs(share, one.free ? 100 : 200), 1.2, information, run);
    if (!one.free) continue;
    const double focal = 100.0 * std::sqrt(focal2 / std::max(1, count));
    std::printf("  rms error of the focal lengths %.4f %% (limit .05 %%)\n", focal);
    passed &= focal <= 0.05;
  }
  return passed;
}

bool RigAgainstProjector(double share) {
  const Transform truth = testing::FarProjector();
  const CameraModel projector = testing::LitProjector();
  Matrix6d information = Matrix6d::Zero();
  for (const LitPoint& lit : testing::Lit(truth, 30, 1)) {
    Eigen::Matrix<double, 2, 6> J;
    for (int k = 0; k < 6; ++k) {
      Vector6d step = Vector6d::Zero();
      step[k] = kStep;
      J.col(k) = (Project(projector, truth * Exp(step) * lit.point_rig) -
                  Project(projector, truth * Exp(-step) * lit.point_rig)) /
                 (2.0 * kStep);
    }
    const Eigen::Matrix<double, 2, 3> by_point = J.rightCols<3>();
    const Eigen::Matrix2d sigma =
        lit.covariance_px2 + by_point * lit.covariance_m2 * by_point.transpose();
    information += J.transpose() * sigma.inverse() * J;
  }
  const auto run = [&](unsigned seed) -> std::optional<Draw> {
    const auto pose = EstimateViewPose(testing::Lit(truth, 30, seed), projector, {});
    if (!pose) return std::nullopt;
    return Draw{Log(pose->T_projector_rig.inverse() * truth), pose->covariance};
  };
  return Report("E10 rig against a projector", Runs(share, 400), 1.2, information, run);
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  const double share = argc > 1 ? std::strtod(argv[1], nullptr) : 1.0;
  if (!(share > 0.0) || share > 100.0) {
    std::fprintf(stderr, "pose_proof: share of the runs '%s' must lie in (0, 100]\n", argv[1]);
    return 2;
  }
  bool passed = fringe_fusion::RelativePoses(share);
  passed &= fringe_fusion::Pairs(share);
  passed &= fringe_fusion::Stations(share);
  passed &= fringe_fusion::RigAgainstProjector(share);
  return passed ? 0 : 1;
}
