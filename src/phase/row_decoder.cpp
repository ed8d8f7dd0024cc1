#include "row_decoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace fringe_fusion::decode {
namespace {

constexpr int kLongestStretch = 256;
constexpr int kVectors = 64;  // bytes that the kernels take at once
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
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
}

void RowDecoder::Run(int y, const MapRow& row) {
  const int width = Width(stack_.frames.front());
  for (int begin = 0; begin < width; begin += context_.width) {
    const int count = std::min(context_.width, width - begin);
    const MapRow out = From(row, begin);
    const Decoded decoded = Decode(y, begin, count);
    ComposeArgs args;
    args.u = InputOf(*decoded.u);
    args.v = InputOf(*decoded.v);
    args.light = light_.data();
    args.texture = out.rgb != nullptr && decoded.white == nullptr ? texture_.data() : nullptr;
    args.out = out;
    context_.kernels.compose(args, count);
    if (out.rgb != nullptr) {
      // The white frame at the exposure of the scan, or A + B where none was taken.
      const float* grey = decoded.white == nullptr ? texture_.data() : decoded.white;
      context_.kernels.to_rgb(grey, context_.full_scale_dn, out.rgb, count);
    }
    if (out.order_error != nullptr) StoreOrderError(*decoded.u, *decoded.v, count, out);
  }
}

RowDecoder::Decoded RowDecoder::Decode(int y, int begin, int count) {
  if (!ladder_ || !ladder_->Run(y, begin, count)) return DecodeGeneral(y, begin);
  CheckLight(0, ladder_->bright(), ladder_->dark());
  const bool has_white = !context_.plan.groups.front().white_frames.empty();
  return {&ladder_->u(), &ladder_->v(), has_white ? ladder_->bright() : nullptr};
}

RowDecoder::Decoded RowDecoder::DecodeGeneral(int y, int begin) {
  if (!general_) general_.emplace(stack_, context_);
  FrameRows& rows = general_->rows;
  rows.Load(y, begin);
  for (std::size_t i = 0; i < context_.plan.groups.size(); ++i) {
    const int group = static_cast<int>(i);
    CheckLight(group, rows.bright(group), rows.dark(group));
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
void RowDecoder::CheckLight(int group, const float* bright, const float* dark) {
  const auto least = static_cast<float>(context_.config.min_contrast_dn);
  const ExposureGroup& exposure = context_.plan.groups[static_cast<std::size_t>(group)];
  LightArgs args;
  args.bright = bright;
  args.dark = dark;
  args.least = least;
  args.has_black = !exposure.black_frames.empty();
  args.is_first = group == 0;
  args.light = light_.data();
  context_.kernels.check_light(args, context_.width);
}

}  // namespace fringe_fusion::decode
