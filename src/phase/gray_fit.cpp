#include "gray_fit.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace fringe_fusion::decode {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::int64_t BinaryFromGray(std::uint32_t gray) {
  for (std::uint32_t shift = 1; shift < 32; shift <<= 1U) gray ^= gray >> shift;
  return static_cast<std::int64_t>(gray);
}

bool HasOneBit(std::uint32_t word) { return word != 0 && (word & (word - 1)) == 0; }

}  // namespace

GrayFit::GrayFit(const GrayCode& code, const PhaseConfig& config, int width)
    : code_(code), config_(config) {
  const auto size = static_cast<std::size_t>(width);
  word_.resize(size);
  weak_.resize(size);
  doubtful_.resize(size);
  modulation_.resize(size);
  offset_.resize(size);
}

void GrayFit::Run(const FrameRows& rows) {
  std::fill(word_.begin(), word_.end(), 0U);
  std::fill(weak_.begin(), weak_.end(), 0U);
  std::fill(doubtful_.begin(), doubtful_.end(), 0U);
  std::fill(modulation_.begin(), modulation_.end(), 0.0F);
  std::fill(offset_.begin(), offset_.end(), 0.0F);
  for (std::size_t bit = 0; bit < code_.bits.size(); ++bit) {
    const std::uint32_t flag = 1U << static_cast<std::uint32_t>(bit);
    const GrayBit& frames = code_.bits[bit];
    if (frames.frame >= 0 && frames.inverse_frame >= 0) {
      ReadPair(rows, frames, flag);
    } else {
      ReadSingle(rows, frames, flag);
    }
  }
  const float share = 1.0F / static_cast<float>(code_.bits.size());
  for (float& value : modulation_) value *= share;
  for (float& value : offset_) value *= share;
}

void GrayFit::ReadPair(const FrameRows& rows, const GrayBit& bit, std::uint32_t flag) {
  const float* lit = rows.frame(bit.frame);
  const float* unlit = rows.frame(bit.inverse_frame);
  const auto limit = static_cast<float>(config_.min_bit_sigma * config_.min_bit_sigma);
  const auto fine = static_cast<float>(config_.min_fine_bit_sigma * config_.min_fine_bit_sigma);
  for (std::size_t x = 0; x < word_.size(); ++x) {
    const float difference = lit[x] - unlit[x];
    const float variance = NoiseVariance(config_, lit[x]) + NoiseVariance(config_, unlit[x]);
    word_[x] |= difference > 0.0F ? flag : 0U;
    weak_[x] |= difference * difference < limit * variance ? flag : 0U;
    doubtful_[x] |= difference * difference < fine * variance ? flag : 0U;
    modulation_[x] += 0.5F * std::abs(difference);
    offset_[x] += 0.5F * (lit[x] + unlit[x]);
  }
}

void GrayFit::ReadSingle(const FrameRows& rows, const GrayBit& bit, std::uint32_t flag) {
  const bool inverse = bit.frame < 0;
  const float* grey = rows.frame(inverse ? bit.inverse_frame : bit.frame);
  const auto limit = static_cast<float>(config_.min_bit_sigma * config_.min_bit_sigma);
  const auto fine = static_cast<float>(config_.min_fine_bit_sigma * config_.min_fine_bit_sigma);
  for (std::size_t x = 0; x < word_.size(); ++x) {
    const float bright = rows.bright()[x];
    const float dark = rows.dark()[x];
    const float threshold = 0.5F * (bright + dark);
    const float difference = grey[x] - threshold;
    const float variance =
        NoiseVariance(config_, grey[x]) + 0.5F * NoiseVariance(config_, threshold);
    word_[x] |= (difference > 0.0F) != inverse ? flag : 0U;
    weak_[x] |= difference * difference < limit * variance ? flag : 0U;
    doubtful_[x] |= difference * difference < fine * variance ? flag : 0U;
    modulation_[x] += 0.5F * (bright - dark);
    offset_[x] += threshold;
  }
}

GrayInterval GrayFit::Interval(std::size_t x) const {
  return Resolve(word_[x], weak_[x], num_bits() - 1);
}

GrayInterval GrayFit::Cell(std::size_t x) const {
  for (std::uint32_t weak = weak_[x] & ~doubtful_[x]; weak != 0U; weak &= weak - 1U) {
    const std::uint32_t lowest = weak & (~weak + 1U);
    if (MisreadingIsCostly(word_[x], lowest)) return {kNan, kNan};
  }
  return Resolve(word_[x], doubtful_[x], config_.num_fine_bits);
}

bool GrayFit::MisreadingIsCostly(std::uint32_t word, std::uint32_t bit) const {
  const std::int64_t cost = std::abs(BinaryFromGray(word) - BinaryFromGray(word ^ bit));
  return cost > 1 && cost >= (std::int64_t{1} << config_.num_fine_bits);
}

GrayInterval GrayFit::Resolve(std::uint32_t word, std::uint32_t doubtful, int max_skipped) const {
  double cell = code_.cell_px;
  int num_skipped = 0;
  for (; (doubtful & 1U) != 0U; ++num_skipped) {
    // The upper bits of a reflected code are themselves the code of the cells of twice the size.
    word >>= 1U;
    doubtful >>= 1U;
    cell *= 2.0;
  }
  if (num_skipped > max_skipped || num_skipped >= num_bits()) return {kNan, kNan};
  const std::int64_t code = BinaryFromGray(word);
  auto centre = static_cast<double>(code) + 0.5;
  if (doubtful != 0U) {
    if (!HasOneBit(doubtful)) return {kNan, kNan};
    const std::int64_t other = BinaryFromGray(word ^ doubtful);
    if (std::abs(code - other) != 1) return {kNan, kNan};
    centre = static_cast<double>(std::max(code, other));
  }
  return {cell * centre - 0.5 + code_.offset_px, 0.5 * cell};
}

}  // namespace fringe_fusion::decode
