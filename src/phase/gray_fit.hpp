#pragma once

#include <cstdint>
#include <vector>

#include "frame_rows.hpp"

namespace fringe_fusion::decode {

/// The projector interval that a Gray code leaves open: centre_px +- half_px; NaN if doubtful.
struct GrayInterval {
  double centre_px = 0.0;
  double half_px = 0.0;
};

/// Reads Gray bits of a row and turns words into intervals. One object per thread.
///
/// Two neighbouring cells differ in one bit only. So a pixel on the border of two cells has one
/// doubtful bit, and its two readings are neighbours: the border is the answer. Doubtful finest
/// bits (blur) leave a coarser cell. Anything else has no answer.
class GrayFit {
 public:
  GrayFit(const GrayCode& code, const DecodeContext& context);

  void Run(const FrameRows& rows);

  /// For unwrapping fringes: every bit below config.min_bit_sigma is doubtful.
  [[nodiscard]] GrayInterval Interval(std::size_t x) const;
  /// For a Gray code alone. A misread bit between two neighbouring cells, or one of the
  /// config.num_fine_bits finest, costs few cells: config.min_fine_bit_sigma is enough for them.
  /// NaN also when more than config.num_fine_bits finest bits are doubtful.
  [[nodiscard]] GrayInterval Cell(std::size_t x) const;
  /// Half the mean difference of lit and unlit over the bits [DN].
  [[nodiscard]] float modulation_dn(std::size_t x) const { return modulation_[x]; }
  /// Mean grey value between lit and unlit [DN].
  [[nodiscard]] float offset_dn(std::size_t x) const { return offset_[x]; }
  [[nodiscard]] int num_bits() const { return static_cast<int>(code_.bits.size()); }

 private:
  [[nodiscard]] GrayInterval Resolve(std::uint32_t word, std::uint32_t doubtful,
                                     int max_skipped) const;
  [[nodiscard]] bool MisreadingIsCostly(std::uint32_t word, std::uint32_t bit) const;
  void AddPair(const FrameRows& rows, const GrayRead& read);
  void AddSingle(const FrameRows& rows, const GrayRead& read);
  void FinishBit(std::uint32_t flag);

  GrayCode code_;
  DecodeContext context_;
  std::vector<float> signal_;       ///< sum of exposure x difference / variance over the exposures
  std::vector<float> information_;  ///< sum of exposure^2 / variance
  std::vector<std::uint32_t> word_;
  std::vector<std::uint32_t> weak_;      ///< bits below min_bit_sigma
  std::vector<std::uint32_t> doubtful_;  ///< bits below min_fine_bit_sigma
  std::vector<float> modulation_;
  std::vector<float> offset_;
};

}  // namespace fringe_fusion::decode
