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

/// Results of fitting one phase set to a row; status holds MaskReason values.
struct FitOut {
  float* cycles = nullptr;      ///< phase / 2 pi, 0..1
  float* variance = nullptr;    ///< of cycles
  float* offset = nullptr;      ///< A [DN]
  float* modulation = nullptr;  ///< B [DN]
  std::int32_t* status = nullptr;
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

/// The estimate of a row before and after one more phase set. Coordinates in projector px.
struct NestArgs {
  const float* cycles = nullptr;
  const float* variance = nullptr;  ///< of cycles
  float period_px = 0.0F;
  float period_before_px = 0.0F;  ///< of the set before
  bool open = false;              ///< first set, covers the whole axis
  bool interval = false;          ///< first set, after a Gray code: half_px counts
  float phase_error = 0.0F;       ///< systematic error of a phase [cycles]
  float max_order_error = 0.5F;   ///< [fringes]
  float max_level_sigma = 0.0F;   ///< largest disagreement of two sets [sigma]
  const float* half_px = nullptr;
  float* coordinate_px = nullptr;
  float* variance_px2 = nullptr;
  float* log_odds = nullptr;  ///< least log odds of the chosen order against the next one
  std::int32_t* status = nullptr;
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

struct Kernels {
  const char* name = "";
  void (*bytes_to_float)(const std::uint8_t* in, float* out, int count) = nullptr;
  void (*words_to_float)(const std::uint16_t* in, float* out, int count) = nullptr;
  /// Lower and raise `low` and `high` to take in the row.
  void (*extend_range)(const float* in, float* low, float* high, int count) = nullptr;
  void (*fit_three)(const FitArgs& args, const FitOut& out, int count) = nullptr;
  void (*fit_four)(const FitArgs& args, const FitOut& out, int count) = nullptr;
  void (*fit_weighted)(const FitArgs& args, const FitOut& out, int count) = nullptr;
  void (*nest)(const NestArgs& args, int count) = nullptr;
  void (*joint_cost)(const JointArgs& args) = nullptr;
};

[[nodiscard]] const Kernels& PortableKernels();
/// The AVX2 kernels, or the portable ones where the processor lacks AVX2.
[[nodiscard]] const Kernels& BestKernels();

}  // namespace fringe_fusion::decode
