#include "fringe_fusion/fusion/variational_surface.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/io/config_yaml.hpp"
#include "test/fusion/synthetic_views.hpp"
#include "test/support/draws.hpp"

namespace fringe_fusion {
namespace {

constexpr double kBallRadius = 0.02;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// Evenly spread by the golden angle; true normals, noise along them.
std::vector<MeasuredPoint> SpherePoints(int count, double sigma_m) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 1.0);
  std::vector<MeasuredPoint> points;
  for (int i = 0; i < count; ++i) {
    const double z = -1.0 + 2.0 * (i + 0.5) / count;
    const double r = std::sqrt(1.0 - z * z);
    const double angle = 2.399963 * i;
    const Eigen::Vector3d n(r * std::cos(angle), r * std::sin(angle), z);
    MeasuredPoint point;
    point.position = ((kBallRadius + sigma_m * noise(random)) * n).cast<float>();
    point.normal = n.cast<float>();
    point.sigma = static_cast<float>(std::max(sigma_m, 1e-6));
    point.color = Rgb8{10, 20, 30};
    points.push_back(point);
  }
  return points;
}

std::vector<MeasuredPoint> PlanePoints(int side) {
  std::vector<MeasuredPoint> points;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      MeasuredPoint point;
      point.position =
          Eigen::Vector3f(0.001F * static_cast<float>(x), 0.001F * static_cast<float>(y), 0.003F);
      point.normal = Eigen::Vector3f::UnitZ();
      point.sigma = 1e-5F;
      points.push_back(point);
    }
  }
  return points;
}

VariationalConfig MakeConfig(double voxel_m, double width_m) {
  VariationalConfig config;
  config.voxel_m = voxel_m;
  config.smoothing_width_m = width_m;
  return config;
}

// Mean and root mean square of D at true points of the sphere, and of it over the stated sigma.
struct Errors {
  double mean_m = 0.0;
  double rms_m = 0.0;
  double over_sigma = 0.0;
};
Errors ErrorsOn(const VariationalSurface& surface) {
  double sum = 0.0;
  double squares = 0.0;
  double relative = 0.0;
  const std::vector<MeasuredPoint> truth = SpherePoints(997, 0.0);
  for (const MeasuredPoint& point : truth) {
    const FieldSample at = surface.Query(point.position.cast<double>());
    EXPECT_TRUE(at.supported);
    sum += static_cast<double>(at.distance);
    squares += std::pow(static_cast<double>(at.distance), 2);
    relative += std::pow(static_cast<double>(at.distance / at.sigma), 2);
  }
  const auto count = static_cast<double>(truth.size());
  return {sum / count, std::sqrt(squares / count), std::sqrt(relative / count)};
}

TEST(VariationalSurface, IsExactOnAnExactSphere) {
  for (const std::string kernel :
       test_support::Cases({"triharmonic", "wendland", "biharmonic", "thin_plate"})) {
    VariationalConfig config = MakeConfig(0.001, 0.0003);
    config.kernel = kernel;
    if (kernel == "biharmonic" || kernel == "thin_plate") config.constraints = "offsets";
    const auto surface = VariationalSurface::Fit(SpherePoints(3000, 0.0), config);
    ASSERT_TRUE(surface) << surface.error().message;
    // Points 1.3 mm apart on a radius of 20 mm: the chords lie 10 um deep.
    EXPECT_LT(ErrorsOn(*surface).rms_m, kernel == "biharmonic" ? 5e-6 : 2e-6) << kernel;
    // A distance, not just a zero set.
    const FieldSample outside = surface->Query({0.0, kBallRadius + 0.0008, 0.0});
    ASSERT_TRUE(outside.supported);
    EXPECT_NEAR(outside.distance, 0.0008, 0.00008) << kernel;
    EXPECT_NEAR(outside.gradient.y(), 1.0F, 0.02F);
    EXPECT_EQ(outside.color.g, 20);
  }
}

