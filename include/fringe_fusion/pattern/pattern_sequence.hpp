#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

/// kMicro: one frame of micro phase shifting. It looks like kPhase, but all frames of an axis form
/// one code: near-equal frequencies with one frame each, and one of them with three steps.
enum class PatternKind { kWhite, kBlack, kGray, kPhase, kMicro };
enum class Axis { kU, kV };

/// One projected picture. Only the fields of its kind matter.
struct Pattern {
  PatternKind kind = PatternKind::kWhite;
  Axis axis = Axis::kU;
  /// Exposure of this frame over that of the scan. The same code at several exposures is one code.
  double exposure_ratio = 1.0;

  // Gray code: bit `bit` (0 = finest) of the binary-reflected code of
  // floor((coordinate - offset_px + 1/2) / cell_px); decoded u = cell_px (code + 1/2) - 1/2 +
  // offset_px.
  int bit = 0;
  bool inverse = false;
  double cell_px = 1.0;
  double offset_px = 0.0;

  // Phase shift: I = A + B cos(phase_sign (2 pi fringes (u + 1/2) / size + phase_offset_rad)
  //                          - 2 pi step / steps).
  // Frames of one set may differ in phase_offset_rad: that makes the steps uneven.
  double fringes = 0.0;
  int step = 0;
  int steps = 0;
  double phase_sign = 1.0;
  double phase_offset_rad = 0.0;

  // Modulated phase shift: the picture times
  // 1/2 + 1/2 cos(2 pi (w + 1/2) / carrier_period_px - 2 pi carrier_step / carrier_steps) of the
  // other coordinate w. Separates direct from indirect light. carrier_steps 0: none.
  double carrier_period_px = 0.0;
  int carrier_step = 0;
  int carrier_steps = 0;
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
  bool gray = false;               ///< Gray code on every axis
  bool gray_inverse = true;        ///< each bit followed by its inverse
  bool gray_half_period = false;   ///< finest cell half a period of the first fringes, not 1 px
  std::string fringes = "1,8,64";  ///< fringes over the size of the axis, rising
  std::string periods_px = "";     ///< instead of fringes: periods [projector px], falling
  int steps = 4;                   ///< phase steps per frequency
  bool micro = false;              ///< micro phase shifting on these fringes, not `steps` of each
  double carrier_period_px = 0.0;  ///< modulated phase shift across the fringes; 0: none
  int carrier_steps = 3;           ///< steps of that carrier
  std::string exposures = "1";     ///< exposure ratios, every code once with each
  double gamma = 1.0;              ///< projector gamma to be undone in the pattern

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("axis_u", axis_u);
    field("axis_v", axis_v);
    field("gray", gray);
    field("gray_inverse", gray_inverse);
    field("gray_half_period", gray_half_period);
    field("fringes", fringes);
    field("periods_px", periods_px);
    field("steps", steps, 3, 64);
    field("micro", micro);
    field("carrier_period_px", carrier_period_px, 0.0, 10000.0);
    field("carrier_steps", carrier_steps, 3, 16);
    field("exposures", exposures);
    field("gamma", gamma, 0.2, 5.0);
  }
};

/// Short name for file names and messages, e.g. "phase_u_f64_2of4", "gray_v_b10_inv".
[[nodiscard]] std::string PatternName(const Pattern& pattern);

/// Checks sizes and the parameters of every frame; that every started phase set, micro and Gray
/// code is complete at every exposure; and that the code of each axis says where on the axis a
/// pixel lies. A single frequency of several fringes passes: it decodes to relative coordinates.
/// @param owner names the source in the message, e.g. "patterns.yaml".
/// @return error with the one thing that is wrong.
[[nodiscard]] Status Validate(const PatternSequence& sequence, const std::string& owner);

/// Builds the sequence white, black, then per axis the Gray bits and the phase sets.
/// @return error when a list cannot be read or the code would be refused by Validate.
[[nodiscard]] Result<PatternSequence> MakeSequence(const PatternConfig& config, int width,
                                                   int height);

/// The least distance, as a share of the axis, after which all of these fringes repeat together;
/// 1 where none is shorter than the axis. Coprime periods repeat after their product, fringes that
/// differ by 1 after the whole axis.
/// @param fringes over the axis, positive.
/// @param tolerance_ratio phases that come this close count as equal [fringes].
[[nodiscard]] double RepeatRatio(const std::vector<double>& fringes, double tolerance_ratio);

/// The 8-bit picture of one pattern, `width` x `height`, with gamma undone: 255 (I/255)^(1/gamma).
[[nodiscard]] Image<std::uint8_t> RenderPattern(const Pattern& pattern, int width, int height,
                                                double gamma);

}  // namespace fringe_fusion
