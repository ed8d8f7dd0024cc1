#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "axis_decoder.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/phase/phase_map.hpp"
#include "gray_cells.hpp"
#include "gray_smoothing.hpp"
#include "phase_mask.hpp"

namespace fringe_fusion {
namespace {

using decode::AxisDecoder;
using decode::AxisPixel;
using decode::AxisPlan;
using decode::CoordinateImage;
using decode::DecodePlan;
using decode::FrameRows;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr int kRowsPerChunk = 16;
constexpr int kRowsPerReport = 256;

PhaseMap MakePhaseMap(const ImageStack& stack, const DecodePlan& plan) {
  PhaseMap map;
  map.width = Width(stack.frames.front());
  map.height = Height(stack.frames.front());
  const Image<float> empty(map.width, map.height, kNan);
  if (plan.u.IsCoded()) map.u = map.sigma_u = empty;
  if (plan.v.IsCoded()) map.v = map.sigma_v = empty;
  map.offset = empty;
  map.modulation = empty;
  map.mask = Image<std::uint8_t>(map.width, map.height);
  map.color = stack.color ? *stack.color : Image<Rgb8>(map.width, map.height);
  map.first_stamp_ns = stack.frames.front().stamp_ns;
  map.last_stamp_ns = stack.frames.back().stamp_ns;
  return map;
}

// Without light from the projector nothing can be decoded; with ambient light on it the pixel
// does show a surface, so it lies in the projector's shadow or outside its picture.
MaskReason CheckLight(const FrameRows& rows, std::size_t x, const DecodePlan& plan,
                      const PhaseConfig& config) {
  const float contrast = rows.bright()[x] - rows.dark()[x];
  if (contrast >= static_cast<float>(config.min_contrast_dn)) return MaskReason::kValid;
  const bool lit_by_others = !plan.black_frames.empty() &&
                             rows.dark()[x] >= 2.0F * static_cast<float>(config.min_contrast_dn);
  return lit_by_others ? MaskReason::kShadow : MaskReason::kTooDark;
}

Rgb8 GreyOf(float grey_dn, float full_scale_dn) {
  const float byte = std::clamp(255.0F * grey_dn / full_scale_dn, 0.0F, 255.0F);
  const auto value = static_cast<std::uint8_t>(std::lround(byte));
  return {value, value, value};
}

/// Decoders of one thread's chunk of rows.
class RowDecoder {
 public:
  RowDecoder(const ImageStack& stack, const DecodePlan& plan, const PhaseConfig& config)
      : plan_(plan), config_(config), has_color_(stack.color.has_value()), rows_(stack, plan) {
    if (plan.u.IsCoded()) u_.emplace(plan.u, config, rows_.width());
    if (plan.v.IsCoded()) v_.emplace(plan.v, config, rows_.width());
  }

  void Run(int y, PhaseMap& map) {
    rows_.Load(y);
    if (u_) u_->Run(rows_);
    if (v_) v_->Run(rows_);
    for (int x = 0; x < map.width; ++x) DecodePixel(x, y, map);
  }

 private:
  void DecodePixel(int x, int y, PhaseMap& map) {
    const auto column = static_cast<std::size_t>(x);
    AxisPixel u;
    AxisPixel v;
    if (u_) u = u_->Decode(column, rows_.full_scale_dn());
    if (v_) v = v_->Decode(column, rows_.full_scale_dn());
    if (!u_) u = AxisPixel{kNan, kNan, v.offset_dn, v.modulation_dn, MaskReason::kValid};
    if (!v_) v = AxisPixel{kNan, kNan, u.offset_dn, u.modulation_dn, MaskReason::kValid};
    map.offset(x, y) = 0.5F * (u.offset_dn + v.offset_dn);
    map.modulation(x, y) = std::min(u.modulation_dn, v.modulation_dn);
    if (!has_color_) map.color(x, y) = GreyOf(Texture(column, map, y), rows_.full_scale_dn());
    MaskReason reason = CheckLight(rows_, column, plan_, config_);
    if (reason == MaskReason::kValid) reason = u.reason;
    if (reason == MaskReason::kValid) reason = v.reason;
    map.mask(x, y) = static_cast<std::uint8_t>(reason);
    if (reason != MaskReason::kValid) return;
    if (u_) {
      map.u(x, y) = u.coordinate_px;
      map.sigma_u(x, y) = u.sigma_px;
    }
    if (v_) {
      map.v(x, y) = v.coordinate_px;
      map.sigma_v(x, y) = v.sigma_px;
    }
  }

  // The white frame, or A + B where none was taken.
  [[nodiscard]] float Texture(std::size_t column, const PhaseMap& map, int y) const {
    if (!plan_.white_frames.empty()) return rows_.bright()[column];
    const int x = static_cast<int>(column);
    return map.offset(x, y) + map.modulation(x, y);
  }

  const DecodePlan& plan_;
  const PhaseConfig& config_;
  bool has_color_ = false;
  FrameRows rows_;
  std::optional<AxisDecoder> u_;
  std::optional<AxisDecoder> v_;
};

Status DecodeRows(const ImageStack& stack, const DecodePlan& plan, const PhaseConfig& config,
                  const Progress& progress, PhaseMap& map) {
  for (int first = 0; first < map.height; first += kRowsPerReport) {
    if (!progress("decode", static_cast<double>(first) / map.height)) return Fail("{}", kCancelled);
    const int count = std::min(kRowsPerReport, map.height - first);
    ParallelFor(count, kRowsPerChunk, [&](int begin, int end) {
      RowDecoder decoder(stack, plan, config);
      for (int y = first + begin; y < first + end; ++y) decoder.Run(y, map);
    });
  }
  return {};
}

bool IsGrayAlone(const AxisPlan& plan) { return plan.gray.has_value() && plan.sets.empty(); }

void SmoothGrayAxis(const PhaseConfig& config, Image<float>& value, Image<float>& sigma) {
  CoordinateImage smooth =
      decode::SmoothGrayCode({std::move(value), std::move(sigma)}, config.gray_fit_radius_px,
                             static_cast<float>(config.max_edge_step_px));
  value = std::move(smooth.value_px);
  sigma = std::move(smooth.sigma_px);
}

// A Gray code alone has whole cells: their rounding is taken out here.
PhaseMap RefineGrayCode(PhaseMap map, const DecodePlan& plan, const PhaseConfig& config) {
  const bool gray_u = IsGrayAlone(plan.u);
  const bool gray_v = IsGrayAlone(plan.v);
  if (gray_u && gray_v && config.gray_one_per_cell) {
    return decode::KeepOnePixelPerCell(std::move(map), *plan.u.gray, *plan.v.gray, config);
  }
  if (config.gray_fit_radius_px == 0) return map;
  if (gray_u) SmoothGrayAxis(config, map.u, map.sigma_u);
  if (gray_v) SmoothGrayAxis(config, map.v, map.sigma_v);
  return map;
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
  const Result<DecodePlan> plan = decode::MakeDecodePlan(stack.sequence);
  if (!plan) return Forward(plan);
  PhaseMap map = MakePhaseMap(stack, *plan);
  if (Status status = DecodeRows(stack, *plan, config, progress, map); !status) {
    return tl::unexpected<Error>(status.error());
  }
  map = decode::MaskEdges(std::move(map), config);
  map = RefineGrayCode(std::move(map), *plan, config);
  if (!progress("decode", 1.0)) return Fail("{}", kCancelled);
  return map;
}

}  // namespace fringe_fusion
