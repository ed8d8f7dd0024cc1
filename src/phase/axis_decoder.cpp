#include "axis_decoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "common/constants.hpp"
#include "decode_corrected.hpp"

namespace fringe_fusion::decode {
namespace {

// Log odds of a pixel whose order is not in question.
constexpr float kCertain = 1e6F;
// A pixel this close to the end of an axis that repeats may belong to the other end [sigma].
constexpr float kEndMargin = 3.0F;

// A wrong order has the probability 1 / (1 + exp(log odds)).
float LeastLogOdds(const PhaseConfig& config) {
  const double wrong = config.max_wrong_order_ratio;
  return static_cast<float>(std::log((1.0 - wrong) / wrong));
}

}  // namespace

NestLevel LevelOf(const AxisPlan& plan, std::size_t set, const PhaseConfig& config) {
  const double period_px = plan.size_px / plan.sets[set].fringes;
  const double before_px = set == 0 ? 0.0 : plan.size_px / plan.sets[set - 1].fringes;
  const double systematic = config.phase_error_rad / kTwoPi * (1.0 + before_px / period_px);
  NestLevel level;
  level.period_px = static_cast<float>(period_px);
  level.period_px2 = static_cast<float>(period_px * period_px);
  level.inverse_period = static_cast<float>(1.0 / period_px);
  level.inverse_period2 = static_cast<float>(1.0 / (period_px * period_px));
  level.systematic2 = static_cast<float>(systematic * systematic);
  level.max_order_error = static_cast<float>(config.max_order_error_ratio);
  level.least_log_odds = LeastLogOdds(config);
  level.farthest2 = static_cast<float>(config.max_level_sigma * config.max_level_sigma);
  return level;
}

AxisEnds EndsOf(const AxisPlan& plan) {
  const bool repeats = !plan.gray && !plan.sets.empty() && plan.sets.front().fringes == 1.0 &&
                       std::all_of(plan.sets.begin(), plan.sets.end(), [](const PhaseSet& set) {
                         return set.fringes == std::round(set.fringes);
                       });
  AxisEnds ends;
  ends.size_px = static_cast<float>(plan.size_px);
  if (repeats) ends.inverse_size = 1.0F / ends.size_px;
  if (repeats) ends.margin2 = kEndMargin * kEndMargin;
  return ends;
}

AxisDecoder::AxisDecoder(const AxisPlan& plan, const DecodeContext& context)
    : plan_(plan),
      context_(context),
      least_log_odds_(LeastLogOdds(context.config)),
      row_(context.stride()) {
  if (plan.gray) gray_.emplace(*plan.gray, context);
  const Axis axis = &plan == &context.plan.u ? Axis::kU : Axis::kV;
  for (const PhaseSet& set : plan.sets) fits_.emplace_back(set, context, LutOf(context, axis, set));
  if (plan.unwrapping == Unwrapping::kJoint) joint_.emplace(plan.sets, plan.size_px, context);
  if (!plan.micro.empty()) micro_.emplace(plan, context);
}

const AxisRow& AxisDecoder::Run(const FrameRows& rows) {
  if (gray_) gray_->Run(rows);
  for (StepFit& fit : fits_) fit.Run(rows);
  if (context_.config.report_order_error) {
    std::fill(row_.log_odds.begin(), row_.log_odds.end(), kCertain);
  }
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
  if (plan_.unwrapping != Unwrapping::kRelative) Finish();
  return row_;
}

// The greatest status of all sets; grey values are those of the finest.
void AxisDecoder::MergeSets() {
  const SetRow& finest = fits_.back().row();
  std::copy_n(finest.offset.begin(), context_.width, row_.offset_dn.begin());
  std::copy_n(finest.amplitude2.begin(), context_.width, row_.amplitude2_dn2.begin());
  std::copy_n(finest.status.begin(), context_.width, row_.status.begin());
  for (std::size_t set = 0; set + 1 < fits_.size(); ++set) {
    context_.kernels.raise(fits_[set].row().status.data(), row_.status.data(), context_.width);
  }
}

void AxisDecoder::DecodeGray() {
  for (std::size_t x = 0; x < static_cast<std::size_t>(context_.width); ++x) {
    row_.offset_dn[x] = gray_->offset_dn(x);
    row_.amplitude2_dn2[x] = gray_->modulation_dn(x) * gray_->modulation_dn(x);
    const GrayInterval interval = gray_->Cell(x);
    const bool read = std::isfinite(interval.centre_px);
    const bool inside = interval.centre_px >= -0.5 && interval.centre_px <= plan_.size_px - 0.5;
    row_.status[x] = !read ? kRowDoubtfulOrder : (!inside ? kRowOutside : kRowValid);
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
    if (!read) row_.status[x] = std::max<std::int32_t>(row_.status[x], kRowDoubtfulOrder);
  }
}

void AxisDecoder::Nest(std::size_t set) {
  const PhaseConfig& config = context_.config;
  const SetRow& fit = fits_[set].row();
  NestArgs args;
  args.cycles = fit.cycles.data();
  args.variance = fit.variance.data();
  args.level = LevelOf(plan_, set, config);
  args.half_px = row_.half_px.data();
  args.coordinate_px = row_.coordinate_px.data();
  args.variance_px2 = row_.variance_px2.data();
  args.log_odds = config.report_order_error ? row_.log_odds.data() : nullptr;
  args.status = row_.status.data();
  const Kernels& kernels = context_.kernels;
  const auto first = gray_ ? kernels.nest_interval : kernels.nest_open;
  (set == 0 ? first : kernels.nest)(args, context_.width);
}

void AxisDecoder::Store(std::size_t x, const Unwrapped& pixel) {
  row_.coordinate_px[x] = static_cast<float>(pixel.coordinate_px);
  row_.variance_px2[x] = static_cast<float>(pixel.variance_px2);
  row_.log_odds[x] = static_cast<float>(pixel.log_odds);
  std::int32_t status = pixel.status;
  if (status < kRowDoubtfulOrder && !(row_.log_odds[x] >= least_log_odds_)) {
    status = kRowDoubtfulOrder;
  }
  row_.status[x] = std::max(row_.status[x], status);
}

void AxisDecoder::DecodeJoint() {
  for (std::size_t x = 0; x < static_cast<std::size_t>(context_.width); ++x) {
    if (row_.status[x] <= kRowResidual) Store(x, joint_->Run(fits_, x));
  }
}

void AxisDecoder::DecodeMicro(const FrameRows& rows) {
  micro_->Load(rows);
  for (std::size_t x = 0; x < static_cast<std::size_t>(context_.width); ++x) {
    row_.status[x] = kRowValid;
    Store(x, micro_->Run(x));
    row_.offset_dn[x] = static_cast<float>(micro_->offset_dn());
    const auto modulation = static_cast<float>(micro_->modulation_dn());
    row_.amplitude2_dn2[x] = modulation * modulation;
  }
}

void AxisDecoder::Finish() {
  FinishArgs args;
  args.ends = EndsOf(plan_);
  args.coordinate_px = row_.coordinate_px.data();
  args.variance_px2 = row_.variance_px2.data();
  args.status = row_.status.data();
  context_.kernels.finish(args, context_.width);
}

}  // namespace fringe_fusion::decode