TEST(VariationalSurface, IsExactOnAPlane) {
  const auto surface = VariationalSurface::Fit(PlanePoints(30), MakeConfig(0.001, 0.0));
  ASSERT_TRUE(surface) << surface.error().message;
  EXPECT_NEAR(surface->Query({0.0153, 0.0121, 0.003}).distance, 0.0F, 1e-8F);
  EXPECT_NEAR(surface->Query({0.0153, 0.0121, 0.0041}).distance, 0.0011F, 1e-6F);
  EXPECT_FALSE(surface->Query({0.0153, 0.0121, 0.03}).supported);
  EXPECT_FALSE(surface->Query({0.05, 0.05, 0.003}).supported);
}

TEST(VariationalSurface, SmoothsNoiseAndStatesWhatRemains) {
  constexpr double kSigma = 1e-4;
  const auto surface = VariationalSurface::Fit(SpherePoints(20000, kSigma), MakeConfig(0.001, 0.0));
  ASSERT_TRUE(surface) << surface.error().message;
  const VariationalFigures& figures = surface->figures();
  EXPECT_NEAR(figures.spacing_m, 0.0005, 0.00006);
  EXPECT_GT(figures.smoothing_width_m, 2.0 * figures.spacing_m);
  EXPECT_NEAR(figures.validation_ratio, 1.0, 0.1);
  EXPECT_LT(figures.num_centers, 10000U);
  const Errors errors = ErrorsOn(*surface);
  EXPECT_LT(errors.rms_m, 0.05 * kSigma);
  EXPECT_GT(errors.over_sigma, 0.6);
  EXPECT_LT(errors.over_sigma, 1.4);
}

// Merged points of a bent patch have their mean below the surface, by 0.11 mm here. Noise lowers
// the slope of f, and must not move its zero set with that.
TEST(VariationalSurface, MergedPointsLeaveNoBias) {
  constexpr double kSigma = 1e-4;
  const auto surface =
      VariationalSurface::Fit(SpherePoints(20000, kSigma), MakeConfig(0.001, 0.00435));
  ASSERT_TRUE(surface) << surface.error().message;
  EXPECT_LT(surface->figures().num_centers, 400U);
  EXPECT_NEAR(ErrorsOn(*surface).mean_m, 0.0, 0.02 * kSigma);
}

TEST(VariationalSurface, CellsFollowOneDenseSystem) {
  constexpr double kSigma = 1e-4;
  const std::vector<MeasuredPoint> points = SpherePoints(1000, kSigma);
  const VariationalConfig config = MakeConfig(0.001, 0.0015);
  const auto cells = VariationalSurface::Fit(points, config);
  const auto cloud = VariationalCloud::Fit(points, config);
  ASSERT_TRUE(cells && cloud);
  double of_cloud = 0.0;
  const std::vector<MeasuredPoint> truth = SpherePoints(997, 0.0);
  for (const MeasuredPoint& point : truth) {
    of_cloud += std::pow(cloud->Distance(point.position.cast<double>()), 2);
  }
  const double rms = std::sqrt(of_cloud / static_cast<double>(truth.size()));
  EXPECT_LT(rms, 0.6 * kSigma);
  EXPECT_LT(ErrorsOn(*cells).rms_m, 1.05 * rms);
  EXPECT_NEAR(cloud->Gradient({kBallRadius, 0.0, 0.0}).norm(), 1.0, 0.05);
}

TEST(VariationalSurface, WeighsPointsByTheirNoise) {
  // Every other point is 0.2 mm too far out and says that it is uncertain.
  std::vector<MeasuredPoint> points = SpherePoints(6000, 1e-5);
  for (std::size_t i = 0; i < points.size(); i += 2) {
    points[i].position += 2e-4F * points[i].normal;
    points[i].sigma = 1e-3F;
  }
  const auto surface = VariationalSurface::Fit(points, MakeConfig(0.001, 0.0015));
  ASSERT_TRUE(surface);
  EXPECT_LT(ErrorsOn(*surface).rms_m, 5e-6);
}

TEST(VariationalSurface, TakesDoublePointsAndSkipsBadOnes) {
  std::vector<MeasuredPoint> points = SpherePoints(3000, 1e-5);
  const std::vector<MeasuredPoint> once = points;
  points.insert(points.end(), once.begin(), once.end());
  for (VariationalConfig config : {MakeConfig(0.001, 0.001), MakeConfig(0.001, 0.001)}) {
    config.reduction_ratio = points.size() > 6000 ? 0.0 : 1.2;
    points.push_back(once[0]);
    points.back().position.x() = kNan;
    points.push_back(once[0]);
    points.back().normal.setZero();
    points.push_back(once[0]);
    points.back().sigma = kNan;
    const auto surface = VariationalSurface::Fit(points, config);
    ASSERT_TRUE(surface) << surface.error().message;
    EXPECT_EQ(surface->figures().num_unusable % 3, 0U);
    EXPECT_LT(ErrorsOn(*surface).rms_m, 1e-5);
  }
}

