#include "quick_decoder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <utility>

#include "common/constants.hpp"
#include "ladder_decoder.hpp"

namespace fringe_fusion::decode {
namespace {

// Differences of sums of grey values are 16 bit wide.
constexpr float kGreatestFullScale = 8191.0F;
constexpr int kShortestStretch = 64;  // one vector of every kernel
// A deviation from the estimate before that is no cause for a closer look [fringes].
constexpr double kUsualDeviation = 0.2;
// atan(s) / (2 pi) = s (c0 + c1 s^2 + ...) for |s| <= 1: minimax, errors see kQuickTerms.
constexpr std::array<double, kQuickCoarseTerms> kCoarseAngle{0.1590298153, -0.05111656443,
                                                             0.02327866957, -0.006204869997};
constexpr std::array<double, kQuickTerms> kAngle{0.1591336684, -0.05256963356, 0.02867321979,
                                                 -0.01355302209, 0.003317587824};

void Fill(float (&lanes)[kQuickGroup], double value) {
  std::fill(std::begin(lanes), std::end(lanes), static_cast<float>(value));
}

QuickLevel MakeLevel(const AxisPlan& plan, std::size_t i) {
  const PhaseSet& set = plan.sets[i];
  const bool is_finest = i + 1 == plan.sets.size();
  const double period_px = plan.size_px / set.fringes;
  const double signed_px = set.sign * period_px;
  QuickLevel level;
  for (std::size_t k = 0; k < (is_finest ? kAngle.size() : kCoarseAngle.size()); ++k) {
    Fill(level.polynomial[k], signed_px * (is_finest ? kAngle[k] : kCoarseAngle[k]));
  }
  const double shift_px = set.offset_rad / kTwoPi * period_px + 0.5;
  // The set of one fringe is turned by half a period and its sign twice: 0..1 fringe, not
  // -1/2..1/2.
  Fill(level.quarter_px, i == 0 ? -0.25 * signed_px : 0.25 * signed_px);
  Fill(level.shift_px, i == 0 ? shift_px - 0.5 * period_px : shift_px);
  Fill(level.eighth_px, 0.125 * signed_px);
  Fill(level.inverse_period, 1.0 / period_px);
  Fill(level.period_px, period_px);
  const double ratio = set.fringes / plan.sets.back().fringes;
  Fill(level.weight, ratio * ratio);
  return level;
}

// With 4 B^2 = N in all sets and n = 4 sigma_A^2, the deviation of set i from the sets before has
// the variance n r / (8 pi^2 N) + systematic [fringes^2], r = 1 + f_i^2 / sum f_j^2. Bounds of it
// over all sets give what suffices. Shot noise that follows the fringe halves the 1 of the finest.
QuickLimits LimitsOf(const AxisPlan& plan, const DecodeContext& context) {
  const FitLimits fit = context.limits();
  double sum_f2 = 0.0;
  double least_spread = std::numeric_limits<double>::infinity();
  double least_systematic2 = std::numeric_limits<double>::infinity();
  double least_norm = static_cast<double>(fit.min_modulation2);
  double max_deviation = kUsualDeviation;
  double farthest2 = 0.0;
  for (std::size_t i = 0; i < plan.sets.size(); ++i) {
    const double f2 = plan.sets[i].fringes * plan.sets[i].fringes;
    if (i > 0) {
      const NestLevel level = LevelOf(plan, i, context.config);
      const double spread = (1.0 + f2 / sum_f2) / (2.0 * kTwoPi * kTwoPi);
      const auto systematic2 = static_cast<double>(level.systematic2);
      const auto log_odds = std::max(static_cast<double>(level.least_log_odds), 1e-9);
      max_deviation = std::min(max_deviation, static_cast<double>(level.max_order_error));
      const double room = (0.5 - kUsualDeviation) / log_odds - systematic2;
      const double endless = std::numeric_limits<double>::infinity();
      least_norm = std::max(least_norm, room > 0.0 ? spread / room : endless);
      least_spread = std::min(least_spread, spread - 0.5 / (2.0 * kTwoPi * kTwoPi));
      least_systematic2 = std::min(least_systematic2, systematic2);
      farthest2 = static_cast<double>(level.farthest2);
    }
    sum_f2 += f2;
  }
  QuickLimits limits;
  limits.least_norm_per_noise = static_cast<float>(least_norm);
  // The greatest of four samples exceeds the least by sqrt(2) B or more.
  limits.least_norm = static_cast<float>(2.0 * std::pow(context.config.min_contrast_dn, 2));
  limits.max_residual2 = fit.max_residual2;
  limits.harmonic2 = fit.harmonic2;
  limits.max_deviation = static_cast<float>(max_deviation);
  limits.agreed_deviation2 = static_cast<float>(farthest2 * least_systematic2);
  limits.agreed_deviation2_per_noise = static_cast<float>(farthest2 * least_spread);
  limits.margin_sigma = std::sqrt(EndsOf(plan).margin2);
  return limits;
}

bool IsQuick(const AxisPlan& plan, const DecodeContext& context) {
  if (!plan.IsCoded()) return true;
  return plan.sets.size() >= 2 && EndsOf(plan).inverse_size > 0.0F &&
         std::all_of(plan.sets.begin(), plan.sets.end(),
                     [](const PhaseSet& set) { return set.steps == 4; }) &&
         std::isfinite(LimitsOf(plan, context).least_norm_per_noise);
}

}  // namespace

bool QuickDecoder::Takes(const ImageStack& stack, const DecodeContext& context) {
  return LadderDecoder::Takes(stack, context) && context.full_scale_dn <= kGreatestFullScale &&
         IsQuick(context.plan.u, context) && IsQuick(context.plan.v, context);
}

QuickDecoder::QuickDecoder(const ImageStack& stack, const DecodeContext& context)
    : stack_(stack),
      context_(context),
      has_bytes_(std::holds_alternative<Image<std::uint8_t>>(stack.frames.front().pixels)),
      frames_(stack.frames.size()),
      other_axis_(2 * context.stride()),
      doubt_(context.stride() / kQuickGroup) {
  if (context.plan.u.IsCoded()) AddAxis(context.plan.u);
  if (context.plan.v.IsCoded()) AddAxis(context.plan.v);
  phase_rows_.resize(phase_frames_.size());
}

void QuickDecoder::AddAxis(const AxisPlan& plan) {
  const std::size_t stride = context_.stride();
  const std::size_t num_sets = plan.sets.size();
  Ladder ladder;
  ladder.rows.resize((2 * num_sets + 3) * stride);
  std::int16_t* rows = ladder.rows.data();
  std::int16_t* largest = rows + 2 * num_sets * stride;
  for (std::size_t i = 0; i < num_sets; ++i) {
    std::vector<int> frames;
    for (const PhaseSample& sample : plan.sets[i].samples) frames.push_back(sample.frame);
    phase_frames_.insert(phase_frames_.end(), frames.begin(), frames.end());
    ladder.frames.push_back(std::move(frames));
    SubtractArgs subtract;
    subtract.is_first = i == 0;
    subtract.cosine = rows + 2 * i * stride;
    subtract.sine = rows + (2 * i + 1) * stride;
    subtract.largest = largest;
    if (i + 1 == num_sets) subtract.contrast = largest + stride;
    if (i + 1 == num_sets) subtract.sum = largest + 2 * stride;
    ladder.subtract.push_back(subtract);
    ladder.levels.push_back(MakeLevel(plan, i));
  }
  QuickArgs& args = ladder.args;
  args.differences = rows;
  args.stride = static_cast<int>(stride);
  args.num_sets = static_cast<int>(num_sets);
  args.noise = NoiseOf(context_.config);
  args.limits = LimitsOf(plan, context_);
  const double period_px = plan.size_px / plan.sets.back().fringes;
  args.variance_px2 = static_cast<float>(period_px * period_px / (2.0 * kTwoPi * kTwoPi));
  args.size_px = static_cast<float>(plan.size_px);
  args.full_scale = context_.full_scale_dn;
  args.doubt = doubt_.data();
  axes_.push_back(std::move(ladder));
}

bool QuickDecoder::Run(int y, int begin, int count, const MapRow& out) {
  if (count < kShortestStretch) return false;
  FindPixels(y, begin);
  if (IsSaturated(count)) return false;
  std::fill(doubt_.begin(), doubt_.end(), std::uint8_t{0});
  MarkUnlit(count);
  DecodeAxes(count, out, false);
  std::memset(out.mask, 0, static_cast<std::size_t>(count));
  return true;
}

bool QuickDecoder::RunDark(int y, int begin, int count, const MapRow& out) {
  if (count < kShortestStretch) return false;
  FindPixels(y, begin);
  DecodeAxes(count, out, true);
  return true;
}

bool QuickDecoder::IsSaturated(int count) const {
  const Kernels& kernels = context_.kernels;
  const auto peak = has_bytes_ ? kernels.peak_bytes : kernels.peak_words;
  const int num_rows = static_cast<int>(phase_rows_.size());
  return !(static_cast<float>(peak(phase_rows_.data(), num_rows, count)) <
           context_.saturation_dn());
}

void QuickDecoder::FindPixels(int y, int begin) {
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    frames_[i] = PixelsOf(stack_.frames[i], y, begin);
  }
  for (std::size_t i = 0; i < phase_rows_.size(); ++i) {
    phase_rows_[i] = frames_[static_cast<std::size_t>(phase_frames_[i])];
  }
}

