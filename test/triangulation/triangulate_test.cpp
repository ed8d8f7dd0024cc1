#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "analytic_view.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion {
namespace {

using test::AnalyticView;
using test::MakeScanner;
using test::MakeView;
using test::PlaneDepth;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
const Eigen::Vector2d kNoNoise(1e-4, 1e-4);

AnalyticView PlaneView(const Eigen::Vector2d& sigma_px, unsigned seed) {
  const Eigen::Vector3d normal = Eigen::Vector3d(0.2, -0.1, 1.0).normalized();
  return MakeView(MakeScanner(), PlaneDepth(normal, 0.5), sigma_px, seed);
}

double MaxError(const RangeImage& range, const Image<Eigen::Vector3d>& truth) {
  double worst = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (!range.points[i].allFinite()) continue;
    worst = std::max(worst, (range.points[i].cast<double>() - truth[i]).norm());
  }
  return worst;
}

// rms of the error along the ray in units of the predicted sigma.
double NormalizedRms(const RangeImage& range, const Image<Eigen::Vector3d>& truth) {
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (!range.points[i].allFinite()) continue;
    const double error = range.points[i].cast<double>().norm() - truth[i].norm();
    sum += std::pow(error / static_cast<double>(range.sigma_range[i]), 2);
    ++count;
  }
  return std::sqrt(sum / count);
}

