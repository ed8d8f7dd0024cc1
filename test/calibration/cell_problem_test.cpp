// The parts of the solver: derivatives against central differences, closed forms against the scene.
#include "src/calibration/cell_problem.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "cell_scene.hpp"
#include "fringe_fusion/calibration/error_field.hpp"
#include "src/calibration/dot_image.hpp"
#include "src/calibration/zhang.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)
using bundle::kCamera;
using bundle::kProjector;

bundle::State SceneState(const Transform& T) {
  const CellCalibration cell = SceneCell();
  bundle::State state;
  state.devices = {cell.camera, cell.projector};
  state.T_projector_camera = cell.T_projector_camera;
  state.blocks = {{T, {}}};
  state.points_target = TargetPoints(SceneTarget());
  return state;
}

Transform TiltedPose() {
  return ScenePose(SceneTarget(), Eigen::Vector3d(0.02, -0.03, 0.68), 0.5, 0.9, 0.4);
}

/// The state moved by one of the numbers that an observation of point 13 depends on.
bundle::State Moved(const bundle::State& state, int parameter, double step) {
  bundle::State moved = state;
  if (parameter < kNumCellParameters) {
    MoveShared(moved, step * Eigen::VectorXd::Unit(kNumCellParameters, parameter));
  } else if (parameter < kNumCellParameters + 6) {
    const Vector6d xi = step * Vector6d::Unit(parameter - kNumCellParameters);
    moved.blocks[0].T_camera_target = moved.blocks[0].T_camera_target * Exp(xi);
  } else {
    moved.points_target[13][parameter - kNumCellParameters - 6] += step;
  }
  return moved;
}

TEST(CellProblem, DerivativesAreThoseOfCentralDifferences) {
  const bundle::State state = SceneState(TiltedPose());
  const bundle::Station station;
  bundle::Observation seen;
  seen.point = 13;
  seen.pixel = Eigen::Vector2d(1000.0, 700.0);
  seen.whitener << 3.0, 0.0, 0.5, 2.0;
  bundle::Options options;
  options.scale = {2.0, 0.5};
  for (const std::size_t device : {kCamera, kProjector}) {
    seen.dot_radius_m = device == kCamera ? 0.005 : 0.0;
    const auto at = bundle::CellProblem::Linearize(state, station, seen, device, options);
    for (int k = 0; k < bundle::kNumLocal; ++k) {
      const double step = k < 18 && k % 9 < 4 ? 1e-3 : 1e-6;
      const auto up =
          bundle::CellProblem::Linearize(Moved(state, k, step), station, seen, device, options);
      const auto down =
          bundle::CellProblem::Linearize(Moved(state, k, -step), station, seen, device, options);
      const Eigen::Vector2d numeric = (up.e - down.e) / (2.0 * step);
      // The bend of the lens within a dot is not differentiated: half a per cent of the slope by
      // the distortion, nothing elsewhere.
      const double tolerance = device == kCamera && k >= 4 && k < 9 ? 1e-2 : 1e-4;
      EXPECT_LT((numeric - at.jacobian.col(k)).norm(), tolerance * (1.0 + numeric.norm()))
          << "device " << device << " parameter " << k;
    }
  }
}

/// The sums over a station against those taken observation by observation.
TEST(CellProblem, SumsTheProductsOfItsRows) {
  const CellCalibration cell = SceneCell();
  const bundle::State state = SceneState(TiltedPose());
  bundle::Station station;
  for (int point = 0; point < 20; ++point) {
    for (const std::size_t device : {kCamera, kProjector}) {
      const Eigen::Vector3d p = TiltedPose() * state.points_target[static_cast<std::size_t>(point)];
      bundle::Observation seen;
      seen.point = point;
      seen.pixel = device == kCamera ? Project(cell.camera, p)
                                     : Project(cell.projector, cell.T_projector_camera * p);
      seen.pixel += Eigen::Vector2d(0.3 * (point % 3), 0.2 * (point % 5));
      seen.dot_radius_m = device == kCamera ? 0.005 : 0.0;
      station.seen[device].push_back(seen);
    }
  }
  bundle::Options options;
  options.scale = {0.2, 0.3};
  const bundle::CellProblem problem({station}, state.points_target, {{}});
  const bundle::StationSums sums = problem.Sum(state, options, 0);
  bundle::LocalHessian hessian = bundle::LocalHessian::Zero();
  bundle::LocalVector gradient = bundle::LocalVector::Zero();
  for (const std::size_t device : {kCamera, kProjector}) {
    for (const bundle::Observation& seen : station.seen[device]) {
      const auto at = bundle::CellProblem::Linearize(state, station, seen, device, options);
      const auto missed = bundle::CellProblem::Miss(state, station, seen, device, options);
      EXPECT_LT((at.residual_px - missed.residual_px).norm(), 1e-9);
      EXPECT_LT((at.e - missed.e).norm(), 1e-9);
      const double weight = std::min(1.0, options.huber_sigma / at.e.norm());
      hessian += weight * at.jacobian.transpose() * at.jacobian;
      gradient += weight * at.jacobian.transpose() * at.e;
    }
  }
  EXPECT_LT((sums.hessian - hessian).norm(), 1e-10 * hessian.norm());
  EXPECT_LT((sums.gradient - gradient).norm(), 1e-10 * gradient.norm());
}

