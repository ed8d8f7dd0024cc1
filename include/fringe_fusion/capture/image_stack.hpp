#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"

namespace fringe_fusion {

/// Grey values as the sensor gave them.
using FramePixels = std::variant<Image<std::uint8_t>, Image<std::uint16_t>>;

/// One exposure.
struct CapturedFrame {
  FramePixels pixels;
  int bit_depth = 8;          ///< full scale is 2^bit_depth - 1 grey values [DN]
  std::int64_t stamp_ns = 0;  ///< middle of the exposure
  double exposure_s = 0.0;    ///< 0 if unknown
  double gain = 1.0;
};

[[nodiscard]] int Width(const CapturedFrame& frame);
[[nodiscard]] int Height(const CapturedFrame& frame);

/// The frames of one view; frames[i] shows sequence.frames[i].
struct ImageStack {
  std::string scan_id;
  int view_id = 0;
  std::string camera_id;
  PatternSequence sequence;
  std::vector<CapturedFrame> frames;
  std::optional<Image<Rgb8>> color;  ///< of a colour camera, same size as the frames
};

/// Checks the frame count against the sequence, equal sizes, equal bit depths and rising stamps.
/// @param owner names the source, e.g. "views/003".
[[nodiscard]] Status Validate(const ImageStack& stack, const std::string& owner);

}  // namespace fringe_fusion