TEST(VariationalSurface, RefusesWhatItCannotFit) {
  const auto expect = [](const std::vector<MeasuredPoint>& points, const VariationalConfig& config,
                         const std::string& words) {
    const auto surface = VariationalSurface::Fit(points, config);
    ASSERT_FALSE(surface);
    EXPECT_NE(surface.error().message.find(words), std::string::npos) << surface.error().message;
  };
  expect({}, MakeConfig(0.001, 0.0), "0 of 0 points");
  expect(SpherePoints(9, 0.0), MakeConfig(0.001, 0.0), "9 of 9 points");
  expect(std::vector<MeasuredPoint>(50, SpherePoints(50, 0.0)[7]), MakeConfig(0.001, 0.0),
         "coincide");
  VariationalConfig config = MakeConfig(0.001, 0.0);
  config.kernel = "gauss";
  expect(SpherePoints(50, 0.0), config, "gauss");
  config.kernel = "biharmonic";
  expect(SpherePoints(50, 0.0), config, "constraints = offsets");
  config.constraints = "none";
  expect(SpherePoints(50, 0.0), config, "'none'");
  config = MakeConfig(1e-6, 0.001);
  expect(SpherePoints(5000, 0.0), config, "voxel_m");
  config = MakeConfig(0.001, 0.0);
  config.overlap = 9.0;
  expect(SpherePoints(50, 0.0), config, "overlap = 9");
  const auto cancelled = VariationalSurface::Fit(SpherePoints(500, 0.0), MakeConfig(0.001, 0.001),
                                                 [](const std::string&, double) { return false; });
  EXPECT_FALSE(cancelled);
}

TEST(VariationalSurface, SameBytesOnAnyNumberOfThreads) {
  const std::vector<MeasuredPoint> points = SpherePoints(test_support::Draws(3000, 1000), 1e-4);
  std::vector<VoxelField::PaddedDistances> expected;
  for (const int threads : {1, 2, 3}) {
    const ThreadLimit limit(threads);
    const auto surface = VariationalSurface::Fit(points, MakeConfig(0.001, 0.0));
    ASSERT_TRUE(surface);
    std::vector<VoxelField::PaddedDistances> found;
    for (const auto& block : surface->Blocks()) found.push_back(surface->DistancesOf(block));
    if (expected.empty()) expected = found;
    ASSERT_EQ(found.size(), expected.size());
    EXPECT_EQ(std::memcmp(found.data(), expected.data(),
                          found.size() * sizeof(VoxelField::PaddedDistances)),
              0);
  }
}

TEST(MeasuredPoints, CarryNoiseAlongTheNormal) {
  testing::ViewSettings settings;
  settings.stated_sigma_m = 1e-4;
  const View view =
      testing::CastView(0, testing::SphereScene(kBallRadius), {0.0, 0.0, 0.2}, settings);
  VariationalConfig config;
  config.border_taper_px = 0.0;
  const auto points = MeasuredPoints({view}, config);
  ASSERT_TRUE(points);
  EXPECT_GT(points->size(), 1000U);
  for (const MeasuredPoint& point : *points) {
    EXPECT_NEAR(point.position.norm(), kBallRadius, 1e-6);
    const Eigen::Vector3f to_camera =
        (Eigen::Vector3f(0.0F, 0.0F, 0.2F) - point.position).normalized();
    EXPECT_NEAR(point.sigma, 1e-4F * point.normal.dot(to_camera), 1e-8F);
  }
}

TEST(VariationalConfig, FileStatesEveryKey) {
  const auto config = LoadConfigFile<VariationalConfig>(SOURCE_DIR "/config/variational.yaml");
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->max_cell_centers, VariationalConfig{}.max_cell_centers);
}

}  // namespace
}  // namespace fringe_fusion