TEST(CellProblem, PredictsTheCentreOfTheImagedEllipse) {
  const Transform T = TiltedPose();
  bundle::State state = SceneState(T);
  for (CameraModel& model : state.devices) model.distortion = {};
  bundle::Observation seen;
  seen.point = 13;
  seen.dot_radius_m = 0.008;
  seen.pixel = CentreOfImage(state.devices[kCamera], T, state.points_target[13], 0.008);
  const auto at = bundle::CellProblem::Linearize(state, {}, seen, kCamera, {});
  EXPECT_LT(at.residual_px.norm(), 2e-4);  // the truth is a polygon of 360 sides
  const Eigen::Vector2d centre =
      Project(state.devices[kCamera], T * state.points_target[13]) - seen.pixel;
  EXPECT_GT(centre.norm(), 0.05);
}

/// Against the rim projected point by point through the lens.
TEST(CellProblem, PredictsWhatTheLensDoesToADot) {
  const CalibrationTarget target = SceneTarget();
  const Transform T = ScenePose(target, Eigen::Vector3d(0.02, -0.01, 0.68), 0.6, 0.9, 0.4);
  const bundle::State state = SceneState(T);
  for (const int point : {0, 10, 49, 98}) {
    bundle::Observation seen;
    seen.point = point;
    seen.dot_radius_m = 0.01;
    const Eigen::Vector3d& p = state.points_target[static_cast<std::size_t>(point)];
    seen.pixel = CentreOfImage(state.devices[kCamera], T, p, seen.dot_radius_m);
    const auto at = bundle::CellProblem::Linearize(state, {}, seen, kCamera, {});
    EXPECT_LT(at.residual_px.norm(), 1e-3) << point;
  }
  const Eigen::Vector3d corner = T * state.points_target[0];
  EXPECT_GT(bundle::LensShiftOfDot(state.devices[kCamera], corner, T.linear(), 0.01).norm(), 0.01);
}

TEST(Zhang, FindsIntrinsicsAndPosesOfAPinhole) {
  CameraModel truth = SceneCell().projector;
  truth.distortion = {};
  const CalibrationTarget target = SceneTarget();
  std::vector<Eigen::Matrix3d> homographies;
  const std::vector<Transform> poses = ScenePoses(target, 5, 3);
  for (const Transform& T : poses) {
    bundle::PlanarView view;
    for (const Eigen::Vector3d& p : TargetPoints(target)) {
      view.plane_m.emplace_back(p.head<2>());
      view.pixel.push_back(Project(truth, T * p));
    }
    view.pixel[7] += Eigen::Vector2d(60.0, -40.0);  // one bad point must not matter
    const auto fit = bundle::FitHomography(view);
    ASSERT_TRUE(fit);
    EXPECT_FALSE(fit->mirrored);
    EXPECT_LT(fit->median_residual_px, 0.05);
    homographies.push_back(fit->H);
  }
  const auto found = bundle::ZhangIntrinsics(homographies, truth.width, truth.height, std::nullopt);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->fx, truth.fx, 1.0);
  EXPECT_NEAR(found->cy, truth.cy, 1.0);
  const auto given = bundle::ZhangIntrinsics(homographies, truth.width, truth.height,
                                             Eigen::Vector2d(truth.cx, truth.cy));
  ASSERT_TRUE(given);
  EXPECT_NEAR(given->fy, truth.fy, 1.0);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const Transform T = bundle::PlanePose(homographies[k], truth);
    EXPECT_LT(Log(poses[k].inverse() * T).norm(), 2e-3) << k;
  }
}

TEST(Zhang, RefusesPointsOnALine) {
  bundle::PlanarView view;
  for (int i = 0; i < 8; ++i) {
    view.plane_m.emplace_back(0.01 * i, 0.02 * i);
    view.pixel.emplace_back(10.0 * i, 3.0 * i);
  }
  EXPECT_FALSE(bundle::FitHomography(view));
  view.plane_m.resize(3);
  view.pixel.resize(3);
  EXPECT_FALSE(bundle::FitHomography(view));
}

