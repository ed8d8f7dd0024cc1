#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "fringe_fusion/sim/gauges.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"

// Rays of the simulator through pattern, decoder and triangulation, against the simulator's truth.

namespace fringe_fusion {
namespace {

struct View {
  sim::ViewTruth truth;
  PhaseMap phase;
  TriangulationResult result;
};

CellCalibration SmallScanner() {
  CellCalibration calibration = sim::DefaultCalibration();
  CameraModel& camera = calibration.camera;
  const double scale = 200.0 / camera.width;
  camera.fx *= scale;
  camera.fy *= scale;
  camera.cx = (camera.cx + 0.5) * scale - 0.5;
  camera.cy = (camera.cy + 0.5) * scale - 0.5;
  camera.width = 200;
  camera.height = static_cast<int>(std::lround(camera.height * scale));
  return calibration;
}

View ScanView(const sim::SimConfig& config, const Mesh& object) {
  const CellCalibration calibration = SmallScanner();
  sim::SimCell cell = sim::SimCell::Create(config, calibration, object, Mesh{}).value();
  EXPECT_TRUE(cell.MoveTo(sim::TurntablePose(1, 12, 0.5, 60.0, Eigen::Vector3d::Zero()), 0));
  const PatternSequence sequence =
      MakeSequence({}, calibration.projector.width, calibration.projector.height).value();
  const ImageStack stack =
      CaptureStack(cell, sequence, 1.0, config.exposure_reference_s, 0).value();
  PhaseConfig phase_config;
  phase_config.read_noise_dn = config.read_noise_dn;
  phase_config.gain_dn = config.gain_dn;
  View view;
  view.truth = cell.Truth();
  view.phase = DecodePhase(stack, phase_config).value();
  view.result = Triangulate(view.phase, calibration, {}).value();
  return view;
}

// rms of error / sigma of the range over all points that have a truth.
double PlaneRms(const View& view) {
  double sum = 0.0;
  int count = 0;
  const RangeImage& range = view.result.range;
  for (std::size_t i = 0; i < range.points.size(); ++i) {
    if (!range.points[i].allFinite() || !view.truth.points[i].allFinite()) continue;
    const double error = static_cast<double>(range.points[i].norm()) -
                         static_cast<double>(view.truth.points[i].norm());
    sum += std::pow(error / static_cast<double>(range.sigma_range[i]), 2);
    ++count;
  }
  return std::sqrt(sum / count);
}

// Distance to the nearest true point of the 3 x 3 window: the centre of a pixel on the silhouette
// may miss the part that its area sees.
float DistanceToTruth(const View& view, int x, int y) {
  float least = std::numeric_limits<float>::infinity();
  for (int j = y - 1; j <= y + 1; ++j) {
    for (int i = x - 1; i <= x + 1; ++i) {
      if (!view.truth.points.Contains(i, j) || !view.truth.points(i, j).allFinite()) continue;
      const Eigen::Vector3f error = view.result.range.points(x, y) - view.truth.points(i, j);
      least = std::min(least, error.norm());
    }
  }
  return least;
}

int CountFar(const View& view, float limit_m) {
  int num_far = 0;
  for (int y = 0; y < view.result.range.height; ++y) {
    for (int x = 0; x < view.result.range.width; ++x) {
      if (!IsValid(view.result.range, x, y)) continue;
      num_far += DistanceToTruth(view, x, y) <= limit_m ? 0 : 1;
    }
  }
  return num_far;
}

// Lit all around, and no neighbour more than 20 deg off the tangent plane: no edge runs through.
bool LiesOnOneSurface(const View& view, int x, int y) {
  const sim::ViewTruth& truth = view.truth;
  for (int j = y - 1; j <= y + 1; ++j) {
    for (int i = x - 1; i <= x + 1; ++i) {
      if (!truth.lit.Contains(i, j) || truth.lit(i, j) == 0) return false;
      const Eigen::Vector3f apart = truth.points(i, j) - truth.points(x, y);
      if (std::abs(truth.normals(x, y).dot(apart)) > 0.342F * apart.norm()) return false;
    }
  }
  return true;
}

// Share of the pixels on one surface that have a point.
double Completeness(const View& view) {
  int num_good = 0;
  int num_valid = 0;
  for (int y = 0; y < view.result.range.height; ++y) {
    for (int x = 0; x < view.result.range.width; ++x) {
      if (!LiesOnOneSurface(view, x, y)) continue;
      ++num_good;
      num_valid += IsValid(view.result.range, x, y) ? 1 : 0;
    }
  }
  return static_cast<double>(num_valid) / num_good;
}

TEST(SimulatedScan, PlaneErrorIsTheOnePredicted) {
  sim::SimConfig config;
  config.read_noise_dn = 1.5;
  config.gain_dn = 0.05;
  const View view = ScanView(config, sim::MakePlane(0.2, 4));
  EXPECT_GT(CountValid(view.result.range), 5000);
  EXPECT_GT(Completeness(view), 0.98);
  EXPECT_EQ(CountFar(view, 0.0025F), 0);
  EXPECT_NEAR(PlaneRms(view), 1.0, 0.1);
}

TEST(SimulatedScan, TwelveBitPlaneErrorIsTheOnePredicted) {
  sim::SimConfig config;
  config.bit_depth = 12;
  config.read_noise_dn = 10.0;
  config.gain_dn = 0.5;
  const View view = ScanView(config, sim::MakePlane(0.2, 4));
  EXPECT_GT(Completeness(view), 0.98);
  EXPECT_EQ(CountFar(view, 0.0025F), 0);
  EXPECT_NEAR(PlaneRms(view), 1.0, 0.1);
}

// A part with edges, holes and shadows: no point may lie in the air.
TEST(SimulatedScan, FreeformHasNoFlyingPoints) {
  sim::SimConfig config;
  config.read_noise_dn = 1.0;
  config.gain_dn = 0.05;
  config.camera_blur_px = 0.5;
  config.projector_blur_px = 0.7;
  const View view = ScanView(config, sim::MakeFreeform(1.5e-3));
  // Few of the pixels of this coarse view are far from every edge.
  EXPECT_GT(Completeness(view), 0.85);
  // Neighbouring pixels lie about 1 mm apart, more on oblique faces.
  EXPECT_LE(CountFar(view, 0.0025F), CountValid(view.result.range) / 500);
}

}  // namespace
}  // namespace fringe_fusion
