#include "axis_decoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace fringe_fusion::decode {
namespace {

constexpr double kTwoPi = 6.28318530717958647692;
constexpr auto kValid = static_cast<std::int32_t>(MaskReason::kValid);
constexpr auto kDoubtful = static_cast<std::int32_t>(MaskReason::kDoubtfulOrder);
constexpr auto kOutside = static_cast<std::int32_t>(MaskReason::kOutsideProjector);
// Log odds of a pixel whose order is not in question.
constexpr float kCertain = 1e6F;

// What is checked first explains most: without light no fit, without a fit no order.
int Rank(std::int32_t status) {
  switch (static_cast<MaskReason>(status)) {
    case MaskReason::kSaturated:
      return 3;
    case MaskReason::kLowModulation:
      return 2;
    case MaskReason::kValid:
      return 0;
    default:
      return 1;
  }
}

}  // namespace

AxisDecoder::AxisDecoder(const AxisPlan& plan, const DecodeContext& context)
    : plan_(plan), context_(context), row_(context.stride()) {
  if (plan.gray) gray_.emplace(*plan.gray, context);
  for (const PhaseSet& set : plan.sets) fits_.emplace_back(set, context);
  if (plan.unwrapping == Unwrapping::kJoint) joint_.emplace(plan.sets, plan.size_px, context);
  if (!plan.micro.empty()) micro_.emplace(plan, context);
  repeats_over_size_ = !plan.gray && !plan.sets.empty() && plan.sets.front().fringes == 1.0 &&
                       std::all_of(plan.sets.begin(), plan.sets.end(), [](const PhaseSet& set) {
                         return set.fringes == std::round(set.fringes);
                       });
}

const AxisRow& AxisDecoder::Run(const FrameRows& rows) {
  if (gray_) gray_->Run(rows);
  for (StepFit& fit : fits_) fit.Run(rows);
  std::fill(row_.log_odds.begin(), row_.log_odds.end(), kCertain);
  if (micro_) {
    DecodeMicro(rows);
  } else if (fits_.empty()) {
    DecodeGray();
    return row_;
  } else {
    MergeSets();
    if (joint_) {
      DecodeJoint();
    } else {
      StartNested();
      for (std::size_t set = 0; set < fits_.size(); ++set) Nest(set);
    }
  }
  if (plan_.unwrapping != Unwrapping::kRelative) {
    CheckOrders();
    FinishPhases();
  }
  return row_;
}

// The worst status of all sets; grey values are those of the finest.
void AxisDecoder::MergeSets() {
  const SetRow& finest = fits_.back().row();
  std::copy_n(finest.offset.begin(), context_.width, row_.offset_dn.begin());
  std::copy_n(finest.modulation.begin(), context_.width, row_.modulation_dn.begin());
  std::copy_n(finest.status.begin(), context_.width, row_.status.begin());
  for (std::size_t set = 0; set + 1 < fits_.size(); ++set) {
    const std::vector<std::int32_t>& status = fits_[set].row().status;
    for (std::size_t x = 0; x < static_cast<std::size_t>(context_.width); ++x) {
      if (status[x] != kValid && Rank(status[x]) > Rank(row_.status[x])) row_.status[x] = status[x];
    }
  }
}

void AxisDecoder::DecodeGray() {
  for (std::size_t x = 0; x < static_cast<std::size_t>(context_.width); ++x) {
    row_.offset_dn[x] = gray_->offset_dn(x);
    row_.modulation_dn[x] = gray_->modulation_dn(x);
    const GrayInterval interval = gray_->Cell(x);
    const bool read = std::isfinite(interval.centre_px);
    const bool inside = interval.centre_px >= -0.5 && interval.centre_px <= plan_.size_px - 0.5;
    row_.status[x] = !read ? kDoubtful : (!inside ? kOutside : kValid);
    row_.coordinate_px[x] = static_cast<float>(interval.centre_px);
    // A uniform error of +-half has the standard deviation half / sqrt(3).
    row_.variance_px2[x] = static_cast<float>(interval.half_px * interval.half_px / 3.0);
  }
}

