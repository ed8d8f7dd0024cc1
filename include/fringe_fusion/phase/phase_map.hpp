#pragma once

#include <cstdint>
#include <string>

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/common/progress.hpp"

namespace fringe_fusion {

/// Why a pixel carries no projector coordinate. Written as mask.png; 0 is valid.
enum class MaskReason : std::uint8_t {
  kValid = 0,
  kTooDark = 1,
  kLowModulation = 2,
  kSaturated = 3,
  kEdge = 4,
  kResidual = 5,
  kDoubtfulOrder = 6,
  kOutsideProjector = 7,
  kShadow = 8,
  kEpipolar = 9,     ///< both coordinates decoded, but they miss the epipolar line (triangulation)
  kOutOfRange = 10,  ///< no point within the range limits on the camera ray (triangulation)
  kIsolated = 11,    ///< part of a speck of a few pixels (triangulation)
  kMerged = 12,      ///< counted in another pixel of the same projector cell (Gray code alone)
};
constexpr int kNumMaskReasons = 13;

/// Lower-case words of a reason, e.g. "low modulation"; "unknown" outside the enumeration.
[[nodiscard]] const char* MaskReasonName(MaskReason reason);

/// Projector coordinates seen by every camera pixel. Invalid pixels are NaN with a reason.
struct PhaseMap {
  int width = 0;
  int height = 0;
  Image<float> u;        ///< projector column [px]; empty if the u axis was not coded
  Image<float> v;        ///< projector row [px]; empty if the v axis was not coded
  Image<float> sigma_u;  ///< standard deviation of u [px]
  Image<float> sigma_v;
  Image<float> offset;       ///< mean grey value A [DN]
  Image<float> modulation;   ///< fringe amplitude B of the finest set, the lesser axis [DN];
                             ///< Gray code alone: half the difference of lit and dark
  Image<std::uint8_t> mask;  ///< MaskReason
  Image<float> order_error;  ///< probability that the fringe order is wrong, the greater of both
                             ///< axes; empty unless config.report_order_error
  bool relative_u = false;   ///< u was unwrapped over the image: every connected surface is off by
                             ///< an unknown multiple of the fringe period
  bool relative_v = false;
  Image<Rgb8> color;  ///< texture of the white frame, or A + B as grey
  std::int64_t first_stamp_ns = 0;
  std::int64_t last_stamp_ns = 0;
};

/// Decoder settings. Sensor noise: sigma_I^2 = read_noise_dn^2 + gain_dn I + 1/12 [DN^2].
struct PhaseConfig {
  double read_noise_dn = 1.0;
  double gain_dn = 0.05;
  double min_modulation_sigma = 5.0;    ///< least B in units of sigma_I
  double min_contrast_dn = 4.0;         ///< least white minus black [DN]
  double saturation_ratio = 0.98;       ///< of full scale
  double max_residual_sigma = 6.0;      ///< largest rms residual of the sinusoid fit in sigma_I
  double max_harmonic_ratio = 0.3;      ///< tolerated rms of gamma harmonics in that residual, of B
  double max_order_error_ratio = 0.35;  ///< largest distance to the nearest fringe order [fringes]
  double max_wrong_order_ratio = 1e-6;  ///< largest probability that the fringe order is wrong
  double max_level_sigma = 6.0;         ///< largest disagreement of two frequencies [sigma]
  double phase_error_rad = 0.02;        ///< systematic phase error left by the response of the cell
  bool report_order_error = false;      ///< fill PhaseMap::order_error
  double min_bit_sigma = 4.0;           ///< a Gray bit closer to its threshold is doubtful [sigma]
  double min_fine_bit_sigma = 1.5;      ///< the same where a misreading costs few cells
  int num_fine_bits = 2;                ///< finest bits that may be unreadable (Gray code alone)
  bool gray_one_per_cell = true;  ///< Gray code alone on both axes: one pixel per projector cell
  int gray_fit_radius_px = 2;     ///< Gray code alone, else: half window of local fit; 0: off
  double max_edge_step_px = 8.0;  ///< the same: largest jump between pixels of one local fit
  double max_bend_px = 0.5;       ///< an edge bends more: |a - 2 b + c| of u or v of three
                                  ///< neighbours [projector px]
  double max_bend_sigma = 5.0;    ///< and more than that [sigma of it]
  double max_bend_ratio = 0.5;    ///< and more than that of the slope between the neighbours
  bool mask_beside_dark = true;   ///< a pixel beside one without light counts as an edge

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("read_noise_dn", read_noise_dn, 0.0, 1000.0);
    field("gain_dn", gain_dn, 0.0, 1000.0);
    field("min_modulation_sigma", min_modulation_sigma, 0.0, 1000.0);
    field("min_contrast_dn", min_contrast_dn, 0.0, 65535.0);
    field("saturation_ratio", saturation_ratio, 0.1, 1.0);
    field("max_residual_sigma", max_residual_sigma, 1.0, 1000.0);
    field("max_harmonic_ratio", max_harmonic_ratio, 0.0, 10.0);
    field("max_order_error_ratio", max_order_error_ratio, 0.0, 0.5);
    field("max_wrong_order_ratio", max_wrong_order_ratio, 1e-12, 1.0);
    field("max_level_sigma", max_level_sigma, 1.0, 1e6);
    field("phase_error_rad", phase_error_rad, 0.0, 1.0);
    field("report_order_error", report_order_error);
    field("min_bit_sigma", min_bit_sigma, 0.0, 1000.0);
    field("min_fine_bit_sigma", min_fine_bit_sigma, 0.0, 1000.0);
    field("num_fine_bits", num_fine_bits, 0, 20);
    field("gray_one_per_cell", gray_one_per_cell);
    field("gray_fit_radius_px", gray_fit_radius_px, 0, 10);
    field("max_edge_step_px", max_edge_step_px, 0.1, 10000.0);
    field("max_bend_px", max_bend_px, 0.0, 10000.0);
    field("max_bend_sigma", max_bend_sigma, 0.0, 10000.0);
    field("max_bend_ratio", max_bend_ratio, 0.0, 10.0);
    field("mask_beside_dark", mask_beside_dark);
  }
};

/// Decodes one view: every pixel's projector coordinates with their standard deviation.
/// Frames may come in any order and at several exposures. A single frequency of several fringes is
/// unwrapped over the image, and the map is marked as relative.
/// @param recycled a map that is no longer needed: its memory is written anew where the size fits,
///        which saves the system handing out fresh pages view after view.
/// @return error when the stack does not fit its sequence, or codes no axis at all.
/// Ref: science sections 2.1 (N-step), 2.3 (unwrapping), 2.4 (inverse variance), 2.7 (exposures).
[[nodiscard]] Result<PhaseMap> DecodePhase(const ImageStack& stack, const PhaseConfig& config,
                                           const Progress& progress = NoProgress,
                                           PhaseMap recycled = {});

}  // namespace fringe_fusion
