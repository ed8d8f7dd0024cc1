#include "gray_fit.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "common/constants.hpp"

namespace fringe_fusion::decode {
namespace {

std::int64_t BinaryFromGray(std::uint32_t gray) {
  for (std::uint32_t shift = 1; shift < 32; shift <<= 1U) gray ^= gray >> shift;
  return static_cast<std::int64_t>(gray);
}

bool HasOneBit(std::uint32_t word) { return word != 0 && (word & (word - 1)) == 0; }

}  // namespace

GrayFit::GrayFit(const GrayCode& code, const DecodeContext& context)
    : code_(code), context_(context) {
  const auto size = static_cast<std::size_t>(context.width);
  word_.resize(size);
  weak_.resize(size);
  doubtful_.resize(size);
  for (std::vector<float>* row : {&signal_, &information_, &modulation_, &offset_}) {
    row->resize(size);
  }
}

void GrayFit::Run(const FrameRows& rows) {
  for (std::vector<std::uint32_t>* words : {&word_, &weak_, &doubtful_}) {
    std::fill(words->begin(), words->end(), 0U);
  }
  std::fill(modulation_.begin(), modulation_.end(), 0.0F);
  std::fill(offset_.begin(), offset_.end(), 0.0F);
  std::size_t num_reads = 0;
  for (std::size_t bit = 0; bit < code_.bits.size(); ++bit) {
    std::fill(signal_.begin(), signal_.end(), 0.0F);
    std::fill(information_.begin(), information_.end(), 0.0F);
    for (const GrayRead& read : code_.bits[bit].reads) {
      if (read.frame >= 0 && read.inverse_frame >= 0) {
        AddPair(rows, read);
      } else {
        AddSingle(rows, read);
      }
      ++num_reads;
    }
    FinishBit(1U << static_cast<std::uint32_t>(bit));
  }
  const float share = 1.0F / static_cast<float>(num_reads);
  for (float& value : modulation_) value *= share;
  for (float& value : offset_) value *= share;
}

// Each exposure measures the same difference with its own noise: the sum of difference times
// exposure over variance is the best single statistic. Where both grey values are saturated the
// exposure says nothing.
void GrayFit::AddPair(const FrameRows& rows, const GrayRead& read) {
  const float* lit = rows.frame(read.frame);
  const float* unlit = rows.frame(read.inverse_frame);
  const auto exposure =
      static_cast<float>(context_.plan.groups[static_cast<std::size_t>(read.group)].ratio);
  const float saturation = context_.saturation_dn();
  const RowNoise noise = NoiseOf(context_.config);
  for (std::size_t x = 0; x < word_.size(); ++x) {
    const float difference = lit[x] - unlit[x];
    const float variance = 2.0F * noise.floor_dn2 + noise.gain_dn * (lit[x] + unlit[x]);
    const bool used = lit[x] < saturation || unlit[x] < saturation;
    signal_[x] += used ? exposure * difference / variance : 0.0F;
    information_[x] += used ? exposure * exposure / variance : 0.0F;
    modulation_[x] += 0.5F * std::abs(difference) / exposure;
    offset_[x] += 0.5F * (lit[x] + unlit[x]) / exposure;
  }
}

void GrayFit::AddSingle(const FrameRows& rows, const GrayRead& read) {
  const bool inverse = read.frame < 0;
  const float* grey = rows.frame(inverse ? read.inverse_frame : read.frame);
  const float* bright = rows.bright(read.group);
  const float* dark = rows.dark(read.group);
  const auto exposure =
      static_cast<float>(context_.plan.groups[static_cast<std::size_t>(read.group)].ratio);
  const float saturation = context_.saturation_dn();
  for (std::size_t x = 0; x < word_.size(); ++x) {
    const float threshold = 0.5F * (bright[x] + dark[x]);
    const float difference = inverse ? threshold - grey[x] : grey[x] - threshold;
    const float variance =
        NoiseVariance(context_.config, grey[x]) + 0.5F * NoiseVariance(context_.config, threshold);
    const bool used = threshold < saturation;
    signal_[x] += used ? exposure * difference / variance : 0.0F;
    information_[x] += used ? exposure * exposure / variance : 0.0F;
    modulation_[x] += 0.5F * (bright[x] - dark[x]) / exposure;
    offset_[x] += threshold / exposure;
  }
}

void GrayFit::FinishBit(std::uint32_t flag) {
  const PhaseConfig& config = context_.config;
  const auto limit = static_cast<float>(config.min_bit_sigma * config.min_bit_sigma);
  const auto fine = static_cast<float>(config.min_fine_bit_sigma * config.min_fine_bit_sigma);
  for (std::size_t x = 0; x < word_.size(); ++x) {
    const float z2 = signal_[x] * signal_[x];
    word_[x] |= signal_[x] > 0.0F ? flag : 0U;
    // Negated so that a bit without information is doubtful.
    weak_[x] |= !(z2 >= limit * information_[x] && information_[x] > 0.0F) ? flag : 0U;
    doubtful_[x] |= !(z2 >= fine * information_[x] && information_[x] > 0.0F) ? flag : 0U;
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
  return Resolve(word_[x], doubtful_[x], context_.config.num_fine_bits);
}

bool GrayFit::MisreadingIsCostly(std::uint32_t word, std::uint32_t bit) const {
  const std::int64_t cost = std::abs(BinaryFromGray(word) - BinaryFromGray(word ^ bit));
  return cost > 1 && cost >= (std::int64_t{1} << context_.config.num_fine_bits);
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