void AxisDecoder::StartNested() {
  if (!gray_) return;
  for (std::size_t x = 0; x < static_cast<std::size_t>(context_.width); ++x) {
    const GrayInterval interval = gray_->Interval(x);
    const bool read = std::isfinite(interval.centre_px);
    row_.coordinate_px[x] = read ? static_cast<float>(interval.centre_px) : 0.0F;
    row_.half_px[x] = read ? static_cast<float>(interval.half_px) : 0.0F;
    if (!read && row_.status[x] == kValid) row_.status[x] = kDoubtful;
  }
}

void AxisDecoder::Nest(std::size_t set) {
  const PhaseConfig& config = context_.config;
  const SetRow& fit = fits_[set].row();
  NestArgs args;
  args.cycles = fit.cycles.data();
  args.variance = fit.variance.data();
  args.period_px = static_cast<float>(plan_.size_px / plan_.sets[set].fringes);
  args.period_before_px =
      set == 0 ? 0.0F : static_cast<float>(plan_.size_px / plan_.sets[set - 1].fringes);
  args.open = set == 0 && !gray_;
  args.interval = set == 0 && gray_.has_value();
  args.phase_error = static_cast<float>(config.phase_error_rad / kTwoPi);
  args.max_order_error = static_cast<float>(config.max_order_error_ratio);
  args.max_level_sigma = static_cast<float>(config.max_level_sigma);
  args.half_px = row_.half_px.data();
  args.coordinate_px = row_.coordinate_px.data();
  args.variance_px2 = row_.variance_px2.data();
  args.log_odds = row_.log_odds.data();
  args.status = row_.status.data();
  context_.kernels.nest(args, context_.width);
}

void AxisDecoder::Store(std::size_t x, const Unwrapped& pixel) {
  row_.coordinate_px[x] = static_cast<float>(pixel.coordinate_px);
  row_.variance_px2[x] = static_cast<float>(pixel.variance_px2);
  row_.log_odds[x] = static_cast<float>(pixel.log_odds);
  if (row_.status[x] == kValid) row_.status[x] = static_cast<std::int32_t>(pixel.reason);
}

void AxisDecoder::DecodeJoint() {
  for (std::size_t x = 0; x < static_cast<std::size_t>(context_.width); ++x) {
    if (row_.status[x] == kValid) Store(x, joint_->Run(fits_, x));
  }
}

void AxisDecoder::DecodeMicro(const FrameRows& rows) {
  micro_->Load(rows);
  for (std::size_t x = 0; x < static_cast<std::size_t>(context_.width); ++x) {
    row_.status[x] = kValid;
    Store(x, micro_->Run(x));
    row_.offset_dn[x] = static_cast<float>(micro_->offset_dn());
    row_.modulation_dn[x] = static_cast<float>(micro_->modulation_dn());
  }
}

// A wrong order has the probability 1 / (1 + exp(log odds)) at each step, and the worst step rules.
void AxisDecoder::CheckOrders() {
  const double wrong = context_.config.max_wrong_order_ratio;
  const auto least = static_cast<float>(std::log((1.0 - wrong) / wrong));
  for (std::size_t x = 0; x < static_cast<std::size_t>(context_.width); ++x) {
    const bool open = row_.status[x] == kValid ||
                      row_.status[x] == static_cast<std::int32_t>(MaskReason::kResidual);
    if (open && !(row_.log_odds[x] >= least)) row_.status[x] = kDoubtful;
  }
}

// The coarsest set of exactly one fringe jumps by the projector size at its ends, where noise
// decides the side. Finer sets repeat over the size too, so only the fused value can tell; a pixel
// this close to the border may belong to the opposite one.
void AxisDecoder::FinishPhases() {
  const auto size = static_cast<float>(plan_.size_px);
  const float inverse_size = 1.0F / size;
  const float wrap = repeats_over_size_ ? 1.0F : 0.0F;
  for (std::size_t x = 0; x < static_cast<std::size_t>(context_.width); ++x) {
    const float turns = std::floor((row_.coordinate_px[x] + 0.5F) * inverse_size);
    const float coordinate = row_.coordinate_px[x] - wrap * size * turns;
    row_.coordinate_px[x] = coordinate;
    const float margin = wrap * 3.0F * std::sqrt(row_.variance_px2[x]);
    const bool inside = coordinate >= -0.5F + margin && coordinate <= size - 0.5F - margin;
    if (row_.status[x] == kValid && !inside) row_.status[x] = kOutside;
  }
}

}  // namespace fringe_fusion::decode