TEST(Triangulate, IsExactWithDistortionInBothDevices) {
  AnalyticView view = PlaneView({0.0, 0.0}, 1);
  for (Image<float>* sigma : {&view.phase.sigma_u, &view.phase.sigma_v}) {
    std::fill(sigma->begin(), sigma->end(), 0.05F);
  }
  const auto result = Triangulate(view.phase, MakeScanner(), {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_EQ(CountValid(result->range), 160 * 120);
  EXPECT_LT(MaxError(result->range, view.points), 2e-6);  // float coordinates
  EXPECT_LT(result->median_abs_epipolar_px, 1e-4);
  EXPECT_EQ(result->range.color(3, 4).g, 20);
  const Eigen::Vector3d centre = MakeScanner().T_projector_camera.inverse().translation();
  ASSERT_TRUE(result->range.line_of_sight.projector.has_value());
  EXPECT_LT((result->range.line_of_sight.projector->cast<double>() - centre).norm(), 1e-6);
}

TEST(Triangulate, OneAxisIsEnough) {
  for (const bool keep_u : {true, false}) {
    AnalyticView view = PlaneView(kNoNoise, 1);
    (keep_u ? view.phase.v : view.phase.u) = {};
    (keep_u ? view.phase.sigma_v : view.phase.sigma_u) = {};
    const auto result = Triangulate(view.phase, MakeScanner(), {});
    ASSERT_TRUE(result.has_value()) << result.error().message;
    EXPECT_GT(CountValid(result->range), 160 * 120 * 99 / 100);
    EXPECT_TRUE(std::isnan(result->epipolar_residual_px(80, 60)));
    EXPECT_LT((result->range.points(80, 60).cast<double>() - view.points(80, 60)).norm(),
              keep_u ? 2e-6 : 2e-5);
  }
}

TEST(Triangulate, PredictsItsError) {
  const AnalyticView view = PlaneView({0.05, 0.1}, 7);
  const auto result = Triangulate(view.phase, MakeScanner(), {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_GT(CountValid(result->range), 160 * 120 * 99 / 100);
  EXPECT_NEAR(NormalizedRms(result->range, view.points), 1.0, 0.03);
}

// Against numbers, not against itself: parallel axes give sigma_Z = Z^2 sigma_u / (f_p b).
TEST(Triangulate, SigmaFollowsTheParallelAxesFormula) {
  CellCalibration cell = MakeScanner();
  cell.camera.distortion = cell.projector.distortion = {};
  cell.T_projector_camera = Transform::Identity();
  cell.T_projector_camera.translation() = Eigen::Vector3d(-0.2, 0.0, 0.0);
  cell.projector.cx = 260.0;
  const AnalyticView view =
      MakeView(cell, PlaneDepth(Eigen::Vector3d::UnitZ(), 0.6), {0.08, 0.08}, 3);
  const auto result = Triangulate(view.phase, cell, {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  const int x = 81;
  const int y = 59;
  EXPECT_NEAR(static_cast<double>(result->range.sigma_range(x, y)),
              0.6 * 0.6 * 0.08 / (420.0 * 0.2), 4e-6);
  EXPECT_NEAR(static_cast<double>(result->range.sigma_lateral(x, y)), 0.2887 * 0.6 / 251.0, 4e-6);
}

TEST(Triangulate, MasksWhatMissesTheEpipolarLine) {
  AnalyticView view = PlaneView({0.05, 0.05}, 5);
  for (int y = 40; y < 60; ++y) {
    for (int x = 50; x < 70; ++x) view.phase.v(x, y) += 12.0F;
  }
  const auto result = Triangulate(view.phase, MakeScanner(), {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_EQ(static_cast<MaskReason>(result->mask(60, 50)), MaskReason::kEpipolar);
  EXPECT_FALSE(IsValid(result->range, 60, 50));
  EXPECT_TRUE(IsValid(result->range, 20, 50));
  EXPECT_NEAR(static_cast<double>(result->epipolar_residual_px(60, 50)), 12.0, 3.0);
}

TEST(Triangulate, RangeLimitsAndSpecks) {
  AnalyticView view = PlaneView(kNoNoise, 1);
  TriangulationConfig config;
  config.min_range_m = 0.7;
  const auto near = Triangulate(view.phase, MakeScanner(), config);
  ASSERT_TRUE(near.has_value()) << near.error().message;
  EXPECT_EQ(CountValid(near->range), 0);
  EXPECT_EQ(static_cast<MaskReason>(near->mask(60, 50)), MaskReason::kOutOfRange);
  for (int y = 0; y < 120; ++y) {  // leaves a 4 x 4 island and the left half
    for (int x = 80; x < 160; ++x) {
      if (x < 100 || x > 103 || y < 50 || y > 53) view.phase.mask(x, y) = 1;
    }
  }
  const auto result = Triangulate(view.phase, MakeScanner(), {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_TRUE(IsValid(result->range, 60, 50));
  EXPECT_EQ(static_cast<MaskReason>(result->mask(101, 51)), MaskReason::kIsolated);
  EXPECT_FALSE(IsValid(result->range, 101, 51));
}

TEST(Triangulate, InvalidInputGivesWordsOrNothing) {
  AnalyticView view = PlaneView(kNoNoise, 1);
  view.phase.u(10, 10) = kNan;
  view.phase.v(10, 10) = kNan;
  view.phase.sigma_u(20, 20) = kNan;
  view.phase.sigma_v(20, 20) = -1.0F;
  const auto result = Triangulate(view.phase, MakeScanner(), {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_FALSE(IsValid(result->range, 10, 10));
  EXPECT_FALSE(IsValid(result->range, 20, 20));

  CellCalibration other = MakeScanner();
  other.camera.width = 320;
  const auto wrong_size = Triangulate(view.phase, other, {});
  ASSERT_FALSE(wrong_size.has_value());
  EXPECT_NE(wrong_size.error().message.find("160 x 120"), std::string::npos);
  other = MakeScanner();
  other.projector.fx = std::nan("");
  EXPECT_FALSE(Triangulate(view.phase, other, {}).has_value());
  TriangulationConfig config;
  config.max_range_m = std::nan("");
  EXPECT_FALSE(Triangulate(view.phase, MakeScanner(), config).has_value());
  config.max_range_m = 10.0;
  config.min_range_m = 30.0;
  const auto reversed = Triangulate(view.phase, MakeScanner(), config);
  ASSERT_FALSE(reversed.has_value());
  EXPECT_EQ(reversed.error().message,
            "triangulation: min_range_m = 30 must be below max_range_m = 10");
  view.phase.u = view.phase.v = {};
  const auto nothing = Triangulate(view.phase, MakeScanner(), {});
  ASSERT_FALSE(nothing.has_value());
  EXPECT_NE(nothing.error().message.find("neither u nor v"), std::string::npos);
}

TEST(Triangulate, SameBytesOnAnyNumberOfThreads) {
  const AnalyticView view = PlaneView({0.1, 0.1}, 9);
  std::vector<TriangulationResult> results;
  for (const int threads : {1, 2, 3}) {
    const ThreadLimit limit(threads);
    results.push_back(Triangulate(view.phase, MakeScanner(), {}).value());
  }
  const std::size_t bytes = results[0].range.points.size() * sizeof(Eigen::Vector3f);
  for (std::size_t i = 1; i < results.size(); ++i) {
    const RangeImage& a = results[0].range;
    const RangeImage& b = results[i].range;
    EXPECT_EQ(std::memcmp(a.points[0].data(), b.points[0].data(), bytes), 0);
    EXPECT_EQ(std::memcmp(a.normals[0].data(), b.normals[0].data(), bytes), 0);
    EXPECT_EQ(results[0].median_abs_epipolar_px, results[i].median_abs_epipolar_px);
  }
}

}  // namespace
}  // namespace fringe_fusion
