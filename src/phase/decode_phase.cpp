#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "axis_decoder.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/phase/phase_map.hpp"
#include "gray_cells.hpp"
#include "gray_smoothing.hpp"
#include "phase_mask.hpp"
#include "spatial_unwrap.hpp"

namespace fringe_fusion {
namespace {

using decode::AxisDecoder;
using decode::AxisPlan;
using decode::AxisRow;
using decode::CoordinateImage;
using decode::DecodeContext;
using decode::DecodePlan;
using decode::FrameRows;
using decode::Unwrapping;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr int kRowsPerChunk = 16;
constexpr int kRowsPerReport = 256;

// The images are made side by side: touching that much fresh memory takes as long as decoding.
PhaseMap MakePhaseMap(const ImageStack& stack, const DecodePlan& plan, const PhaseConfig& config) {
  PhaseMap map;
  map.width = Width(stack.frames.front());
  map.height = Height(stack.frames.front());
  std::vector<Image<float>*> images = {&map.offset, &map.modulation};
  if (plan.u.IsCoded()) images.insert(images.end(), {&map.u, &map.sigma_u});
  if (plan.v.IsCoded()) images.insert(images.end(), {&map.v, &map.sigma_v});
  if (config.report_order_error) images.push_back(&map.order_error);
  const int num_images = static_cast<int>(images.size());
  ParallelFor(num_images + 1, 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      if (i < num_images) {
        *images[static_cast<std::size_t>(i)] = Image<float>(map.width, map.height);
      } else {
        map.mask = Image<std::uint8_t>(map.width, map.height);
        map.color = stack.color ? *stack.color : Image<Rgb8>(map.width, map.height);
      }
    }
  });
  map.first_stamp_ns = stack.frames.front().stamp_ns;
  map.last_stamp_ns = stack.frames.back().stamp_ns;
  return map;
}

decode::AxisInput InputOf(const AxisRow& row) {
  return {row.coordinate_px.data(), row.variance_px2.data(), row.offset_dn.data(),
          row.amplitude2_dn2.data(), row.status.data()};
}

/// Decoders of one thread's chunk of rows.
class RowDecoder {
 public:
  RowDecoder(const ImageStack& stack, const DecodeContext& context)
      : context_(context),
        has_color_(stack.color.has_value()),
        rows_(stack, context),
        light_(context.stride()),
        texture_(context.stride()) {
    if (context.plan.u.IsCoded()) u_.emplace(context.plan.u, context);
    if (context.plan.v.IsCoded()) v_.emplace(context.plan.v, context);
  }

  void Run(int y, PhaseMap& map) {
    rows_.Load(y);
    CheckLight();
    const AxisRow* u = u_ ? &u_->Run(rows_) : nullptr;
    const AxisRow* v = v_ ? &v_->Run(rows_) : nullptr;
    if (u == nullptr) u = v;
    if (v == nullptr) v = u;
    decode::ComposeArgs args;
    args.u = InputOf(*u);
    args.v = InputOf(*v);
    args.light = light_.data();
    args.u_px = u_ ? map.u.row(y) : nullptr;
    args.v_px = v_ ? map.v.row(y) : nullptr;
    args.sigma_u_px = u_ ? map.sigma_u.row(y) : nullptr;
    args.sigma_v_px = v_ ? map.sigma_v.row(y) : nullptr;
    args.offset = map.offset.row(y);
    args.modulation = map.modulation.row(y);
    args.mask = map.mask.row(y);
    context_.kernels.compose(args, map.width);
    if (!has_color_) StoreTexture(y, map);
    if (!map.order_error.empty()) StoreOrderError(*u, *v, y, map);
  }

 private:
  // Without light from the projector nothing can be decoded; with ambient light on it the pixel
  // does show a surface, so it lies in the projector's shadow or outside its picture.
  void CheckLight() {
    const auto least = static_cast<float>(context_.config.min_contrast_dn);
    std::fill(light_.begin(), light_.end(), static_cast<std::int32_t>(MaskReason::kTooDark));
    for (std::size_t i = 0; i < context_.plan.groups.size(); ++i) {
      const int group = static_cast<int>(i);
      decode::LightArgs args{rows_.bright(group), rows_.dark(group), least,
                             !context_.plan.groups[i].black_frames.empty(), light_.data()};
      context_.kernels.check_light(args, context_.width);
    }
  }

  // The white frame at the exposure of the scan, or A + B where none was taken.
  void StoreTexture(int y, PhaseMap& map) {
    const int group = context_.plan.reference_group;
    const float* grey = rows_.bright(group);
    if (context_.plan.groups[static_cast<std::size_t>(group)].white_frames.empty()) {
      const float* offset = map.offset.row(y);
      const float* modulation = map.modulation.row(y);
      for (std::size_t x = 0; x < static_cast<std::size_t>(map.width); ++x) {
        texture_[x] = offset[x] + modulation[x];
      }
      grey = texture_.data();
    }
    static_assert(sizeof(Rgb8) == 3, "the picture is written as bytes");
    context_.kernels.to_rgb(grey, context_.full_scale_dn, &map.color.row(y)->r, map.width);
  }

