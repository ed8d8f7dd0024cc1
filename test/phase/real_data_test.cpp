// Real captured stacks, read in place, held against what their authors published.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "fringe_fusion/geometry/transform.hpp"
#include "test/phase/real_stacks.hpp"

namespace fringe_fusion {
namespace {

using test_support::DataPath;

double Quantile(std::vector<double>& values, double q) {
  const auto nth =
      values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

TEST(RealStacks, NeuvisionCodesEqualThePublishedOnes) {
  FRINGE_FUSION_REQUIRE_DATA(DataPath("neuvision"));
  const ImageStack stack = test::NeuvisionStack();
  ::setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);
  const cv::Mat expected = cv::imread(DataPath("neuvision/decoded.exr"), cv::IMREAD_UNCHANGED);
  if (expected.empty()) GTEST_SKIP() << "skipped: this OpenCV reads no OpenEXR";
  ASSERT_EQ(expected.type(), CV_32FC1);
  PhaseConfig config;
  config.gray_fit_radius_px = 0;
  config.max_bend_px = 10000.0;
  config.mask_beside_dark = false;
  for (const bool with_doubt : {true, false}) {
    if (!with_doubt)
      config.min_bit_sigma = config.min_fine_bit_sigma = config.min_contrast_dn = 0.0;
    const auto map = DecodePhase(stack, config);
    ASSERT_TRUE(map) << map.error().message;
    int num_published = 0;
    int num_decoded = 0;
    int num_agree = 0;
    for (int y = 0; y < map->height; ++y) {
      for (int x = 0; x < map->width; ++x) {
        const float code = expected.at<float>(y, x);
        if (!(code > 0.0F)) continue;
        ++num_published;
        if (map->mask(x, y) != 0) continue;
        ++num_decoded;
        // Doubtful fine bits leave a border or a coarser cell: half of it is sqrt(3) sigma.
        const float half_px = with_doubt ? 1.7321F * map->sigma_u(x, y) + 0.01F : 0.01F;
        if (std::abs(map->u(x, y) - code) <= half_px) ++num_agree;
      }
    }
    fmt::print("neuvision, doubt {}: {} published, {} decoded by us, {} agree\n", with_doubt,
               num_published, num_decoded, num_agree);
    EXPECT_EQ(num_published, 1000590);
    EXPECT_GE(num_decoded, with_doubt ? num_published * 99 / 100 : num_published);
    // The published codes take every doubtful bit as it fell: a few lie beside our interval.
    EXPECT_GE(num_agree, with_doubt ? num_decoded / 1000 * 999 : num_decoded);
  }
}

// Between the four pixels around; NaN where any is missing.
double Between(const Image<float>& image, const Eigen::Vector2d& pixel) {
  const int x = static_cast<int>(std::floor(pixel.x()));
  const int y = static_cast<int>(std::floor(pixel.y()));
  if (!image.Contains(x, y) || !image.Contains(x + 1, y + 1)) return std::nan("");
  const double right = pixel.x() - x;
  const double below = pixel.y() - y;
  const auto row = [&](int j) {
    return (1.0 - right) * static_cast<double>(image(x, j)) +
           right * static_cast<double>(image(x + 1, j));
  };
  return (1.0 - below) * row(y) + below * row(y + 1);
}

// The cloud's points are the places between two pixels where the code changes.
TEST(RealStacks, SlstudioGrayCodeAgreesWithThePublishedCloud) {
  FRINGE_FUSION_REQUIRE_DATA(DataPath("slstudio/skull_gray"));
  const std::vector<test::PublishedBorder> published = test::PublishedSkullBorders();
  ASSERT_GT(published.size(), 90000U);
  const ImageStack stack = test::SkullGrayStack();
  for (const int radius_px : {0, 2}) {
    PhaseConfig config;
    config.gray_fit_radius_px = radius_px;
    const Result<PhaseMap> map = DecodePhase(stack, config);
    ASSERT_TRUE(map) << map.error().message;
    std::vector<double> deviations;
    for (const test::PublishedBorder& border : published) {
      const double deviation = std::abs(Between(map->u, border.pixel_camera) - border.column_px);
      if (std::isfinite(deviation)) deviations.push_back(deviation);
    }
    fmt::print(
        "skull_gray, fit radius {} px: {} published, {} in both; deviation median {:.3f}, "
        "90 % {:.3f} px\n",
        radius_px, published.size(), deviations.size(), Quantile(deviations, 0.5),
        Quantile(deviations, 0.9));
    EXPECT_LE(Quantile(deviations, 0.5), radius_px == 0 ? 0.68 : 0.3);
    EXPECT_GE(static_cast<double>(deviations.size()), 0.9 * static_cast<double>(published.size()));
  }
}

TEST(RealStacks, SlstudioTwoFrequenciesDecode) {
  FRINGE_FUSION_REQUIRE_DATA(DataPath("slstudio/skull_2x3"));
  PhaseConfig config;
  config.max_wrong_order_ratio = 0.5;
  config.max_order_error_ratio = 0.5;
  config.max_level_sigma = 1e6;
  config.max_bend_px = 10000.0;
  const Result<PhaseMap> map = DecodePhase(test::SkullPhaseStack(), config);
  ASSERT_TRUE(map) << map.error().message;
  // The skull is smooth: a pixel that jumps by a period against its neighbour has a wrong order.
  const float period_px = 1824.0F / 16.0F;
  int num_pairs = 0;
  int num_jumps = 0;
  for (int y = 0; y < map->height; ++y) {
    for (int x = 1; x < map->width; ++x) {
      if (map->mask(x, y) != 0 || map->mask(x - 1, y) != 0) continue;
      ++num_pairs;
      if (std::abs(std::abs(map->u(x, y) - map->u(x - 1, y)) - period_px) < 10.0F) ++num_jumps;
    }
  }
  fmt::print("skull_2x3: {} neighbouring pairs, {} jumps by a period\n", num_pairs, num_jumps);
  EXPECT_GT(num_pairs, 100000);
  EXPECT_LT(num_jumps, num_pairs / 100);
}

// Distance of the decoded projector pixel from the epipolar line of its camera pixel.
double EpipolarDistancePx(const CellCalibration& cell, const Eigen::Vector2d& pixel_camera,
                          const Eigen::Vector2d& pixel_projector) {
  const Eigen::Vector3d ray_camera = Undistort(cell.camera, pixel_camera).homogeneous();
  const Eigen::Vector3d normal =
      cell.T_projector_camera.translation().cross(cell.T_projector_camera.linear() * ray_camera);
  const Eigen::Vector2d point = Undistort(cell.projector, pixel_projector);
  const double slope = std::hypot(normal.x() / cell.projector.fx, normal.y() / cell.projector.fy);
  return std::abs(normal.dot(point.homogeneous())) / slope;
}

TEST(RealStacks, SltkKeepsToItsEpipolarLines) {
  FRINGE_FUSION_REQUIRE_DATA(DataPath("sltk/scan_0020"));
  const Result<CellCalibration> cell =
      ReadCellCalibration(std::string(SOURCE_DIR) + "/config/datasets/sltk/cell.yaml");
  ASSERT_TRUE(cell) << cell.error().message;
  const Result<PhaseMap> map = DecodePhase(test::SltkStack(), PhaseConfig{});
  ASSERT_TRUE(map) << map.error().message;
  std::vector<double> distances;
  for (int y = 0; y < map->height; ++y) {
    for (int x = 0; x < map->width; ++x) {
      if (map->mask(x, y) != 0) continue;
      const Eigen::Vector2d projector(map->u(x, y), map->v(x, y));
      distances.push_back(EpipolarDistancePx(*cell, Eigen::Vector2d(x, y), projector));
    }
  }
  fmt::print("sltk: {} pixels, epipolar distance median {:.3f}, 90 % {:.3f} px\n", distances.size(),
             Quantile(distances, 0.5), Quantile(distances, 0.9));
  ASSERT_GT(distances.size(), 100000U);
  EXPECT_LE(Quantile(distances, 0.5), 0.47);
}

}  // namespace
}  // namespace fringe_fusion
