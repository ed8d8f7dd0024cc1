// Masks of the decoder on simulated scans with exact truth: how many of the valid pixels lie far
// from it, and how many of the truly good ones stay valid; both always together.
//   mask_study tuning|evaluation [scene]
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>

#include "bench/mask_scenes.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion::bench {
namespace {

constexpr double kFarSigma = 4.0;

/// Counts over scenes of one code.
struct Tally {
  long num_valid = 0;
  long num_far = 0;
  long num_far_bad = 0;      // far pixels that are not truly good
  long num_far_texture = 0;  // far pixels that are good and lie near texture
  long num_good = 0;
  long num_good_valid = 0;
  long num_smooth = 0;   // values u and v on good pixels without texture
  double squares = 0.0;  // of error / sigma of those
  std::array<long, kNumMaskReasons> lost{};

  void Add(const Tally& other) {
    num_valid += other.num_valid;
    num_far += other.num_far;
    num_far_bad += other.num_far_bad;
    num_far_texture += other.num_far_texture;
    num_good += other.num_good;
    num_good_valid += other.num_good_valid;
    num_smooth += other.num_smooth;
    squares += other.squares;
    for (std::size_t i = 0; i < lost.size(); ++i) lost[i] += other.lost[i];
  }
};

double Normalized(const Image<float>& value, const Image<float>& sigma, const Image<float>& truth,
                  int x, int y) {
  return static_cast<double>(value(x, y) - truth(x, y)) / static_cast<double>(sigma(x, y));
}

void CountValid(const PhaseMap& map, const sim::ViewTruth& truth, const GoodPixels& pixels, int x,
                int y, Tally& tally) {
  const bool good = pixels.IsGood(x, y);
  const double u = Normalized(map.u, map.sigma_u, truth.u, x, y);
  const double v = Normalized(map.v, map.sigma_v, truth.v, x, y);
  // A valid pixel where there is nothing to see (NaN) is far from the truth as well.
  const bool far = !(std::abs(u) <= kFarSigma && std::abs(v) <= kFarSigma) || truth.lit(x, y) == 0;
  const bool texture = good && pixels.HasTextureNear(x, y);
  ++tally.num_valid;
  if (good) ++tally.num_good_valid;
  if (far) ++tally.num_far;
  if (far && !good) ++tally.num_far_bad;
  if (far && texture) ++tally.num_far_texture;
  if (!good || texture) return;
  tally.num_smooth += 2;
  tally.squares += u * u + v * v;
}

Tally Judge(const MaskScene& scene) {
  sim::SimCell cell = MakeMaskCell(scene, scene.config);
  const sim::ViewTruth truth = cell.Truth();
  const CleanLight light = CaptureCleanLight(scene);
  PhaseConfig config;
  config.read_noise_dn = scene.config.read_noise_dn;
  config.gain_dn = scene.config.gain_dn;
  const Result<PhaseMap> map = DecodePhase(CaptureMaskScene(cell, scene), config);
  if (!map) throw std::runtime_error(map.error().message);
  const GoodPixels pixels(scene, truth, light);
  Tally tally;
  for (int y = 0; y < map->height; ++y) {
    for (int x = 0; x < map->width; ++x) {
      const bool good = pixels.IsGood(x, y);
      if (good) ++tally.num_good;
      const std::uint8_t reason = map->mask(x, y);
      if (reason == 0) CountValid(*map, truth, pixels, x, y, tally);
      if (reason != 0 && good) ++tally.lost[reason];
    }
  }
  return tally;
}

void Print(const std::string& name, const Tally& tally) {
  const auto percent = [](long part, long whole) {
    return 100.0 * static_cast<double>(part) / static_cast<double>(whole > 0 ? whole : 1);
  };
  fmt::print("| {:16} | {:9} | {:7.4f} | {:7.4f} | {:7.4f} | {:9} | {:6.2f} | {:6.3f} |", name,
             tally.num_valid, percent(tally.num_far, tally.num_valid),
             percent(tally.num_far_bad, tally.num_valid),
             percent(tally.num_far_texture, tally.num_valid), tally.num_good,
             percent(tally.num_good_valid, tally.num_good),
             std::sqrt(tally.squares / static_cast<double>(tally.num_smooth)));
  for (std::size_t i = 1; i < tally.lost.size(); ++i) {
    if (tally.lost[i] == 0) continue;
    fmt::print(" {} {:.2f} %", MaskReasonName(static_cast<MaskReason>(i)),
               percent(tally.lost[i], tally.num_good));
  }
  fmt::print("\n");
  std::fflush(stdout);
}

int Main(int argc, char** argv) {
  const std::string set = argc > 1 ? argv[1] : "";
  if (set != "tuning" && set != "evaluation") {
    std::fprintf(stderr, "usage: mask_study tuning|evaluation [scene]\n");
    return EXIT_FAILURE;
  }
  const bool tuning = set == "tuning";
  const int num_scenes = tuning ? kNumTuningScenes : kNumEvaluationScenes;
  const int only = argc > 2 ? std::atoi(argv[2]) : -1;
  fmt::print(
      "| scenes           | valid     | > 4 s % | not good| texture | good      | kept % | rms    "
      "| "
      "good pixels lost to\n");
  std::array<Tally, kNumMaskCodes> codes;
  Tally all;
  for (int i = 0; i < num_scenes; ++i) {
    if (only >= 0 && i != only) continue;
    const int code = i % kNumMaskCodes;
    const Tally tally = Judge(MakeMaskScene(tuning ? TuningSeed(i) : EvaluationSeed(i), code));
    Print(fmt::format("scene {}", i), tally);
    codes[static_cast<std::size_t>(code)].Add(tally);
    all.Add(tally);
  }
  for (std::size_t code = 0; code < codes.size(); ++code) Print(kMaskCodeNames[code], codes[code]);
  Print("all", all);
  return EXIT_SUCCESS;
}

}  // namespace
}  // namespace fringe_fusion::bench

int main(int argc, char** argv) {
  try {
    return fringe_fusion::bench::Main(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "mask_study: %s\n", error.what());
    return EXIT_FAILURE;
  }
}
