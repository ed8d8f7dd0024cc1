#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <utility>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/phase/phase_map.hpp"
#include "synthetic_stack.hpp"

namespace fringe_fusion {
namespace {

using test::MakeTestSequence;
using test::Synthesize;
using test::SyntheticScene;

struct ErrorFigures {
  int num_valid = 0;
  double rms_px = 0.0;
  double max_px = 0.0;
  double rms_normalized = 0.0;  // of error / sigma
};

ErrorFigures Compare(const Image<float>& value, const Image<float>& sigma,
                     const std::function<double(int, int)>& truth) {
  ErrorFigures out;
  for (int y = 0; y < value.height(); ++y) {
    for (int x = 0; x < value.width(); ++x) {
      if (!std::isfinite(value(x, y))) continue;
      const double error = static_cast<double>(value(x, y)) - truth(x, y);
      const double normalized = error / static_cast<double>(sigma(x, y));
      ++out.num_valid;
      out.rms_px += error * error;
      out.rms_normalized += normalized * normalized;
      out.max_px = std::max(out.max_px, std::abs(error));
    }
  }
  out.rms_px = std::sqrt(out.rms_px / out.num_valid);
  out.rms_normalized = std::sqrt(out.rms_normalized / out.num_valid);
  return out;
}

int Count(const PhaseMap& map, MaskReason reason) {
  return static_cast<int>(
      std::count(map.mask.begin(), map.mask.end(), static_cast<std::uint8_t>(reason)));
}

// 16-bit grey values leave nothing but float rounding.
SyntheticScene FineScene() {
  SyntheticScene scene;
  scene.bit_depth = 16;
  scene.dark_dn = 4000.0;
  scene.bright_dn = 60000.0;
  return scene;
}

PhaseConfig NoiseOf(const SyntheticScene& scene) {
  PhaseConfig config;
  config.read_noise_dn = scene.read_noise_dn;
  config.gain_dn = scene.gain_dn;
  return config;
}

TEST(DecodePhase, IsExactWithoutNoise) {
  const SyntheticScene scene = FineScene();
  const auto map = DecodePhase(Synthesize(MakeTestSequence(false, "1,4,16", 4), scene), {});
  ASSERT_TRUE(map.has_value()) << map.error().message;
  const ErrorFigures u = Compare(map->u, map->sigma_u, scene.u);
  const ErrorFigures v = Compare(map->v, map->sigma_v, scene.v);
  EXPECT_EQ(u.num_valid, scene.width * scene.height);
  EXPECT_LT(u.max_px, 1e-4);
  EXPECT_LT(v.max_px, 1e-4);
  EXPECT_NEAR(static_cast<double>(map->modulation(5, 7)), 28000.0, 1.0);
  EXPECT_NEAR(static_cast<double>(map->offset(5, 7)), 32000.0, 1.0);
  EXPECT_EQ(map->first_stamp_ns, 1000);
  EXPECT_EQ(map->last_stamp_ns, 1000 + 25);
}

// Science 2.4: sigma_u = W / (2 pi) sigma_I / B sqrt(2 / sum N f^2), here with constant sigma_I.
TEST(DecodePhase, NoiseReachesTheBound) {
  SyntheticScene scene;
  scene.width = 160;
  scene.height = 120;
  scene.u = [](int x, int y) { return 5.3 + 0.61 * x + 0.07 * y; };
  scene.v = [](int x, int y) { return 10.1 - 0.05 * x + 0.57 * y; };
  scene.read_noise_dn = 2.0;
  const auto map =
      DecodePhase(Synthesize(MakeTestSequence(false, "1,4,16", 4), scene), NoiseOf(scene));
  ASSERT_TRUE(map.has_value()) << map.error().message;
  const double sigma_dn = std::sqrt(4.0 + 1.0 / 12.0);
  const double bound_px =
      128.0 / (2.0 * M_PI) * sigma_dn / 80.0 * std::sqrt(2.0 / (4.0 * (1.0 + 16.0 + 256.0)));
  const ErrorFigures u = Compare(map->u, map->sigma_u, scene.u);
  EXPECT_GT(u.num_valid, scene.width * scene.height * 99 / 100);
  EXPECT_NEAR(u.rms_px / bound_px, 1.0, 0.05);
  EXPECT_NEAR(u.rms_normalized, 1.0, 0.05);
  EXPECT_NEAR(Compare(map->v, map->sigma_v, scene.v).rms_normalized, 1.0, 0.05);
}

TEST(DecodePhase, PredictsShotNoiseAtTwelveBit) {
  SyntheticScene scene = FineScene();
  scene.bit_depth = 12;
  scene.dark_dn = 200.0;
  scene.bright_dn = 3200.0;
  scene.read_noise_dn = 6.0;
  scene.gain_dn = 0.8;
  const auto map =
      DecodePhase(Synthesize(MakeTestSequence(false, "1,8", 5), scene), NoiseOf(scene));
  ASSERT_TRUE(map.has_value()) << map.error().message;
  EXPECT_NEAR(Compare(map->u, map->sigma_u, scene.u).rms_normalized, 1.0, 0.05);
}

TEST(DecodePhase, OrderOfFramesDoesNotMatter) {
  const SyntheticScene scene = FineScene();
  const ImageStack stack = Synthesize(MakeTestSequence(true, "1,4,16", 4), scene);
  ImageStack shuffled = stack;
  std::reverse(shuffled.frames.begin(), shuffled.frames.end());
  std::reverse(shuffled.sequence.frames.begin(), shuffled.sequence.frames.end());
  for (std::size_t i = 0; i < shuffled.frames.size(); ++i) {
    shuffled.frames[i].stamp_ns = static_cast<std::int64_t>(i);
  }
  const auto a = DecodePhase(stack, {});
  const auto b = DecodePhase(shuffled, {});
  ASSERT_TRUE(a.has_value() && b.has_value());
  EXPECT_TRUE(std::equal(a->u.begin(), a->u.end(), b->u.begin()));
  EXPECT_TRUE(std::equal(a->v.begin(), a->v.end(), b->v.begin()));
}

TEST(DecodePhase, UndoesSignAndOffset) {
  const SyntheticScene scene = FineScene();
  PatternSequence sequence = MakeTestSequence(false, "1,4,16", 4);
  for (Pattern& pattern : sequence.frames) {
    pattern.phase_sign = -1.0;
    pattern.phase_offset_rad = 0.7;
  }
  const auto map = DecodePhase(Synthesize(sequence, scene), {});
  ASSERT_TRUE(map.has_value()) << map.error().message;
  EXPECT_LT(Compare(map->u, map->sigma_u, scene.u).max_px, 1e-4);
}

// Pixels near the border of the projector: the set of one fringe jumps there by the whole width.
TEST(DecodePhase, DoesNotWrapAtTheBorderOfTheProjector) {
  SyntheticScene scene;
  scene.read_noise_dn = 2.0;
  scene.u = [](int x, int /*y*/) { return x < 32 ? -0.2 + 0.1 * x : 127.2 - 0.1 * (x - 32); };
  const auto map =
      DecodePhase(Synthesize(MakeTestSequence(false, "1,4,16", 4), scene), NoiseOf(scene));
  ASSERT_TRUE(map.has_value()) << map.error().message;
  const ErrorFigures u = Compare(map->u, map->sigma_u, scene.u);
  EXPECT_GT(u.num_valid, scene.width * scene.height * 9 / 10);
  EXPECT_LT(u.max_px, 1.0);
}

TEST(DecodePhase, OneAxisAlone) {
  PatternConfig pattern;
  pattern.axis_v = false;
  pattern.fringes = "1,16";
  const PatternSequence sequence = MakeSequence(pattern, 128, 96).value();
  const SyntheticScene scene = FineScene();
  const auto map = DecodePhase(Synthesize(sequence, scene), {});
  ASSERT_TRUE(map.has_value()) << map.error().message;
  EXPECT_TRUE(map->v.empty());
  EXPECT_TRUE(map->sigma_v.empty());
  EXPECT_LT(Compare(map->u, map->sigma_u, scene.u).max_px, 1e-4);
}

TEST(DecodePhase, GrayCodeGivesCells) {
  const SyntheticScene scene;
  PhaseConfig config;
  config.gray_one_per_cell = false;
  config.gray_fit_radius_px = 0;
  for (const bool with_inverse : {true, false}) {
    PatternSequence sequence = MakeTestSequence(true, "", 4);
    if (!with_inverse) {
      auto& frames = sequence.frames;
      frames.erase(
          std::remove_if(frames.begin(), frames.end(), [](const Pattern& p) { return p.inverse; }),
          frames.end());
    }
    const auto map = DecodePhase(Synthesize(sequence, scene), config);
    ASSERT_TRUE(map.has_value()) << map.error().message;
    const ErrorFigures u = Compare(map->u, map->sigma_u, scene.u);
    EXPECT_EQ(u.num_valid, scene.width * scene.height);
    EXPECT_LE(u.max_px, 0.5 + 1e-5);
    EXPECT_NEAR(u.rms_normalized, 1.0, 0.03);
    EXPECT_FLOAT_EQ(map->sigma_u(3, 3), 1.0F / std::sqrt(12.0F));
  }
}

TEST(DecodePhase, GrayCodeWithCellsOffsetAndNoWhiteOrBlack) {
  SyntheticScene scene;
  PatternSequence sequence;
  sequence.width = 128;
  sequence.height = 96;
  for (int bit = 0; bit < 6; ++bit) {
    Pattern pattern;
    pattern.kind = PatternKind::kGray;
    pattern.bit = bit;
    pattern.cell_px = 2;
    pattern.offset_px = -1.0;
    sequence.frames.push_back(pattern);
  }
  PhaseConfig config;
  config.gray_one_per_cell = false;
  config.gray_fit_radius_px = 0;
  const auto map = DecodePhase(Synthesize(sequence, scene), config);
  ASSERT_TRUE(map.has_value()) << map.error().message;
  const ErrorFigures u = Compare(map->u, map->sigma_u, scene.u);
  EXPECT_EQ(u.num_valid, scene.width * scene.height);
  EXPECT_LE(u.max_px, 1.0 + 1e-5);
  EXPECT_NEAR(u.rms_normalized, 1.0, 0.05);
}

// Both ways to take the rounding out: better than the 0.289 px of a cell, and sigma says so.
TEST(DecodePhase, RefinedGrayCodeKeepsItsPromise) {
  SyntheticScene scene;
  scene.width = 120;
  scene.height = 90;
  scene.read_noise_dn = 1.0;
  for (const bool one_per_cell : {true, false}) {
    PhaseConfig config = NoiseOf(scene);
    config.gray_one_per_cell = one_per_cell;
    const auto map = DecodePhase(Synthesize(MakeTestSequence(true, "", 4), scene), config);
    ASSERT_TRUE(map.has_value()) << map.error().message;
    for (const bool along_u : {true, false}) {
      const ErrorFigures figures =
          along_u ? Compare(map->u, map->sigma_u, scene.u) : Compare(map->v, map->sigma_v, scene.v);
      EXPECT_LT(figures.rms_px, one_per_cell ? 0.2 : 0.1);
      EXPECT_GT(figures.rms_normalized, one_per_cell ? 0.4 : 0.2);
      EXPECT_LT(figures.rms_normalized, 1.3);
      // 0.61 x 0.57 cells per pixel.
      const int num_cells = static_cast<int>(0.61 * 0.57 * scene.width * scene.height);
      EXPECT_GT(figures.num_valid,
                one_per_cell ? num_cells * 9 / 10 : scene.width * scene.height - 1);
    }
    EXPECT_EQ(Count(*map, MaskReason::kMerged) > 0, one_per_cell);
  }
}

// At these slopes the window takes out very different shares of the rounding.
TEST(DecodePhase, SigmaOfTheLocalFitFollowsTheSlope) {
  PhaseConfig config;
  config.gray_one_per_cell = false;
  for (const auto& [along, across] :
       {std::pair<double, double>{0.5, 0.1}, {0.45, 0.25}, {0.35, 0.03}, {0.61, 0.0}}) {
    double squares = 0.0;
    constexpr int kNumStarts = 7;  // simple slopes meet few places between the cells at a time
    for (int k = 0; k < kNumStarts; ++k) {
      SyntheticScene scene;
      scene.width = 60;
      scene.height = 45;
      const double slope_x = along;
      const double slope_y = across;
      const double start = 20.3 + 0.6180339887 * k;
      scene.u = [=](int x, int y) { return start + slope_x * x + slope_y * y; };
      const auto map = DecodePhase(Synthesize(MakeTestSequence(true, "", 4), scene), config);
      ASSERT_TRUE(map.has_value()) << map.error().message;
      squares += std::pow(Compare(map->u, map->sigma_u, scene.u).rms_normalized, 2);
    }
    const double ratio = std::sqrt(squares / kNumStarts);
    EXPECT_GT(ratio, 0.7) << along;
    EXPECT_LT(ratio, 1.3) << along;
  }
}

TEST(DecodePhase, GrayCodeUnwrapsFringes) {
  SyntheticScene scene;
  scene.read_noise_dn = 2.0;
  const auto map = DecodePhase(Synthesize(MakeTestSequence(true, "16", 4), scene), NoiseOf(scene));
  ASSERT_TRUE(map.has_value()) << map.error().message;
  const ErrorFigures u = Compare(map->u, map->sigma_u, scene.u);
  EXPECT_EQ(u.num_valid, scene.width * scene.height);
  EXPECT_LT(u.max_px, 0.2);
  EXPECT_NEAR(u.rms_normalized, 1.0, 0.06);
}

// Cells of one period whose borders are the jumps of the phase: the usual, delicate hybrid.
TEST(DecodePhase, GrayCellsOfOnePeriodUnwrapFringes) {
  SyntheticScene scene;
  scene.read_noise_dn = 2.0;
  PatternSequence sequence = MakeTestSequence(false, "16", 4);
  for (int bit = 0; bit < 4; ++bit) {
    Pattern pattern;
    pattern.kind = PatternKind::kGray;
    pattern.bit = bit;
    pattern.cell_px = 8;
    sequence.frames.push_back(pattern);
    pattern.axis = Axis::kV;
    pattern.cell_px = 6;
    sequence.frames.push_back(pattern);
  }
  const auto map = DecodePhase(Synthesize(sequence, scene), NoiseOf(scene));
  ASSERT_TRUE(map.has_value()) << map.error().message;
  const ErrorFigures u = Compare(map->u, map->sigma_u, scene.u);
  // Within 5 sigma of a jump the order is open: some 3 % of a period on each axis.
  EXPECT_GT(u.num_valid, scene.width * scene.height * 93 / 100);
  EXPECT_LT(u.max_px, 0.5);
}

TEST(DecodePhase, NamesEveryReason) {
  SyntheticScene scene = FineScene();
  scene.bit_depth = 8;
  scene.dark_dn = 20.0;
  scene.bright_dn = 180.0;
  ImageStack stack = Synthesize(MakeTestSequence(false, "1,4,16", 4), scene);
  const auto paint = [&](int x0, auto&& grey) {
    for (std::size_t i = 0; i < stack.frames.size(); ++i) {
      auto& image = std::get<Image<std::uint8_t>>(stack.frames[i].pixels);
      for (int y = 0; y < scene.height; ++y) {
        for (int x = x0; x < x0 + 8; ++x) {
          image(x, y) = static_cast<std::uint8_t>(grey(static_cast<int>(i), image(x, y)));
        }
      }
    }
  };
  paint(0, [](int, int) { return 1; });                                     // nothing there
  paint(8, [](int, int) { return 60; });                                    // ambient light only
  paint(16, [](int i, int) { return i == 0 ? 180 : (i == 1 ? 20 : 90); });  // no fringes
  paint(24, [](int, int grey) { return std::min(255, 2 * grey); });         // overexposed
  paint(32, [](int i, int grey) {                                           // one bad frame
    return i != 11 ? grey : (grey < 110 ? grey + 125 : std::max(0, grey - 125));
  });
  PhaseConfig config;
  config.saturation_ratio = 1.0;
  const auto map = DecodePhase(stack, config);
  ASSERT_TRUE(map.has_value()) << map.error().message;
  const auto at = [&](int x) { return static_cast<MaskReason>(map->mask(x, 20)); };
  EXPECT_EQ(at(3), MaskReason::kTooDark);
  EXPECT_EQ(at(11), MaskReason::kShadow);
  EXPECT_EQ(at(19), MaskReason::kLowModulation);
  EXPECT_GT(Count(*map, MaskReason::kSaturated), 8 * scene.height / 2);
  EXPECT_GT(Count(*map, MaskReason::kResidual), 8 * scene.height / 2);
  EXPECT_EQ(at(60), MaskReason::kValid);
  for (int reason = 0; reason < kNumMaskReasons; ++reason) {
    EXPECT_STRNE(MaskReasonName(static_cast<MaskReason>(reason)), "unknown");
  }
}

TEST(DecodePhase, RefusesWhatItCannotDecode) {
  const SyntheticScene scene;
  const auto message = [](const Result<PhaseMap>& result) {
    return result ? std::string("no error") : result.error().message;
  };
  ImageStack stack = Synthesize(MakeTestSequence(false, "1,4", 4), scene);
  stack.frames.pop_back();
  EXPECT_NE(message(DecodePhase(stack, {})).find("frames"), std::string::npos);

  PatternSequence white;
  white.width = 128;
  white.height = 96;
  white.frames.resize(2);
  EXPECT_NE(message(DecodePhase(Synthesize(white, scene), {})).find("codes a projector axis"),
            std::string::npos);

  PhaseConfig config;
  config.read_noise_dn = std::nan("");
  EXPECT_NE(message(DecodePhase(Synthesize(MakeTestSequence(false, "1,4", 4), scene), config))
                .find("read_noise_dn"),
            std::string::npos);
  const auto cancel = [](const std::string&, double) { return false; };
  EXPECT_EQ(message(DecodePhase(Synthesize(MakeTestSequence(false, "1,4", 4), scene), {}, cancel)),
            kCancelled);
}

TEST(DecodePhase, WritesARecycledMapAnew) {
  SyntheticScene scene;
  scene.read_noise_dn = 3.0;
  PhaseConfig config;
  config.report_order_error = true;
  const ImageStack gray = Synthesize(MakeTestSequence(true, "", 4), scene);
  const ImageStack stack = Synthesize(MakeTestSequence(false, "1,4,16", 4), scene);
  const PhaseMap fresh = DecodePhase(stack, {}).value();
  PhaseMap old = DecodePhase(gray, config).value();
  const float* memory = old.u.data();
  const PhaseMap map = DecodePhase(stack, {}, NoProgress, std::move(old)).value();
  EXPECT_EQ(map.u.data(), memory);
  EXPECT_TRUE(map.order_error.empty());
  EXPECT_EQ(std::memcmp(map.u.data(), fresh.u.data(), fresh.u.size() * sizeof(float)), 0);
  EXPECT_EQ(std::memcmp(map.mask.data(), fresh.mask.data(), fresh.mask.size()), 0);
  EXPECT_EQ(map.first_stamp_ns, fresh.first_stamp_ns);
  scene.width = 80;
  const ImageStack wider = Synthesize(MakeTestSequence(false, "1,4,16", 4), scene);
  PhaseMap reused = map;
  const PhaseMap other = DecodePhase(wider, {}, NoProgress, std::move(reused)).value();
  EXPECT_EQ(other.u.width(), 80);
  // What was moved from has sizes and no pixels.
  EXPECT_TRUE(DecodePhase(stack, {}, NoProgress, std::move(reused)).has_value());  // NOLINT
}

TEST(DecodePhase, SameBytesOnAnyNumberOfThreads) {
  SyntheticScene scene;
  scene.read_noise_dn = 3.0;
  const ImageStack stack = Synthesize(MakeTestSequence(true, "1,4,16", 3), scene);
  std::vector<PhaseMap> maps;
  for (const int threads : {1, 2, 3}) {
    const ThreadLimit limit(threads);
    maps.push_back(DecodePhase(stack, {}).value());
  }
  for (std::size_t i = 1; i < maps.size(); ++i) {
    EXPECT_EQ(std::memcmp(maps[0].u.data(), maps[i].u.data(), maps[0].u.size() * sizeof(float)), 0);
    EXPECT_EQ(std::memcmp(maps[0].sigma_v.data(), maps[i].sigma_v.data(),
                          maps[0].u.size() * sizeof(float)),
              0);
    EXPECT_EQ(std::memcmp(maps[0].mask.data(), maps[i].mask.data(), maps[0].mask.size()), 0);
  }
}

}  // namespace
}  // namespace fringe_fusion
