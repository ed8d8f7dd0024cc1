#pragma once

#include <cstdint>
#include <vector>

#include "fringe_fusion/phase/phase_map.hpp"
#include "kernels.hpp"

namespace fringe_fusion::decode {

/// Masks (kEdge) pixels that may show two surfaces at once: where u or v bends against both
/// neighbours of a row or column, where it does on either side, and beside pixels without light.
/// Rows are masked while they are decoded, chunk by chunk; the result does not depend on the
/// chunks. Ref: science section 2.6.
class EdgeMask {
 public:
  static constexpr int kRowsPerChunk = 32;  ///< or fewer in the last one

  /// @param map is borrowed.
  EdgeMask(PhaseMap& map, const PhaseConfig& config, const Kernels& kernels);

  /// The rows [begin, end) of one chunk, to be added one after the other as they are decoded. One
  /// object per thread.
  class Chunk {
   public:
    Chunk(EdgeMask& mask, int begin, int end);
    void Add(int y);

   private:
    EdgeMask& mask_;
    int begin_ = 0;
    int end_ = 0;
  };

  /// Rows at the ends of chunks, after the last one was added.
  void Finish();

 private:
  [[nodiscard]] std::uint8_t* bits(std::vector<std::uint8_t>& rows, int y) const {
    return rows.data() + static_cast<std::size_t>(y) * stride_;
  }
  void ReadMask(int y);
  void Find(int y);
  void TakeOut(int y);

  PhaseMap& map_;
  const Kernels& kernels_;
  const bool beside_dark_ = false;
  EdgeArgs limits_;
  std::size_t stride_ = 0;  ///< bytes of a row of bits
  std::vector<float> missing_;
  // One bit per pixel, the least one first.
  std::vector<std::uint8_t> valid_;
  std::vector<std::uint8_t> dark_;
  std::vector<std::uint8_t> edges_;
};

/// The same for a map that is decoded as a whole.
[[nodiscard]] PhaseMap MaskEdges(PhaseMap map, const PhaseConfig& config,
                                 const Kernels& kernels = BestKernels());

}  // namespace fringe_fusion::decode
