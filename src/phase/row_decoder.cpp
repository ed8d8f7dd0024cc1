#include "row_decoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>

#include "common/constants.hpp"

namespace fringe_fusion::decode {
namespace {

constexpr int kLongestStretch = 256;
constexpr int kVectors = 64;  // bytes that the kernels take at once
constexpr auto kDoubtful = static_cast<std::uint8_t>(MaskReason::kDoubtfulOrder);

AxisInput InputOf(const AxisRow& row) {
  return {row.coordinate_px.data(), row.variance_px2.data(), row.offset_dn.data(),
          row.amplitude2_dn2.data(), row.status.data()};
}

MapRow From(const MapRow& row, int x) {
  const auto shift = [x](float* values) { return values == nullptr ? nullptr : values + x; };
  MapRow out;
  out.u_px = shift(row.u_px);
  out.v_px = shift(row.v_px);
  out.sigma_u_px = shift(row.sigma_u_px);
  out.sigma_v_px = shift(row.sigma_v_px);
  out.offset = shift(row.offset);
  out.modulation = shift(row.modulation);
  out.mask = row.mask + x;
  out.rgb = row.rgb == nullptr ? nullptr : row.rgb + 3 * static_cast<std::ptrdiff_t>(x);
  out.order_error = shift(row.order_error);
  return out;
}

void StoreOrderError(const AxisRow& u, const AxisRow& v, int count, const MapRow& out) {
  for (std::size_t x = 0; x < static_cast<std::size_t>(count); ++x) {
    const float odds = std::min(u.log_odds[x], v.log_odds[x]);
    const bool known = out.mask[x] == 0 || out.mask[x] == kDoubtful;
    out.order_error[x] = known ? 1.0F / (1.0F + std::exp(odds)) : kNan;
  }
}

}  // namespace

int StretchWidth(int image_width) {
  const int num_stretches = (image_width + kLongestStretch - 1) / kLongestStretch;
  const int width = (image_width + num_stretches - 1) / num_stretches;
  return (width + kVectors - 1) / kVectors * kVectors;
}

RowDecoder::General::General(const ImageStack& stack, const DecodeContext& context)
    : rows(stack, context) {
  if (context.plan.u.IsCoded()) u.emplace(context.plan.u, context);
  if (context.plan.v.IsCoded()) v.emplace(context.plan.v, context);
}

RowDecoder::RowDecoder(const ImageStack& stack, const DecodeContext& context)
    : stack_(stack), context_(context), light_(context.stride()), texture_(context.stride()) {
  if (LadderDecoder::Takes(stack, context)) ladder_.emplace(stack, context);
  if (QuickDecoder::Takes(stack, context)) quick_.emplace(stack, context);
}

void RowDecoder::Run(int y, const MapRow& row) {
  const int width = Width(stack_.frames.front());
  for (int begin = 0; begin < width; begin += context_.width) {
    const int count = std::min(context_.width, width - begin);
    const MapRow out = From(row, begin);
    if (!quick_ || !RunQuick(y, begin, count, out)) RunStretch(y, begin, count, out);
  }
}

// Dark stretches come in rows: only after one is the light looked at first. A group with a pixel
// without light is doubtful either way, so the result is the same.
bool RowDecoder::RunQuick(int y, int begin, int count, const MapRow& out) {
  if (was_dark_ && ReadLight(y, begin, count) && !HasLitGroup(count) &&
      quick_->RunDark(y, begin, count, out)) {
    StoreWhite(y, begin, count, out);
    FinishDoubtful(count, out);
    return true;
  }
  was_dark_ = false;
  if (!quick_->Run(y, begin, count, out)) return false;
  StoreWhite(y, begin, count, out);
  const int num_groups = QuickDecoder::NumGroups(count);
  for (int group = 0; group < num_groups; ++group) {
    if (!quick_->IsDoubtful(group)) continue;
    const int first = QuickDecoder::GroupBegin(group, count);
    while (group + 1 < num_groups && quick_->IsDoubtful(group + 1)) ++group;
    const int run = QuickDecoder::GroupBegin(group, count) + kQuickGroup - first;
    // No pixel is saturated.
    if (!ReadLight(y, begin + first, run)) throw std::logic_error("RowDecoder: saturated group");
    was_dark_ = run == count && !HasLitGroup(run);
    FinishDoubtful(run, From(out, first));
  }
  return true;
}

bool RowDecoder::ReadLight(int y, int begin, int count) {
  if (!ladder_->ReadLight(y, begin, count)) return false;
  CheckLight(0, ladder_->bright(), ladder_->dark(), count);
  return true;
}

bool RowDecoder::HasLitGroup(int count) const {
  for (int x = 0; x < count; x += kQuickGroup) {
    const int begin = std::min(x, count - kQuickGroup);
    const auto first = light_.begin() + begin;
    if (std::all_of(first, first + kQuickGroup, [](std::int32_t light) { return light == 0; })) {
      return true;
    }
  }
  return false;
}

// Offset, modulation and picture are there; coordinates and reasons come from the ladder.
void RowDecoder::FinishDoubtful(int count, const MapRow& out) {
  context_.kernels.blank(light_.data(), out, count);
  const auto is_lit = [&](int x) {
    const auto first = light_.begin() + x;
    return std::find(first, first + std::min(kQuickGroup, count - x), 0) !=
           first + std::min(kQuickGroup, count - x);
  };
  for (int x = 0; x < count; x += kQuickGroup) {
    if (!is_lit(x)) continue;
    const int first = x;
    while (x + kQuickGroup < count && is_lit(x + kQuickGroup)) x += kQuickGroup;
    const int end = std::min(x + kQuickGroup, count);
    ladder_->Climb(first, end - first);
    Compose({&ladder_->u(), &ladder_->v(), nullptr}, first, end - first, From(out, first));
  }
}

void RowDecoder::StoreWhite(int y, int begin, int count, const MapRow& out) {
  const auto& white = context_.plan.groups.front().white_frames;
  if (white.empty() || out.rgb == nullptr) return;
  const CapturedFrame& frame = stack_.frames[static_cast<std::size_t>(white.front())];
  ladder_->ToFloat(PixelsOf(frame, y, begin), texture_.data(), count);
  context_.kernels.to_rgb(texture_.data(), context_.full_scale_dn, out.rgb, count);
}

void RowDecoder::RunStretch(int y, int begin, int count, const MapRow& out) {
  const Decoded decoded = Decode(y, begin, count);
  Compose(decoded, 0, count, out);
  if (out.rgb != nullptr) {
    // The white frame at the exposure of the scan, or A + B where none was taken.
    const float* grey = decoded.white == nullptr ? texture_.data() : decoded.white;
    context_.kernels.to_rgb(grey, context_.full_scale_dn, out.rgb, count);
  }
  if (out.order_error != nullptr) StoreOrderError(*decoded.u, *decoded.v, count, out);
}

void RowDecoder::Compose(const Decoded& decoded, int light_begin, int count, const MapRow& out) {
  ComposeArgs args;
  args.u = InputOf(*decoded.u);
  args.v = InputOf(*decoded.v);
  args.light = light_.data() + light_begin;
  args.texture = out.rgb != nullptr && decoded.white == nullptr ? texture_.data() : nullptr;
  args.out = out;
  context_.kernels.compose(args, count);
}

RowDecoder::Decoded RowDecoder::Decode(int y, int begin, int count) {
  if (!ladder_ || !ReadLight(y, begin, count)) return DecodeGeneral(y, begin);
  ladder_->Climb(0, count);
  const bool has_white = !context_.plan.groups.front().white_frames.empty();
  return {&ladder_->u(), &ladder_->v(), has_white ? ladder_->bright() : nullptr};
}

RowDecoder::Decoded RowDecoder::DecodeGeneral(int y, int begin) {
  if (!general_) general_.emplace(stack_, context_);
  FrameRows& rows = general_->rows;
  rows.Load(y, begin);
  for (std::size_t i = 0; i < context_.plan.groups.size(); ++i) {
    const int group = static_cast<int>(i);
    CheckLight(group, rows.bright(group), rows.dark(group), context_.width);
  }
  const int group = context_.plan.reference_group;
  const auto& white = context_.plan.groups[static_cast<std::size_t>(group)].white_frames;
  Decoded out;
  if (general_->u) out.u = &general_->u->Run(rows);
  if (general_->v) out.v = &general_->v->Run(rows);
  if (out.u == nullptr) out.u = out.v;
  if (out.v == nullptr) out.v = out.u;
  out.white = white.empty() ? nullptr : rows.bright(group);
  return out;
}

// Without light from the projector nothing can be decoded; with ambient light on it the pixel does
// show a surface, so it lies in the projector's shadow or outside its picture.
void RowDecoder::CheckLight(int group, const float* bright, const float* dark, int count) {
  const auto least = static_cast<float>(context_.config.min_contrast_dn);
  const ExposureGroup& exposure = context_.plan.groups[static_cast<std::size_t>(group)];
  LightArgs args;
  args.bright = bright;
  args.dark = dark;
  args.least = least;
  args.has_black = !exposure.black_frames.empty();
  args.is_first = group == 0;
  args.light = light_.data();
  context_.kernels.check_light(args, count);
}

}  // namespace fringe_fusion::decode
