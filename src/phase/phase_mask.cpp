#include "phase_mask.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>

#include "common/constants.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::decode {
namespace {

constexpr std::size_t kWord = sizeof(std::uint64_t);
constexpr std::uint64_t kOnes = 0x0101010101010101;

constexpr std::uint32_t BitOf(MaskReason reason) { return 1U << static_cast<unsigned>(reason); }
// Reasons by which the projector's light does not reach a pixel: its neighbours may be partly lit.
constexpr std::uint32_t kDarkReasons = BitOf(MaskReason::kTooDark) | BitOf(MaskReason::kShadow) |
                                       BitOf(MaskReason::kLowModulation) |
                                       BitOf(MaskReason::kOutsideProjector);

// Bit i of the result is bit 0 of byte i.
std::uint8_t PackBits(std::uint64_t bytes) {
  return static_cast<std::uint8_t>(((bytes & kOnes) * 0x0102040810204080) >> 56U);
}

std::uint8_t IsZero(std::uint64_t reasons) {
  return static_cast<std::uint8_t>(~PackBits((reasons + 0x7f * kOnes) >> 7U));
}

std::uint8_t IsDark(std::uint64_t reasons) {
  if (reasons == 0) return 0;
  const auto dark = [](std::uint64_t reason) { return (kDarkReasons >> (reason & 31U)) & 1U; };
  if (reasons == (reasons & 0xffU) * kOnes) return dark(reasons) != 0 ? 0xff : 0;
  std::uint32_t bits = 0;
  for (unsigned i = 0; i < kWord; ++i) bits |= dark(reasons >> (8U * i)) << i;
  return static_cast<std::uint8_t>(bits);
}

std::uint64_t LoadWord(const std::uint8_t* bytes) {
  std::uint64_t word = 0;
  std::memcpy(&word, bytes, kWord);
  return word;
}

// Bits of a row with those of the neighbours on the left and on the right.
struct Around {
  std::uint64_t here, left, right;
};
Around LoadAround(const std::uint8_t* row, std::size_t i, std::size_t stride) {
  const std::uint64_t here = LoadWord(row + i);
  const std::uint64_t before = i > 0 ? row[i - 1] >> 7U : 0U;
  const std::uint64_t after = i + kWord < stride ? row[i + kWord] & 1U : 0U;
  return {here, (here << 1U) | before, (here >> 1U) | (after << 63U)};
}

}  // namespace

EdgeMask::EdgeMask(PhaseMap& map, const PhaseConfig& config, const Kernels& kernels)
    : map_(map),
      kernels_(kernels),
      beside_dark_(config.mask_beside_dark),
      stride_((static_cast<std::size_t>(map.width) + 63U) / 64U * kWord),
      missing_(static_cast<std::size_t>(map.width), kNan) {
  limits_.max_bend_px = static_cast<float>(config.max_bend_px);
  // Of the difference of neighbours two pixels apart, which is twice the slope.
  limits_.max_bend_ratio = static_cast<float>(0.5 * config.max_bend_ratio);
  // Of the second difference of three equal sigmas.
  limits_.max_bend_sigma = static_cast<float>(config.max_bend_sigma * std::sqrt(6.0));
  const std::size_t size = stride_ * static_cast<std::size_t>(map.height);
  for (std::vector<std::uint8_t>* rows : {&valid_, &dark_, &edges_}) rows->resize(size);
}

EdgeMask::Chunk::Chunk(EdgeMask& mask, int begin, int end)
    : mask_(mask), begin_(begin), end_(end) {}

// Edges are found in rows as they were decoded: a row is changed when its neighbours are done.
void EdgeMask::Chunk::Add(int y) {
  mask_.ReadMask(y);
  if (y >= begin_ + 2) mask_.Find(y - 1);
  if (y >= begin_ + 4) mask_.TakeOut(y - 2);
}

