#pragma once

#include <cstdint>
#include <vector>

#include "axis_decoder.hpp"

namespace fringe_fusion::decode {

/// Decodes the common sequence, nested phase sets of three or four even steps at one exposure,
/// straight from the grey values. The result is that of FrameRows and AxisDecoder. Borrows the
/// stack; one object per thread.
class LadderDecoder {
 public:
  /// Whether the sequence is of that kind.
  [[nodiscard]] static bool Takes(const ImageStack& stack, const DecodeContext& context);

  /// @param stack that Takes() accepts.
  LadderDecoder(const ImageStack& stack, const DecodeContext& context);

  /// Finds bright() and dark() of `count` pixels of row y from column `begin` on.
  /// @return false where a pixel is saturated: steps have to be dropped.
  [[nodiscard]] bool ReadLight(int y, int begin, int count);
  /// Decodes `count` of these pixels from number `begin` on.
  void Climb(int begin, int count);

  /// The coded axes; u and v are the same where one is coded.
  [[nodiscard]] const AxisRow& u() const { return axes_.front().row; }
  [[nodiscard]] const AxisRow& v() const { return axes_.back().row; }
  /// What FrameRows says of the same name.
  [[nodiscard]] const float* bright() const { return bright_.data(); }
  [[nodiscard]] const float* dark() const { return dark_.data(); }

  /// Grey values as PixelsOf() gives them.
  void ToFloat(const void* grey, float* out, int count) const;

 private:
  struct Rung {
    std::vector<int> frames;
    ClimbArgs args;
  };
  struct Ladder {
    AxisRow row;
    std::vector<Rung> rungs;
    AxisEnds ends;
  };

  void AddAxis(const AxisPlan& plan);
  void FindPixels(int y, int begin);
  [[nodiscard]] bool FindRange(int count);
  void ClimbAxis(Ladder& ladder, int begin, int count);

  const ImageStack& stack_;
  DecodeContext context_;
  bool has_bytes_ = false;
  std::vector<Ladder> axes_;
  std::vector<const void*> frames_;  ///< grey values of every frame of the stack
  std::vector<int> phase_frames_;
  std::vector<const void*> phase_rows_;
  std::vector<std::uint16_t> low_;  ///< least grey value of every pixel, bytes or words
  std::vector<std::uint16_t> high_;
  std::vector<float> bright_;
  std::vector<float> dark_;
};

}  // namespace fringe_fusion::decode
