#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "axis_decoder.hpp"
#include "ladder_decoder.hpp"
#include "quick_decoder.hpp"

namespace fringe_fusion::decode {

/// Width of the stretches in which rows are decoded: short enough that all frames of a stretch stay
/// in the first cache.
[[nodiscard]] int StretchWidth(int image_width);

/// Decodes rows of any sequence, every stretch in the fastest way that does it. Borrows the stack;
/// one object per thread.
class RowDecoder {
 public:
  /// @param context of stretches of StretchWidth() pixels.
  RowDecoder(const ImageStack& stack, const DecodeContext& context);

  void Run(int y, const MapRow& out);

 private:
  /// What is known about a stretch.
  struct Decoded {
    const AxisRow* u = nullptr;
    const AxisRow* v = nullptr;
    const float* white = nullptr;  ///< null: none was taken
  };
  /// For sequences and pixels that the ladder does not take.
  struct General {
    General(const ImageStack& stack, const DecodeContext& context);
    FrameRows rows;
    std::optional<AxisDecoder> u;
    std::optional<AxisDecoder> v;
  };

  [[nodiscard]] bool RunQuick(int y, int begin, int count, const MapRow& out);
  [[nodiscard]] bool ReadLight(int y, int begin, int count);
  /// Whether all pixels of one of the groups have light.
  [[nodiscard]] bool HasLitGroup(int count) const;
  void FinishDoubtful(int count, const MapRow& out);
  void StoreWhite(int y, int begin, int count, const MapRow& out);
  void RunStretch(int y, int begin, int count, const MapRow& out);
  Decoded Decode(int y, int begin, int count);
  Decoded DecodeGeneral(int y, int begin);
  void Compose(const Decoded& decoded, int light_begin, int count, const MapRow& out);
  void CheckLight(int group, const float* bright, const float* dark, int count);

  const ImageStack& stack_;
  DecodeContext context_;
  std::optional<QuickDecoder> quick_;
  bool was_dark_ = false;  ///< the last stretch had no group with light
  std::optional<LadderDecoder> ladder_;
  std::optional<General> general_;
  std::vector<std::int32_t> light_;
  std::vector<float> texture_;
};

}  // namespace fringe_fusion::decode