void EdgeMask::Finish() {
  ParallelFor(map_.height, kRowsPerChunk, [&](int begin, int end) {
    Find(begin);
    if (end - 1 > begin) Find(end - 1);
  });
  ParallelFor(map_.height, kRowsPerChunk, [&](int begin, int end) {
    for (int y = begin; y < std::min(begin + 2, end); ++y) TakeOut(y);
    for (int y = std::max(end - 2, begin + 2); y < end; ++y) TakeOut(y);
  });
}

void EdgeMask::ReadMask(int y) {
  const std::uint8_t* reasons = map_.mask.row(y);
  std::uint8_t* valid = bits(valid_, y);
  std::uint8_t* dark = bits(dark_, y);
  const auto width = static_cast<std::size_t>(map_.width);
  std::size_t x = 0;
  for (; x + kWord <= width; x += kWord) {
    const std::uint64_t word = LoadWord(reasons + x);
    valid[x / kWord] = IsZero(word);
    dark[x / kWord] = IsDark(word);
  }
  if (x == width) return;
  std::uint64_t word = ~std::uint64_t{0} / 0xffU * static_cast<unsigned>(MaskReason::kEdge);
  std::memcpy(&word, reasons + x, width - x);
  valid[x / kWord] = IsZero(word);
  dark[x / kWord] = IsDark(word);
}

void EdgeMask::Find(int y) {
  EdgeArgs args = limits_;
  const auto row_of = [&](const Image<float>& image, int row) {
    const bool exists = row >= 0 && row < map_.height;
    return image.empty() ? nullptr : (exists ? image.row(row) : missing_.data());
  };
  for (int i = 0; i < 3; ++i) {
    args.u.rows[i] = row_of(map_.u, y + i - 1);
    args.v.rows[i] = row_of(map_.v, y + i - 1);
  }
  args.u.sigma = row_of(map_.sigma_u, y);
  args.v.sigma = row_of(map_.sigma_v, y);
  std::uint8_t* edges = bits(edges_, y);
  args.bits = edges;
  kernels_.find_bends(args, map_.width);
  std::uint64_t before = 0;
  for (std::size_t i = 0; i < stride_; i += kWord) {
    std::uint64_t found = LoadWord(edges + i);
    // Between two bends lies a straight piece of the way from one surface to the other.
    const std::uint64_t after = i + kWord < stride_ ? edges[i + kWord] & 1U : 0U;
    const std::uint64_t own = found;
    found |= ((own << 1U) | before) & ((own >> 1U) | (after << 63U));
    before = own >> 63U;
    for (int row = std::max(y - 1, 0); beside_dark_ && row < std::min(y + 2, map_.height); ++row) {
      const Around dark = LoadAround(bits(dark_, row), i, stride_);
      found |= dark.here | dark.left | dark.right;
    }
    found &= LoadWord(bits(valid_, y) + i);
    std::memcpy(edges + i, &found, kWord);
  }
}

void EdgeMask::TakeOut(int y) {
  const std::uint8_t* edges = bits(edges_, y);
  for (std::size_t i = 0; i < stride_; i += kWord) {
    std::uint64_t found = LoadWord(edges + i);
    for (int x = static_cast<int>(8 * i); found != 0; ++x, found >>= 1U) {
      if ((found & 1U) == 0) continue;
      map_.mask(x, y) = static_cast<std::uint8_t>(MaskReason::kEdge);
      for (Image<float>* image : {&map_.u, &map_.v, &map_.sigma_u, &map_.sigma_v}) {
        if (!image->empty()) (*image)(x, y) = kNan;
      }
    }
  }
}

PhaseMap MaskEdges(PhaseMap map, const PhaseConfig& config, const Kernels& kernels) {
  EdgeMask mask(map, config, kernels);
  ParallelFor(map.height, EdgeMask::kRowsPerChunk, [&](int begin, int end) {
    EdgeMask::Chunk chunk(mask, begin, end);
    for (int y = begin; y < end; ++y) chunk.Add(y);
  });
  mask.Finish();
  return map;
}

}  // namespace fringe_fusion::decode
