#pragma once

#include <cstdint>
#include <vector>

#include "axis_decoder.hpp"

namespace fringe_fusion::decode {

/// Decodes the commonest sequence, nested sets of four even steps at one exposure that begin with
/// one fringe, where pixels are surely good. The others are left to LadderDecoder. Borrows the
/// stack; one object per thread.
class QuickDecoder {
 public:
  /// Whether the sequence is of that kind and its limits leave anything to this decoder.
  [[nodiscard]] static bool Takes(const ImageStack& stack, const DecodeContext& context);

  /// @param stack that Takes() and LadderDecoder::Takes() accept.
  QuickDecoder(const ImageStack& stack, const DecodeContext& context);

  /// Decodes `count` pixels of row y from column `begin` on; all are written as valid.
  /// @return false where the stretch is too short or has a saturated pixel: nothing is decoded.
  [[nodiscard]] bool Run(int y, int begin, int count, const MapRow& out);

  /// Offset, modulation and picture only, for a stretch without light. The same return value.
  [[nodiscard]] bool RunDark(int y, int begin, int count, const MapRow& out);

  /// Whether the pixels of group i, from GroupBegin(i, count) on, may be bad.
  [[nodiscard]] bool IsDoubtful(int group) const {
    return doubt_[static_cast<std::size_t>(group)] != 0;
  }
  [[nodiscard]] static int NumGroups(int count) { return (count + kQuickGroup - 1) / kQuickGroup; }
  /// The last group of a stretch may overlap the one before.
  [[nodiscard]] static int GroupBegin(int group, int count) {
    return group * kQuickGroup < count - kQuickGroup ? group * kQuickGroup : count - kQuickGroup;
  }

 private:
  struct Ladder {
    std::vector<SubtractArgs> subtract;    ///< by set
    std::vector<std::vector<int>> frames;  ///< the same
    std::vector<QuickLevel> levels;
    std::vector<std::int16_t> rows;
    QuickArgs args;
  };

  void AddAxis(const AxisPlan& plan);
  void FindPixels(int y, int begin);
  [[nodiscard]] bool IsSaturated(int count) const;
  void DecodeAxes(int count, const MapRow& out, bool is_dark);
  void DecodeAxis(Ladder& ladder, int count, const MapRow& out, bool is_dark);
  void Subtract(Ladder& ladder, std::size_t first_set, int count);
  void MarkUnlit(int count);

  const ImageStack& stack_;
  DecodeContext context_;
  bool has_bytes_ = false;
  std::vector<Ladder> axes_;
  std::vector<const void*> frames_;  ///< grey values of every frame of the stack
  std::vector<int> phase_frames_;
  std::vector<const void*> phase_rows_;
  std::vector<float> other_axis_;
  std::vector<std::uint8_t> doubt_;
};

}  // namespace fringe_fusion::decode
