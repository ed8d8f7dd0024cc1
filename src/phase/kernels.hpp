#pragma once

#include <cstdint>

namespace fringe_fusion::decode {

// The inner loops of the decoder over one image row. Each exists twice, compiled from the same
// source: for the baseline instruction set and for AVX2. Both do the same IEEE operations in the
// same order (no contraction to fused operations), so they give the same bytes.

/// Noise variance of one grey value I: floor_dn2 + gain_dn I [DN^2].
struct RowNoise {
  float floor_dn2 = 0.0F;  ///< read noise and quantisation
  float gain_dn = 0.0F;
};

/// When the fit of a pixel counts as good.
struct FitLimits {
  float saturation_dn = 0.0F;
  float min_modulation2 = 0.0F;  ///< least (B / sigma_I)^2
  float max_residual2 = 0.0F;    ///< largest chi^2 per degree of freedom of the residuals
  float harmonic2 = 0.0F;        ///< tolerated mean square of harmonics in them, of B^2
};

/// State of a pixel while it is decoded: the greatest one rules.
enum RowStatus : std::int32_t {
  kRowValid = 0,
  kRowOutside = 1,
  kRowResidual = 2,
  kRowDoubtfulOrder = 3,
  kRowLowModulation = 4,
  kRowSaturated = 5,
};

/// Results of fitting one phase set to a row.
struct FitOut {
  float* cycles = nullptr;         ///< phase / 2 pi, 0..1
  float* variance = nullptr;       ///< of cycles
  float* offset = nullptr;         ///< A [DN]
  float* amplitude2 = nullptr;     ///< B^2 [DN^2]
  std::int32_t* status = nullptr;  ///< RowStatus
};

/// One phase set: I_n = exposure_n (A + B cos(phi - delta_n)), cycles = sign phi / 2 pi - offset.
struct FitArgs {
  const float* const* frames = nullptr;
  const float* cosines = nullptr;    ///< of delta_n
  const float* sines = nullptr;      ///< of delta_n
  const float* exposures = nullptr;  ///< relative to the reference group
  const int* places = nullptr;       ///< number of the distinct delta of each sample
  int num_samples = 0;
  int num_places = 0;
  float sign = 1.0F;
  float offset_cycles = 0.0F;
  RowNoise noise;
  FitLimits limits;
};

/// How one more phase set joins an estimate. Coordinates in projector px.
struct NestLevel {
  float period_px = 0.0F;
  float period_px2 = 0.0F;       ///< its square
  float inverse_period = 0.0F;   ///< [1/px]
  float inverse_period2 = 0.0F;  ///< its square
  float systematic2 = 0.0F;      ///< variance of systematic phase errors [fringes^2]
  float max_order_error = 0.5F;  ///< [fringes]
  float least_log_odds = 0.0F;   ///< of the chosen order against the next one
  float farthest2 = 0.0F;        ///< square of the largest disagreement of two sets [sigma^2]
};

/// The estimate of a row before and after one more phase set.
struct NestArgs {
  const float* cycles = nullptr;
  const float* variance = nullptr;  ///< of cycles
  NestLevel level;
  const float* half_px = nullptr;
  float* coordinate_px = nullptr;
  float* variance_px2 = nullptr;
  float* log_odds = nullptr;  ///< least log odds of all steps, or null when nobody asks
  std::int32_t* status = nullptr;
};

/// Where an axis ends.
struct AxisEnds {
  float size_px = 0.0F;
  float inverse_size = 0.0F;  ///< [1/px], 0 unless every phase repeats after exactly that size
  float margin2 = 0.0F;       ///< square of the least distance to the border [sigma^2]
};

/// End of one axis: coordinates beyond the projector are taken out.
struct FinishArgs {
  AxisEnds ends;
  float* coordinate_px = nullptr;
  const float* variance_px2 = nullptr;
  std::int32_t* status = nullptr;
};

/// One decoded axis as it goes into the phase map.
struct AxisInput {
  const float* coordinate_px = nullptr;
  const float* variance_px2 = nullptr;
  const float* offset = nullptr;
  const float* amplitude2 = nullptr;
  const std::int32_t* status = nullptr;
};

/// A stretch of a row of the phase map. Null: the axis is not coded, or the picture is not wanted.
struct MapRow {
  float* u_px = nullptr;
  float* v_px = nullptr;
  float* sigma_u_px = nullptr;
  float* sigma_v_px = nullptr;
  float* offset = nullptr;
  float* modulation = nullptr;
  std::uint8_t* mask = nullptr;
  std::uint8_t* rgb = nullptr;   ///< three bytes a pixel
  float* order_error = nullptr;  ///< probability
};

struct ComposeArgs {
  AxisInput u;
  AxisInput v;
  const std::int32_t* light = nullptr;  ///< MaskReason of a pixel without light, 0 elsewhere
  float* texture = nullptr;             ///< A + B, or null when nobody asks
  MapRow out;
};

/// Rows of bytes or of words.
struct RangeArgs {
  const void* const* rows = nullptr;
  int num_rows = 0;
  void* low = nullptr;
  void* high = nullptr;
};

/// Three or four even steps at one exposure fitted and nested into the estimate at once. The frames
/// are rows of bytes or of words without a saturated pixel; the other rows have whole vectors.
struct ClimbArgs {
  const void* frames[4] = {nullptr, nullptr, nullptr, nullptr};
  int num_steps = 0;
  bool is_first = false;  ///< no estimate yet: the set covers the whole axis
  float sign_px = 1.0F;   ///< coordinate = sign_px phase / (2 pi) - shift_px
  float shift_px = 0.0F;
  RowNoise noise;
  FitLimits limits;
  NestLevel level;
  float* coordinate_px = nullptr;
  float* variance_px2 = nullptr;
  std::int32_t* status = nullptr;
  float* offset = nullptr;  ///< or null when nobody asks
  float* amplitude2 = nullptr;
};

constexpr int kQuickGroup = 8;  ///< pixels that the quick kernels find good or doubtful together
constexpr int kQuickCoarseTerms = 4;  ///< of the angle's polynomial, error 8e-5 rad of the set
constexpr int kQuickTerms = 5;        ///< for the finest set, error 1.2e-5 rad

/// Four even steps of one set to differences of grey values, at most 13 bit: at least one vector.
struct SubtractArgs {
  const void* frames[4] = {nullptr, nullptr, nullptr, nullptr};
  bool is_first = false;             ///< first set of the axis
  std::int16_t* cosine = nullptr;    ///< I0 - I2
  std::int16_t* sine = nullptr;      ///< I1 - I3
  std::int16_t* largest = nullptr;   ///< greatest |I0 - I1 + I2 - I3| of all sets of the axis
  std::int16_t* contrast = nullptr;  ///< I0 - I1 + I2 - I3, null unless it is the finest set
  std::int16_t* sum = nullptr;       ///< of all four
};

/// Constants of one phase set, each in all lanes.
struct alignas(32) QuickLevel {
  float polynomial[kQuickTerms][kQuickGroup] = {};  ///< of atan / (2 pi) times the signed period
  float quarter_px[kQuickGroup] = {};               ///< a quarter of the signed period
  float eighth_px[kQuickGroup] = {};
  float shift_px[kQuickGroup] = {};
  float inverse_period[kQuickGroup] = {};  ///< [1/px]
  float period_px[kQuickGroup] = {};
  float weight[kQuickGroup] = {};  ///< square of its fringes over those of the finest
};

/// Conditions that suffice for a good pixel.
struct QuickLimits {
  float least_norm_per_noise = 0.0F;  ///< of 4 B^2 of any set, of 4 sigma_A^2
  float least_norm = 0.0F;            ///< of 4 B^2 [DN^2]
  float max_residual2 = 0.0F;         ///< as in FitLimits
  float harmonic2 = 0.0F;
  float max_deviation = 0.0F;                ///< of a set from the estimate before it [fringes]
  float agreed_deviation2 = 0.0F;            ///< the same, squared: this in any case
  float agreed_deviation2_per_noise = 0.0F;  ///< and this for every (4 sigma_A^2) / (4 B^2)
  float margin_sigma = 0.0F;                 ///< least distance to the border
};

/// Nested sets of four even steps of one axis, coarsest first, to rows of the phase map. At least
/// kQuickGroup pixels.
struct QuickArgs {
  /// Rows of SubtractArgs: cosine and sine of every set, then largest, contrast and sum.
  const std::int16_t* differences = nullptr;
  int stride = 0;
  int num_sets = 0;
  bool is_dark = false;  ///< only offset, modulation and picture are wanted
  const QuickLevel* levels = nullptr;
  RowNoise noise;
  QuickLimits limits;
  float variance_px2 = 0.0F;  ///< of a pixel with 4 sigma_A^2 = 4 B^2 in the finest set
  float size_px = 0.0F;
  float* coordinate_px = nullptr;
  float* sigma_px = nullptr;
  /// Rows 4 A and 4 B^2, written by the first axis and read by the second; null: one axis.
  float* other_axis = nullptr;
  float* offset = nullptr;  ///< null: the second axis writes it
  float* modulation = nullptr;
  std::uint8_t* rgb = nullptr;  ///< or null when nobody asks
  float full_scale = 0.0F;
  std::uint8_t* doubt = nullptr;  ///< [group] set where a pixel may be bad
};

/// Marks groups with too little light: white and black frame, bytes or words.
struct UnlitArgs {
  const void* white = nullptr;
  const void* black = nullptr;
  float least_dn = 0.0F;
  std::uint8_t* doubt = nullptr;  ///< [group]
};

/// Three neighbouring rows of a coordinate: above, here and below. Null: not coded.
struct EdgeAxis {
  const float* rows[3] = {nullptr, nullptr, nullptr};
  const float* sigma = nullptr;  ///< of the row here
};

/// Second differences along the row and across it: one bit per pixel where any exceeds both limits.
struct EdgeArgs {
  EdgeAxis u;
  EdgeAxis v;
  float max_bend_px = 0.0F;
  float max_bend_sigma = 0.0F;  ///< of the pixel
  float max_bend_ratio = 0.0F;  ///< of the difference of the two neighbours
  std::uint8_t* bits = nullptr;
};

/// Costs of all candidate orders of one pixel.
struct JointArgs {
  int num_sets = 0;                  ///< without the reference set
  int num_candidates = 0;            ///< multiple of 8
  const float* offsets = nullptr;    ///< [set][candidate] predicted cycles
  const float* residuals = nullptr;  ///< [set] measured cycles less the part of the reference set
  const float* weights = nullptr;    ///< [set] 1 / variance
  const float* ratios = nullptr;     ///< [set] fringes over those of the reference set
  float coupling = 0.0F;             ///< 1 / (1 / variance of the reference + sum ratio^2 weight)
  float* cost = nullptr;             ///< [candidate]
  float* scratch = nullptr;          ///< [candidate]
};

/// Grey values of a row lit and unlit.
struct LightArgs {
  const float* bright = nullptr;
  const float* dark = nullptr;
  float least = 0.0F;
  bool has_black = false;  ///< dark is the grey value of a black frame
  bool is_first = false;   ///< nothing is known from other exposures
  std::int32_t* light = nullptr;
};

struct Kernels {
  const char* name = "";
  void (*bytes_to_float)(const std::uint8_t* in, float* out, int count) = nullptr;
  void (*words_to_float)(const std::uint16_t* in, float* out, int count) = nullptr;
  /// Lowers and raises `low` and `high` to take in the row.
  void (*extend_range)(const float* in, float* low, float* high, int count) = nullptr;
  void (*climb_bytes)(const ClimbArgs& args, int count) = nullptr;
  void (*climb_words)(const ClimbArgs& args, int count) = nullptr;
  /// Least and greatest value of several rows; returns the greatest of all.
  std::int32_t (*range_bytes)(const RangeArgs& args, int count) = nullptr;
  std::int32_t (*range_words)(const RangeArgs& args, int count) = nullptr;
  /// Greatest value of several rows of bytes or words.
  std::int32_t (*peak_bytes)(const void* const* rows, int num_rows, int count) = nullptr;
  std::int32_t (*peak_words)(const void* const* rows, int num_rows, int count) = nullptr;
  void (*subtract_bytes)(const SubtractArgs& args, int count) = nullptr;
  void (*subtract_words)(const SubtractArgs& args, int count) = nullptr;
  void (*quick)(const QuickArgs& args, int count) = nullptr;
  void (*mark_unlit_bytes)(const UnlitArgs& args, int count) = nullptr;
  void (*mark_unlit_words)(const UnlitArgs& args, int count) = nullptr;
  /// Sets `light` to 0 where bright - dark reaches `least`, else to shadow where dark does twice,
  /// else to too dark.
  void (*check_light)(const LightArgs& args, int count) = nullptr;
  /// Each fit returns the greatest status of the row.
  std::int32_t (*fit_three)(const FitArgs& args, const FitOut& out, int count) = nullptr;
  std::int32_t (*fit_four)(const FitArgs& args, const FitOut& out, int count) = nullptr;
  std::int32_t (*fit_weighted)(const FitArgs& args, const FitOut& out, int count) = nullptr;
  /// Raises every status to at least that of `in`.
  void (*raise)(const std::int32_t* in, std::int32_t* status, int count) = nullptr;
  /// First set that covers the whole axis; first set after a Gray code; any other set.
  void (*nest_open)(const NestArgs& args, int count) = nullptr;
  void (*nest_interval)(const NestArgs& args, int count) = nullptr;
  void (*nest)(const NestArgs& args, int count) = nullptr;
  void (*joint_cost)(const JointArgs& args) = nullptr;
  void (*finish)(const FinishArgs& args, int count) = nullptr;
  void (*compose)(const ComposeArgs& args, int count) = nullptr;
  /// Grey picture of a row, three bytes a pixel.
  void (*to_rgb)(const float* grey, float full_scale, std::uint8_t* rgb, int count) = nullptr;
  /// Reason and no coordinates for pixels without light.
  void (*blank)(const std::int32_t* light, const MapRow& out, int count) = nullptr;
  void (*find_bends)(const EdgeArgs& args, int count) = nullptr;
};

[[nodiscard]] const Kernels& PortableKernels();
/// The AVX2 kernels, or the portable ones where the processor lacks AVX2.
[[nodiscard]] const Kernels& BestKernels();

}  // namespace fringe_fusion::decode
