#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "decode_corrected.hpp"
#include "decode_with.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/phase/phase_map.hpp"
#include "gray_cells.hpp"
#include "gray_smoothing.hpp"
#include "phase_mask.hpp"
#include "row_decoder.hpp"
#include "spatial_unwrap.hpp"

namespace fringe_fusion {
namespace {

using decode::AxisPlan;
using decode::CoordinateImage;
using decode::DecodeContext;
using decode::DecodePlan;
using decode::RowDecoder;
using decode::Unwrapping;

constexpr int kRowsPerReport = 8 * decode::EdgeMask::kRowsPerChunk;

template <typename T>
Image<T> Fit(Image<T> image, int width, int height) {
  // A map that was moved from has its size and no pixels.
  const bool fits = !image.empty() && image.width() == width && image.height() == height;
  return fits ? std::move(image) : Image<T>(width, height);
}

// In the memory of another map, as far as it fits; every pixel is written by the decoder. New
// images are made side by side: touching that much fresh memory takes as long as decoding.
PhaseMap MakePhaseMap(const ImageStack& stack, const DecodePlan& plan, const PhaseConfig& config,
                      PhaseMap map) {
  map.width = Width(stack.frames.front());
  map.height = Height(stack.frames.front());
  const std::array<std::pair<Image<float>*, bool>, 7> images = {{
      {&map.u, plan.u.IsCoded()},
      {&map.sigma_u, plan.u.IsCoded()},
      {&map.v, plan.v.IsCoded()},
      {&map.sigma_v, plan.v.IsCoded()},
      {&map.offset, true},
      {&map.modulation, true},
      {&map.order_error, config.report_order_error},
  }};
  const int num_images = static_cast<int>(images.size());
  ParallelFor(num_images + 1, 1, [&](int i, int /*end*/) {
    if (i < num_images) {
      const auto& [image, wanted] = images[static_cast<std::size_t>(i)];
      *image = wanted ? Fit(std::move(*image), map.width, map.height) : Image<float>();
    } else {
      map.mask = Fit(std::move(map.mask), map.width, map.height);
      map.color = Fit(std::move(map.color), map.width, map.height);
    }
  });
  if (stack.color) map.color = *stack.color;
  map.relative_u = map.relative_v = false;
  map.first_stamp_ns = stack.frames.front().stamp_ns;
  map.last_stamp_ns = stack.frames.back().stamp_ns;
  return map;
}

decode::MapRow RowOf(PhaseMap& map, int y, bool with_color) {
  const auto row = [y](Image<float>& image) { return image.empty() ? nullptr : image.row(y); };
  static_assert(sizeof(Rgb8) == 3, "the picture is written as bytes");
  decode::MapRow out;
  out.u_px = row(map.u);
  out.v_px = row(map.v);
  out.sigma_u_px = row(map.sigma_u);
  out.sigma_v_px = row(map.sigma_v);
  out.offset = row(map.offset);
  out.modulation = row(map.modulation);
  out.mask = map.mask.row(y);
  out.rgb = with_color ? &map.color.row(y)->r : nullptr;
  out.order_error = row(map.order_error);
  return out;
}

// @param edges of the map, or null when they are masked later.
Status DecodeRows(const ImageStack& stack, const DecodeContext& context, const Progress& progress,
                  PhaseMap& map, decode::EdgeMask* edges) {
  for (int first = 0; first < map.height; first += kRowsPerReport) {
    if (!progress("decode", static_cast<double>(first) / map.height)) return Fail("{}", kCancelled);
    const int count = std::min(kRowsPerReport, map.height - first);
    ParallelFor(count, decode::EdgeMask::kRowsPerChunk, [&](int begin, int end) {
      RowDecoder decoder(stack, context);
      std::optional<decode::EdgeMask::Chunk> chunk;
      if (edges != nullptr) chunk.emplace(*edges, first + begin, first + end);
      for (int y = first + begin; y < first + end; ++y) {
        decoder.Run(y, RowOf(map, y, !stack.color.has_value()));
        if (chunk) chunk->Add(y);
      }
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

bool IsRelative(const AxisPlan& axis) {
  return axis.IsCoded() && axis.unwrapping == Unwrapping::kRelative;
}

void UnwrapRelative(const DecodePlan& plan, PhaseMap& map) {
  const auto unwrap = [](const AxisPlan& axis, Image<float>& coordinate) {
    const double period_px = axis.size_px / axis.sets.front().fringes;
    coordinate = decode::UnwrapOverImage(coordinate, period_px);
  };
  map.relative_u = IsRelative(plan.u);
  map.relative_v = IsRelative(plan.v);
  if (map.relative_u) unwrap(plan.u, map.u);
  if (map.relative_v) unwrap(plan.v, map.v);
}

// Edges are masked row by row, or at the end where the jumps of the wrapped phase have to go first.
Status DecodeAndMask(const ImageStack& stack, const DecodeContext& context,
                     const Progress& progress, PhaseMap& map) {
  const DecodePlan& plan = context.plan;
  if (IsRelative(plan.u) || IsRelative(plan.v)) {
    if (Status status = DecodeRows(stack, context, progress, map, nullptr); !status) return status;
    UnwrapRelative(plan, map);
    map = decode::MaskEdges(std::move(map), context.config, context.kernels);
    return {};
  }
  decode::EdgeMask edges(map, context.config, context.kernels);
  if (Status status = DecodeRows(stack, context, progress, map, &edges); !status) return status;
  edges.Finish();
  return {};
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
                             const Progress& progress, PhaseMap recycled) {
  return decode::DecodeWith(decode::BestKernels(), stack, config, progress, std::move(recycled));
}

Result<PhaseMap> decode::DecodeWith(const Kernels& kernels, const ImageStack& stack,
                                    const PhaseConfig& config, const Progress& progress,
                                    PhaseMap recycled, const PhaseCorrection* correction) {
  if (Status status = CheckBounds(config, "phase"); !status) {
    return tl::unexpected<Error>(status.error());
  }
  if (Status status = Validate(stack, fmt::format("phase: view {}", stack.view_id)); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const Result<DecodePlan> plan =
      decode::MakeDecodePlan(stack.sequence, decode::TakenExposures(stack));
  if (!plan) return Forward(plan);
  if (correction != nullptr) {
    Status status = decode::CheckCorrectable(*plan);
    if (status) status = decode::CheckTables(*plan, *correction);
    if (!status) return tl::unexpected<Error>(status.error());
  }
  PhaseMap map = MakePhaseMap(stack, *plan, config, std::move(recycled));
  const auto full_scale_dn = static_cast<float>((1 << stack.frames.front().bit_depth) - 1);
  const DecodeContext context{*plan,         config,    kernels, decode::StretchWidth(map.width),
                              full_scale_dn, correction};
  if (Status status = DecodeAndMask(stack, context, progress, map); !status) {
    return tl::unexpected<Error>(status.error());
  }
  map = RefineGrayCode(std::move(map), *plan, config);
  if (!progress("decode", 1.0)) return Fail("{}", kCancelled);
  return map;
}

}  // namespace fringe_fusion
