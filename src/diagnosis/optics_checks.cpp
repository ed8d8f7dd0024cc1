#include "optics_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "edge_blur.hpp"
#include "fringe_measures.hpp"
#include "panel_scale.hpp"

namespace fringe_fusion::diagnosis {
namespace {

constexpr std::size_t kMaxPanelPixels = 400;
// A scale is believed when the epipolar lines are missed by more, and by far less after scaling:
// codes that are blurred miss them whatever the scale.
constexpr double kMinPanelDistancePx = 1.0;
constexpr double kMaxPanelRest = 0.2;
constexpr int kMinBlurEdges = 30;

std::optional<PanelScale> MeasurePanel(const OpticsInput& input) {
  const FrameOrder& order = input.order;
  std::vector<CodedPixel> coded;
  const std::size_t step = std::max<std::size_t>(1, order.pixels.size() / kMaxPanelPixels);
  for (std::size_t k = 0; k < order.pixels.size(); k += step) {
    if (!std::isfinite(order.u_px[k]) || !std::isfinite(order.v_px[k])) return std::nullopt;
    const auto width = static_cast<std::size_t>(input.stack.width());
    coded.push_back({static_cast<double>(order.pixels[k] % width) * input.stack.stride,
                     static_cast<double>(order.pixels[k] / width) * input.stack.stride,
                     order.u_px[k], order.v_px[k]});
  }
  if (coded.empty()) return std::nullopt;
  return FitPanelScale(coded, *input.calibration);
}

// Whether the code of an axis tells where on it a pixel lies.
bool IsAbsolute(const PatternSequence& sequence, Axis axis) {
  std::vector<double> fringes;
  for (const Pattern& pattern : sequence.frames) {
    if (pattern.axis != axis) continue;
    if (pattern.kind == PatternKind::kGray) return true;
    if (pattern.kind == PatternKind::kPhase || pattern.kind == PatternKind::kMicro) {
      fringes.push_back(pattern.fringes);
    }
  }
  return !fringes.empty() && RepeatRatio(fringes, 1e-3) >= 1.0;
}

void CheckResolution(const OpticsInput& input, const DiagnosisConfig& config, Findings& findings) {
  constexpr const char* kQuantity = "distance of the projected picture's scale from 1";
  constexpr FindingKind kKind = FindingKind::kResolution;
  if (!input.calibration) {
    findings.Skip(kKind, kQuantity, "needs the calibration of the scanner");
    return;
  }
  const bool both = IsAbsolute(input.sequence, Axis::kU) && IsAbsolute(input.sequence, Axis::kV);
  const std::optional<PanelScale> panel = both ? MeasurePanel(input) : std::nullopt;
  if (!panel) {
    findings.Skip(kKind, kQuantity, "needs absolute codes on both axes");
    return;
  }
  const bool scaled = panel->distance_px > kMinPanelDistancePx &&
                      panel->scaled_px < kMaxPanelRest * panel->distance_px;
  const double value = scaled ? std::abs(panel->scale - 1.0) : 0.0;
  if (findings.Measure(kKind, kQuantity, value, config.max_scale_error_ratio, "")) return;
  findings.Explain(
      fmt::format(
          "codes miss the epipolar lines by {:.1f} px, and by {:.1f} px when the picture is "
          "scaled by {:.3f}, limit 1 +- {:.3f}",
          panel->distance_px, panel->scaled_px, panel->scale, config.max_scale_error_ratio),
      fmt::format("drive the projector with its own {} x {} pixels: check the display mode, "
                  "scaling, overscan and keystone correction",
                  input.sequence.width, input.sequence.height));
}

// @return whether the camera is sharp, or cannot be judged.
bool CheckCamera(const OpticsInput& input, const DiagnosisConfig& config, Findings& findings) {
  constexpr const char* kQuantity = "blur of the sharper edges, sigma";
  const EdgeBlur blur = MeasureEdgeBlur(input.mean_image);
  if (blur.num_edges < kMinBlurEdges) {
    findings.Skip(FindingKind::kCameraDefocus, kQuantity,
                  fmt::format("{} edges in the image, needs {}", blur.num_edges, kMinBlurEdges));
    return true;
  }
  if (findings.Measure(FindingKind::kCameraDefocus, kQuantity, blur.sigma_px,
                       config.max_camera_blur_px, "px")) {
    return true;
  }
  findings.Explain(fmt::format("the sharper of {} edges are blurred by {:.2f} px (sigma), limit "
                               "{:.2f} px",
                               blur.num_edges, blur.sigma_px, config.max_camera_blur_px),
                   "focus the camera on the part, close its aperture, or clean its lens");
  return false;
}

bool CheckProjector(const FringeMeasures& fringes, bool camera_is_sharp,
                    const DiagnosisConfig& config, Findings& findings) {
  constexpr const char* kQuantity = "amplitude of the finest over the coarsest fringes";
  constexpr FindingKind kKind = FindingKind::kProjectorDefocus;
  if (!fringes.skipped.empty() || !camera_is_sharp) {
    findings.Skip(kKind, kQuantity,
                  camera_is_sharp ? fringes.skipped : "the camera blurs the fringes already");
    return camera_is_sharp;
  }
  if (findings.Measure(kKind, kQuantity, fringes.fine_contrast, config.min_fine_contrast, "",
                       true)) {
    return true;
  }
  findings.Explain(
      fmt::format("{:g} fringes keep {:.0f} % of the amplitude of the coarsest while edges are "
                  "sharp in the camera, must be at least {:.0f} %",
                  fringes.fine_fringes, 100.0 * fringes.fine_contrast,
                  100.0 * config.min_fine_contrast),
      "focus the projector on the part, or use fewer fringes");
  return false;
}

void CheckInterreflection(const FringeMeasures& fringes, const std::string& spoiled,
                          const DiagnosisConfig& config, Findings& findings) {
  constexpr const char* kQuantity = "error of the coarsest phase over parts of the image, rms";
  constexpr FindingKind kKind = FindingKind::kInterreflection;
  std::string why = fringes.skipped.empty() ? fringes.indirect_skipped : fringes.skipped;
  if (why.empty()) why = spoiled;
  if (!why.empty()) {
    findings.Skip(kKind, kQuantity, why);
    return;
  }
  if (findings.Measure(kKind, kQuantity, fringes.indirect_rad, config.max_indirect_rad, "rad")) {
    return;
  }
  findings.Explain(
      fmt::format(
          "coarse and fine fringes disagree by {:.4f} rad of the coarsest over parts of the "
          "image, limit {:.4f} rad: light arrives by way of other surfaces",
          fringes.indirect_rad, config.max_indirect_rad),
      "use micro or modulated phase shifting (pattern.yaml: micro, carrier_period_px), tilt the "
      "part so that its walls do not face each other, or dull its surface");
}

}  // namespace

void CheckOptics(const OpticsInput& input, const DiagnosisConfig& config, Findings& findings) {
  const bool unsteady = findings.Any();
  CheckResolution(input, config, findings);
  const FringeMeasures fringes = MeasureFringes(input.stack, input.plan, input.range);
  const bool camera = CheckCamera(input, config, findings);
  const bool projector = CheckProjector(fringes, camera, config, findings);
  std::string spoiled;
  if (unsteady) spoiled = "an earlier finding disturbs the phases as well";
  if (!projector) spoiled = "the finest fringes are blurred";
  CheckInterreflection(fringes, spoiled, config, findings);
}

}  // namespace fringe_fusion::diagnosis
