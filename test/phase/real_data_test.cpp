// Real captured stacks, read in place, held against what their authors published.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion {
namespace {

namespace fs = std::filesystem;

fs::path DataFolder() {
  const char* folder = std::getenv("FRINGE_FUSION_DATA");
  return folder != nullptr ? fs::path(folder) : fs::path(SOURCE_DIR "/../shared/data");
}

#define SKIP_WITHOUT_DATA(path) \
  if (!fs::exists(path)) GTEST_SKIP() << "skipped: no data at " << (path).string()

void AddFrame(const fs::path& file, const Pattern& pattern, ImageStack& stack) {
  const auto image = ReadGrayImage(file.string());
  ASSERT_TRUE(image) << image.error().message;
  CapturedFrame frame;
  frame.pixels = *image;
  frame.stamp_ns = static_cast<std::int64_t>(stack.frames.size());
  stack.frames.push_back(frame);
  stack.sequence.frames.push_back(pattern);
}

Pattern OfKind(PatternKind kind) {
  Pattern pattern;
  pattern.kind = kind;
  return pattern;
}

Pattern Gray(int bit, bool inverse) {
  Pattern pattern = OfKind(PatternKind::kGray);
  pattern.bit = bit;
  pattern.inverse = inverse;
  return pattern;
}

// gray_00 is white, gray_01 .. gray_11 are the bits, coarsest first.
TEST(RealStacks, NeuvisionCodesEqualThePublishedOnes) {
  const fs::path data = DataFolder() / "neuvision";
  SKIP_WITHOUT_DATA(data);
  ImageStack stack;
  stack.sequence.width = 2048;
  stack.sequence.height = 1080;
  AddFrame(data / "gray_00.png", OfKind(PatternKind::kWhite), stack);
  AddFrame(data / "gray_00_inv.png", OfKind(PatternKind::kBlack), stack);
  for (int i = 1; i <= 11; ++i) {
    AddFrame(data / fmt::format("gray_{:02d}.png", i), Gray(11 - i, false), stack);
    AddFrame(data / fmt::format("gray_{:02d}_inv.png", i), Gray(11 - i, true), stack);
  }
  ::setenv("OPENCV_IO_ENABLE_OPENEXR", "1", 1);
  const cv::Mat expected = cv::imread((data / "decoded.exr").string(), cv::IMREAD_UNCHANGED);
  if (expected.empty()) GTEST_SKIP() << "skipped: this OpenCV reads no OpenEXR";
  ASSERT_EQ(expected.type(), CV_32FC1);
  PhaseConfig config;
  config.gray_fit_radius_px = 0;
  config.max_edge_step_px = 10000.0;
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

// Six frames for the columns: three steps of 16 fringes, then three of 1 fringe.
TEST(RealStacks, SlstudioTwoFrequenciesDecode) {
  const fs::path data = DataFolder() / "slstudio/skull_2x3";
  SKIP_WITHOUT_DATA(data);
  ImageStack stack;
  stack.sequence.width = 1824;
  stack.sequence.height = 1140;
  for (int i = 0; i < 6; ++i) {
    Pattern pattern = OfKind(PatternKind::kPhase);
    pattern.fringes = i < 3 ? 16.0 : 1.0;
    pattern.step = i % 3;
    pattern.steps = 3;
    AddFrame(data / fmt::format("frameSeq_{:02d}.png", i), pattern, stack);
  }
  PhaseConfig config;
  config.max_wrong_order_ratio = 0.5;
  config.max_order_error_ratio = 0.5;
  config.max_level_sigma = 1e6;
  const auto map = DecodePhase(stack, config);
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

}  // namespace
}  // namespace fringe_fusion
