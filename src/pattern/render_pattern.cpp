#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/constants.hpp"
#include "fringe_fusion/pattern/pattern_light.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"

namespace fringe_fusion {
namespace {

double GrayLight(const Pattern& pattern, int coordinate) {
  const double cell = (coordinate - pattern.offset_px + 0.5) / pattern.cell_px;
  const auto code = static_cast<unsigned>(std::max(0.0, std::floor(cell)));
  const bool on = (((code ^ (code >> 1U)) >> static_cast<unsigned>(pattern.bit)) & 1U) != 0U;
  return on != pattern.inverse ? 1.0 : 0.0;
}

double FringeLight(const Pattern& pattern, int coordinate, int size) {
  const double phase =
      pattern.phase_sign *
      (2.0 * kPi * pattern.fringes * (coordinate + 0.5) / size + pattern.phase_offset_rad);
  return 0.5 + 0.5 * std::cos(phase - 2.0 * kPi * pattern.step / pattern.steps);
}

// Light of one pattern at one coordinate of its axis, 0..1, before gamma correction.
double Light(const Pattern& pattern, int coordinate, int size) {
  switch (pattern.kind) {
    case PatternKind::kWhite:
      return 1.0;
    case PatternKind::kBlack:
      return 0.0;
    case PatternKind::kGray:
      return GrayLight(pattern, coordinate);
    case PatternKind::kPhase:
    case PatternKind::kMicro:
      return FringeLight(pattern, coordinate, size);
  }
  return 0.0;
}

// Light of the carrier at one coordinate of the other axis, 0..1.
double CarrierLight(const Pattern& pattern, int coordinate) {
  if (pattern.kind != PatternKind::kPhase || pattern.carrier_steps == 0) return 1.0;
  const double phase = 2.0 * kPi * (coordinate + 0.5) / pattern.carrier_period_px;
  return 0.5 + 0.5 * std::cos(phase - 2.0 * kPi * pattern.carrier_step / pattern.carrier_steps);
}

/// A picture is the product of a line along the axis of its pattern and one across.
template <typename Pixel, typename ToPixel>
Image<Pixel> Render(const Pattern& pattern, int width, int height, double power,
                    const ToPixel& to_pixel) {
  Image<Pixel> picture(width, height);
  const bool along_u = pattern.axis == Axis::kU;
  const int size = along_u ? width : height;
  const int across = along_u ? height : width;
  std::vector<double> light(static_cast<std::size_t>(size));
  std::vector<double> carrier(static_cast<std::size_t>(across));
  // A product of powers is the power of the product.
  for (int i = 0; i < size; ++i) {
    light[static_cast<std::size_t>(i)] = std::pow(Light(pattern, i, size), power);
  }
  for (int i = 0; i < across; ++i) {
    carrier[static_cast<std::size_t>(i)] = std::pow(CarrierLight(pattern, i), power);
  }
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      picture(x, y) = to_pixel(light[static_cast<std::size_t>(along_u ? x : y)] *
                               carrier[static_cast<std::size_t>(along_u ? y : x)]);
    }
  }
  return picture;
}

}  // namespace

Image<std::uint8_t> RenderPattern(const Pattern& pattern, int width, int height, double gamma) {
  return Render<std::uint8_t>(pattern, width, height, 1.0 / gamma, [](double value) {
    return static_cast<std::uint8_t>(std::lround(255.0 * value));
  });
}

Image<float> PatternLight(const Pattern& pattern, int width, int height) {
  return Render<float>(pattern, width, height, 1.0,
                       [](double light) { return static_cast<float>(light); });
}

}  // namespace fringe_fusion