  static void StoreOrderError(const AxisRow& u, const AxisRow& v, int y, PhaseMap& map) {
    for (int x = 0; x < map.width; ++x) {
      const auto i = static_cast<std::size_t>(x);
      const float odds = std::min(u.log_odds[i], v.log_odds[i]);
      map.order_error(x, y) = map.mask(x, y) == 0 || map.mask(x, y) == kDoubtful
                                  ? 1.0F / (1.0F + std::exp(odds))
                                  : kNan;
    }
  }

  static constexpr auto kDoubtful = static_cast<std::uint8_t>(MaskReason::kDoubtfulOrder);

  DecodeContext context_;
  bool has_color_ = false;
  FrameRows rows_;
  std::optional<AxisDecoder> u_;
  std::optional<AxisDecoder> v_;
  std::vector<std::int32_t> light_;
  std::vector<float> texture_;
};

Status DecodeRows(const ImageStack& stack, const DecodeContext& context, const Progress& progress,
                  PhaseMap& map) {
  for (int first = 0; first < map.height; first += kRowsPerReport) {
    if (!progress("decode", static_cast<double>(first) / map.height)) return Fail("{}", kCancelled);
    const int count = std::min(kRowsPerReport, map.height - first);
    ParallelFor(count, kRowsPerChunk, [&](int begin, int end) {
      RowDecoder decoder(stack, context);
      for (int y = first + begin; y < first + end; ++y) decoder.Run(y, map);
    });
  }
  return {};
}

void SmoothGrayAxis(const PhaseConfig& config, Image<float>& value, Image<float>& sigma) {
  CoordinateImage smooth =
      decode::SmoothGrayCode({std::move(value), std::move(sigma)}, config.gray_fit_radius_px,
                             static_cast<float>(config.max_edge_step_px));
  value = std::move(smooth.value_px);
  sigma = std::move(smooth.sigma_px);
}

// A Gray code alone has whole cells: their rounding is taken out here.
PhaseMap RefineGrayCode(PhaseMap map, const DecodePlan& plan, const PhaseConfig& config) {
  const bool gray_u = plan.u.IsGrayAlone();
  const bool gray_v = plan.v.IsGrayAlone();
  if (gray_u && gray_v && config.gray_one_per_cell) {
    return decode::KeepOnePixelPerCell(std::move(map), *plan.u.gray, *plan.v.gray, config);
  }
  if (config.gray_fit_radius_px == 0) return map;
  if (gray_u) SmoothGrayAxis(config, map.u, map.sigma_u);
  if (gray_v) SmoothGrayAxis(config, map.v, map.sigma_v);
  return map;
}

// The edge mask looks for jumps, so the jumps of the wrapped phase go first.
void UnwrapRelative(const DecodePlan& plan, PhaseMap& map) {
  const auto unwrap = [](const AxisPlan& axis, Image<float>& coordinate) {
    const double period_px = axis.size_px / axis.sets.front().fringes;
    coordinate = decode::UnwrapOverImage(coordinate, period_px);
  };
  map.relative_u = plan.u.IsCoded() && plan.u.unwrapping == Unwrapping::kRelative;
  map.relative_v = plan.v.IsCoded() && plan.v.unwrapping == Unwrapping::kRelative;
  if (map.relative_u) unwrap(plan.u, map.u);
  if (map.relative_v) unwrap(plan.v, map.v);
}

}  // namespace

const char* MaskReasonName(MaskReason reason) {
  switch (reason) {
    case MaskReason::kValid:
      return "valid";
    case MaskReason::kTooDark:
      return "too dark";
    case MaskReason::kLowModulation:
      return "low modulation";
    case MaskReason::kSaturated:
      return "saturated";
    case MaskReason::kEdge:
      return "edge";
    case MaskReason::kResidual:
      return "residual";
    case MaskReason::kDoubtfulOrder:
      return "doubtful order";
    case MaskReason::kOutsideProjector:
      return "outside projector";
    case MaskReason::kShadow:
      return "shadow";
    case MaskReason::kEpipolar:
      return "epipolar";
    case MaskReason::kOutOfRange:
      return "out of range";
    case MaskReason::kIsolated:
      return "isolated";
    case MaskReason::kMerged:
      return "merged";
  }
  return "unknown";
}

Result<PhaseMap> DecodePhase(const ImageStack& stack, const PhaseConfig& config,
                             const Progress& progress) {
  if (Status status = CheckBounds(config, "phase"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  if (Status status = Validate(stack, fmt::format("phase: view {}", stack.view_id)); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const Result<DecodePlan> plan =
      decode::MakeDecodePlan(stack.sequence, decode::TakenExposures(stack));
  if (!plan) return Forward(plan);
  PhaseMap map = MakePhaseMap(stack, *plan, config);
  const auto full_scale_dn = static_cast<float>((1 << stack.frames.front().bit_depth) - 1);
  const DecodeContext context{*plan, config, decode::BestKernels(), map.width, full_scale_dn};
  if (Status status = DecodeRows(stack, context, progress, map); !status) {
    return tl::unexpected<Error>(status.error());
  }
  UnwrapRelative(*plan, map);
  map = decode::MaskEdges(std::move(map), config);
  map = RefineGrayCode(std::move(map), *plan, config);
  if (!progress("decode", 1.0)) return Fail("{}", kCancelled);
  return map;
}

}  // namespace fringe_fusion