TEST(ErrorField, TriangulationInvertsProjection) {
  const CellCalibration cell = SceneCell();
  const Eigen::Vector3d point(0.05, -0.08, 0.71);
  const auto found = TriangulatePixels(cell, Project(cell.camera, point),
                                       Project(cell.projector, cell.T_projector_camera * point),
                                       MeasurementNoise{0.02, 0.05});
  ASSERT_TRUE(found);
  EXPECT_LT((*found - point).norm(), 1e-9);
  // Rays that part: to the left from the left device, ahead from the right one.
  EXPECT_FALSE(TriangulatePixels(cell, Eigen::Vector2d(60.0, 1000.0),
                                 Eigen::Vector2d(1270.0, 400.0), MeasurementNoise{}));
}

TEST(ErrorField, DerivativesAreThoseOfCentralDifferences) {
  const CellCalibration cell = SceneCell();
  const Eigen::Vector3d point(0.05, -0.08, 0.71);
  const Eigen::Vector2d camera = Project(cell.camera, point);
  const Eigen::Vector2d projector = Project(cell.projector, cell.T_projector_camera * point);
  const MeasurementNoise noise{0.02, 0.05};
  const auto analytic = PointByParameters(cell, point, noise);
  ASSERT_TRUE(analytic);
  for (int k = 0; k < kNumCellParameters; ++k) {
    const double step = k < 18 && k % 9 < 4 ? 1e-2 : 1e-6;
    std::array<Eigen::Vector3d, 2> points;
    for (const int side : {0, 1}) {
      bundle::State state;
      state.devices = {cell.camera, cell.projector};
      state.T_projector_camera = cell.T_projector_camera;
      MoveShared(state, (side == 0 ? step : -step) * Eigen::VectorXd::Unit(kNumCellParameters, k));
      CellCalibration moved = cell;
      moved.camera = state.devices[kCamera];
      moved.projector = state.devices[kProjector];
      moved.T_projector_camera = state.T_projector_camera;
      const auto found = TriangulatePixels(moved, camera, projector, noise);
      ASSERT_TRUE(found) << k;
      points[static_cast<std::size_t>(side)] = *found;
    }
    const Eigen::Vector3d numeric = (points[0] - points[1]) / (2.0 * step);
    EXPECT_LT((numeric - analytic->col(k)).norm(), 1e-4 * (1e-6 + numeric.norm()))
        << CellParameterName(k);
  }
}

TEST(ErrorField, RandomPartIsThatOfMonteCarlo) {
  const CellCalibration cell = SceneCell();
  const Eigen::Vector3d point(-0.06, 0.03, 0.69);
  const MeasurementNoise noise{0.03, 0.05};
  const auto predicted = PredictPointError(cell, CellCovariance::Zero(), point, noise);
  ASSERT_TRUE(predicted);
  EXPECT_EQ(predicted->calibration.norm(), 0.0);
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  constexpr int kRuns = 4000;
  for (int run = 0; run < kRuns; ++run) {
    const Eigen::Vector2d camera =
        Project(cell.camera, point) + 0.03 * Eigen::Vector2d(normal(random), normal(random));
    const Eigen::Vector2d projector = Project(cell.projector, cell.T_projector_camera * point) +
                                      0.05 * Eigen::Vector2d(normal(random), normal(random));
    const auto found = TriangulatePixels(cell, camera, projector, noise);
    ASSERT_TRUE(found);
    sum += (*found - point) * (*found - point).transpose() / kRuns;
  }
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(sum(axis, axis) / predicted->random(axis, axis), 1.0, 0.1) << axis;
  }
}

TEST(ErrorField, HoldsOnlyWhatBothDevicesSee) {
  const CellCalibration cell = SceneCell();
  CellCovariance covariance = CellCovariance::Zero();
  covariance(0, 0) = 1.0;
  const Volume volume{Eigen::Vector3d(-0.1, -0.1, 0.65), Eigen::Vector3d(3.0, 0.1, 0.75)};
  const ErrorField field = PredictErrorField(cell, covariance, volume, {3, 2, 2}, {});
  ASSERT_EQ(field.errors.size(), 12U);
  EXPECT_EQ(field.Point(2, 1, 0), Eigen::Vector3d(3.0, 0.1, 0.65));
  EXPECT_TRUE(field.At(0, 0, 0));
  EXPECT_FALSE(field.At(2, 0, 0));
  EXPECT_GT(field.RmsCalibration().minCoeff(), 0.0);
  EXPECT_THROW((void)PredictErrorField(cell, covariance, volume, {0, 1, 1}, {}),
               std::invalid_argument);
}

}  // namespace
}  // namespace fringe_fusion
