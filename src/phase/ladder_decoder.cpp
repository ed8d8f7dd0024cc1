#include "ladder_decoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "axis_decoder.hpp"
#include "common/constants.hpp"

namespace fringe_fusion::decode {
namespace {

bool IsLadder(const AxisPlan& axis) {
  return !axis.gray && axis.micro.empty() && axis.unwrapping == Unwrapping::kNested &&
         std::all_of(axis.sets.begin(), axis.sets.end(), [](const PhaseSet& set) {
           return set.even && set.carrier_steps == 0 && (set.steps == 3 || set.steps == 4) &&
                  set.samples.size() == static_cast<std::size_t>(set.steps);
         });
}

}  // namespace

bool LadderDecoder::Takes(const ImageStack& stack, const DecodeContext& context) {
  const DecodePlan& plan = context.plan;
  if (plan.groups.size() != 1 || context.config.report_order_error) return false;
  if (context.correction != nullptr) return false;
  const std::size_t num_white = plan.groups[0].white_frames.size();
  if (num_white > 1 || plan.groups[0].black_frames.size() != num_white) return false;
  const std::size_t kind = stack.frames.front().pixels.index();
  return IsLadder(plan.u) && IsLadder(plan.v) &&
         std::all_of(stack.frames.begin(), stack.frames.end(),
                     [&](const CapturedFrame& frame) { return frame.pixels.index() == kind; });
}

LadderDecoder::LadderDecoder(const ImageStack& stack, const DecodeContext& context)
    : stack_(stack),
      context_(context),
      has_bytes_(std::holds_alternative<Image<std::uint8_t>>(stack.frames.front().pixels)),
      frames_(stack.frames.size()),
      low_(context.stride()),
      high_(context.stride()),
      bright_(context.stride()),
      dark_(context.stride()) {
  if (context.plan.u.IsCoded()) AddAxis(context.plan.u);
  if (context.plan.v.IsCoded()) AddAxis(context.plan.v);
  phase_rows_.resize(phase_frames_.size());
}

void LadderDecoder::AddAxis(const AxisPlan& plan) {
  Ladder ladder{AxisRow(context_.stride()), {}, EndsOf(plan)};
  for (std::size_t i = 0; i < plan.sets.size(); ++i) {
    const PhaseSet& set = plan.sets[i];
    Rung rung;
    for (const PhaseSample& sample : set.samples) rung.frames.push_back(sample.frame);
    phase_frames_.insert(phase_frames_.end(), rung.frames.begin(), rung.frames.end());
    ClimbArgs& args = rung.args;
    args.num_steps = set.steps;
    args.is_first = i == 0;
    args.level = LevelOf(plan, i, context_.config);
    const double period_px = plan.size_px / set.fringes;
    args.sign_px = static_cast<float>(set.sign * period_px);
    args.shift_px = static_cast<float>(set.offset_rad / kTwoPi * period_px + 0.5);
    args.noise = NoiseOf(context_.config);
    args.limits = context_.limits();
    ladder.rungs.push_back(rung);
  }
  axes_.push_back(std::move(ladder));
}

bool LadderDecoder::ReadLight(int y, int begin, int count) {
  FindPixels(y, begin);
  if (!FindRange(count)) return false;
  const ExposureGroup& group = context_.plan.groups.front();
  const auto frame = [this](int i) { return frames_[static_cast<std::size_t>(i)]; };
  const bool has_white = !group.white_frames.empty();
  ToFloat(has_white ? frame(group.white_frames.front()) : high_.data(), bright_.data(), count);
  ToFloat(has_white ? frame(group.black_frames.front()) : low_.data(), dark_.data(), count);
  return true;
}

void LadderDecoder::Climb(int begin, int count) {
  for (Ladder& ladder : axes_) ClimbAxis(ladder, begin, count);
}

void LadderDecoder::FindPixels(int y, int begin) {
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    frames_[i] = PixelsOf(stack_.frames[i], y, begin);
  }
  for (std::size_t i = 0; i < phase_rows_.size(); ++i) {
    phase_rows_[i] = frames_[static_cast<std::size_t>(phase_frames_[i])];
  }
}

bool LadderDecoder::FindRange(int count) {
  RangeArgs args;
  args.rows = phase_rows_.data();
  args.num_rows = static_cast<int>(phase_rows_.size());
  args.low = low_.data();
  args.high = high_.data();
  const Kernels& kernels = context_.kernels;
  const auto range = has_bytes_ ? kernels.range_bytes : kernels.range_words;
  return static_cast<float>(range(args, count)) < context_.saturation_dn();
}

void LadderDecoder::ToFloat(const void* grey, float* out, int count) const {
  const Kernels& kernels = context_.kernels;
  if (has_bytes_) {
    kernels.bytes_to_float(static_cast<const std::uint8_t*>(grey), out, count);
  } else {
    kernels.words_to_float(static_cast<const std::uint16_t*>(grey), out, count);
  }
}

void LadderDecoder::ClimbAxis(Ladder& ladder, int begin, int count) {
  const int offset = has_bytes_ ? begin : 2 * begin;
  const Kernels& kernels = context_.kernels;
  AxisRow& row = ladder.row;
  for (Rung& rung : ladder.rungs) {
    ClimbArgs& args = rung.args;
    for (std::size_t n = 0; n < rung.frames.size(); ++n) {
      const void* frame = frames_[static_cast<std::size_t>(rung.frames[n])];
      args.frames[n] = static_cast<const std::uint8_t*>(frame) + offset;
    }
    const bool is_finest = &rung == &ladder.rungs.back();
    args.coordinate_px = row.coordinate_px.data();
    args.variance_px2 = row.variance_px2.data();
    args.status = row.status.data();
    args.offset = is_finest ? row.offset_dn.data() : nullptr;
    args.amplitude2 = is_finest ? row.amplitude2_dn2.data() : nullptr;
    (has_bytes_ ? kernels.climb_bytes : kernels.climb_words)(args, count);
  }
  FinishArgs args;
  args.ends = ladder.ends;
  args.coordinate_px = row.coordinate_px.data();
  args.variance_px2 = row.variance_px2.data();
  args.status = row.status.data();
  kernels.finish(args, count);
}

}  // namespace fringe_fusion::decode