void QuickDecoder::DecodeAxes(int count, const MapRow& out, bool is_dark) {
  for (Ladder& ladder : axes_) {
    Subtract(ladder, is_dark ? ladder.subtract.size() - 1 : 0, count);
    DecodeAxis(ladder, count, out, is_dark);
  }
}

void QuickDecoder::Subtract(Ladder& ladder, std::size_t first_set, int count) {
  const Kernels& kernels = context_.kernels;
  for (std::size_t i = first_set; i < ladder.subtract.size(); ++i) {
    SubtractArgs& args = ladder.subtract[i];
    for (std::size_t n = 0; n < 4; ++n) {
      args.frames[n] = frames_[static_cast<std::size_t>(ladder.frames[i][n])];
    }
    (has_bytes_ ? kernels.subtract_bytes : kernels.subtract_words)(args, count);
  }
}

void QuickDecoder::DecodeAxis(Ladder& ladder, int count, const MapRow& out, bool is_dark) {
  const bool is_u = &ladder == &axes_.front() && context_.plan.u.IsCoded();
  QuickArgs& args = ladder.args;
  args.is_dark = is_dark;
  args.levels = ladder.levels.data();
  args.coordinate_px = is_u ? out.u_px : out.v_px;
  args.sigma_px = is_u ? out.sigma_u_px : out.sigma_v_px;
  args.other_axis = axes_.size() == 2 ? other_axis_.data() : nullptr;
  if (&ladder == &axes_.back()) {
    const bool has_white = !context_.plan.groups.front().white_frames.empty();
    args.offset = out.offset;
    args.modulation = out.modulation;
    args.rgb = has_white ? nullptr : out.rgb;
  }
  context_.kernels.quick(args, count);
}

void QuickDecoder::MarkUnlit(int count) {
  const ExposureGroup& group = context_.plan.groups.front();
  if (group.white_frames.empty()) return;
  UnlitArgs args;
  args.white = frames_[static_cast<std::size_t>(group.white_frames.front())];
  args.black = frames_[static_cast<std::size_t>(group.black_frames.front())];
  args.least_dn = static_cast<float>(context_.config.min_contrast_dn);
  args.doubt = doubt_.data();
  (has_bytes_ ? context_.kernels.mark_unlit_bytes : context_.kernels.mark_unlit_words)(args, count);
}

}  // namespace fringe_fusion::decode
