#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

enum class PatternKind { kWhite, kBlack, kGray, kPhase };
enum class Axis { kU, kV };

/// One projected picture. Only the fields of its kind matter.
struct Pattern {
  PatternKind kind = PatternKind::kWhite;
  Axis axis = Axis::kU;

  // Gray code: bit `bit` (0 = finest) of the binary-reflected code of
  // floor((coordinate - offset_px + 1/2) / cell_px); decoded u = cell_px (code + 1/2) - 1/2 +
  // offset_px.
  int bit = 0;
  bool inverse = false;
  int cell_px = 1;
  double offset_px = 0.0;

  // Phase shift: I = A + B cos(phase_sign (2 pi fringes (u + 1/2) / size + phase_offset_rad)
  //                          - 2 pi step / steps).
  double fringes = 0.0;
  int step = 0;
  int steps = 0;
  double phase_sign = 1.0;
  double phase_offset_rad = 0.0;
};

/// The ordered frames of one scan for a projector of width x height pixels. File: patterns.yaml.
struct PatternSequence {
  int width = 0;
  int height = 0;
  std::vector<Pattern> frames;
};

/// What to project: Gray code and N-step phase shift on several frequencies, with white and black.
struct PatternConfig {
  bool axis_u = true;
  bool axis_v = true;
  bool gray = false;               ///< Gray code with inverses on every axis
  std::string fringes = "1,8,64";  ///< fringes over the size of the axis, rising
  int steps = 4;                   ///< phase steps per frequency
  double gamma = 1.0;              ///< projector gamma to be undone in the pattern

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("axis_u", axis_u);
    field("axis_v", axis_v);
    field("gray", gray);
    field("fringes", fringes);
    field("steps", steps, 3, 64);
    field("gamma", gamma, 0.2, 5.0);
  }
};

/// Short name for file names and messages, e.g. "phase_u_f64_2of4", "gray_v_b10_inv".
[[nodiscard]] std::string PatternName(const Pattern& pattern);

/// Checks sizes, bits, steps and that every started phase set and Gray code is complete.
[[nodiscard]] Status Validate(const PatternSequence& sequence, const std::string& owner);

/// Builds the sequence white, black, then per axis the Gray bits and the phase sets.
[[nodiscard]] Result<PatternSequence> MakeSequence(const PatternConfig& config, int width,
                                                   int height);

/// The 8-bit picture of one pattern, `width` x `height`, with gamma undone: 255 (I/255)^(1/gamma).
[[nodiscard]] Image<std::uint8_t> RenderPattern(const Pattern& pattern, int width, int height,
                                                double gamma);

}  // namespace fringe_fusion
