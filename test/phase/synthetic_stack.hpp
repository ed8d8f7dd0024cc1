#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <random>

#include "fringe_fusion/capture/image_stack.hpp"

namespace fringe_fusion::test {

/// A camera picture of a surface whose projector coordinates are known in every pixel. Grey values
/// follow the formulas documented at Pattern, with cell_px, offset_px, sign and offset.
struct SyntheticScene {
  int width = 64;
  int height = 48;
  int bit_depth = 8;
  double dark_dn = 20.0;
  double bright_dn = 180.0;
  double read_noise_dn = 0.0;
  double gain_dn = 0.0;
  double indirect_dn = 0.0;  ///< light from elsewhere under a white picture
  double gamma = 1.0;        ///< light that arrives: light sent ^ gamma
  unsigned seed = 1;
  std::function<double(int, int)> u = [](int x, int y) { return 20.3 + 0.61 * x + 0.07 * y; };
  std::function<double(int, int)> v = [](int x, int y) { return 30.1 - 0.05 * x + 0.57 * y; };
};

inline double SyntheticLight(const Pattern& p, double coordinate, int size) {
  switch (p.kind) {
    case PatternKind::kWhite:
      return 1.0;
    case PatternKind::kBlack:
      return 0.0;
    case PatternKind::kGray: {
      const auto code =
          static_cast<std::int64_t>(std::floor((coordinate - p.offset_px + 0.5) / p.cell_px));
      const bool on = (((code ^ (code >> 1)) >> p.bit) & 1) != 0;
      return on != p.inverse ? 1.0 : 0.0;
    }
    case PatternKind::kPhase:
    case PatternKind::kMicro:
      return 0.5 +
             0.5 * std::cos(p.phase_sign * (2.0 * M_PI * p.fringes * (coordinate + 0.5) / size +
                                            p.phase_offset_rad) -
                            2.0 * M_PI * p.step / p.steps);
  }
  return 0.0;
}

inline double SyntheticCarrier(const Pattern& p, double across) {
  if (p.kind != PatternKind::kPhase || p.carrier_steps == 0) return 1.0;
  return 0.5 + 0.5 * std::cos(2.0 * M_PI * (across + 0.5) / p.carrier_period_px -
                              2.0 * M_PI * p.carrier_step / p.carrier_steps);
}

inline ImageStack Synthesize(const PatternSequence& sequence, const SyntheticScene& scene) {
  std::mt19937 engine(scene.seed);
  std::normal_distribution<double> unit;
  const double full_scale = (1 << scene.bit_depth) - 1;
  ImageStack stack;
  stack.sequence = sequence;
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const Pattern& pattern = sequence.frames[i];
    Image<std::uint16_t> words(scene.width, scene.height);
    for (int y = 0; y < scene.height; ++y) {
      for (int x = 0; x < scene.width; ++x) {
        const bool along_u = pattern.axis == Axis::kU;
        const double along = along_u ? scene.u(x, y) : scene.v(x, y);
        const double across = along_u ? scene.v(x, y) : scene.u(x, y);
        const double carrier = SyntheticCarrier(pattern, across);
        const double light =
            std::pow(SyntheticLight(pattern, along, along_u ? sequence.width : sequence.height),
                     scene.gamma);
        // Indirect light comes from so far around that it sees the mean of the carrier.
        const double direct = scene.bright_dn - scene.dark_dn;
        const double mean = carrier == 1.0 ? 1.0 : 0.5;
        double grey = scene.dark_dn + direct * light * carrier + scene.indirect_dn * mean * 0.5;
        grey *= pattern.exposure_ratio;
        const double variance = scene.read_noise_dn * scene.read_noise_dn + scene.gain_dn * grey;
        if (variance > 0.0) grey += std::sqrt(variance) * unit(engine);
        words(x, y) =
            static_cast<std::uint16_t>(std::lround(std::min(std::max(grey, 0.0), full_scale)));
      }
    }
    CapturedFrame frame;
    frame.bit_depth = scene.bit_depth;
    frame.stamp_ns = 1000 + static_cast<std::int64_t>(i);
    if (scene.bit_depth <= 8) {
      Image<std::uint8_t> bytes(scene.width, scene.height);
      for (std::size_t k = 0; k < bytes.size(); ++k) {
        bytes[k] = static_cast<std::uint8_t>(words[k]);
      }
      frame.pixels = bytes;
    } else {
      frame.pixels = words;
    }
    stack.frames.push_back(frame);
  }
  return stack;
}

/// A sequence for a 128 x 96 projector.
inline PatternSequence MakeTestSequence(bool gray, const std::string& fringes, int steps) {
  PatternConfig config;
  config.gray = gray;
  config.fringes = fringes;
  config.steps = steps;
  return MakeSequence(config, 128, 96).value();
}

}  // namespace fringe_fusion::test
