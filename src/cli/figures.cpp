#include "figures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace fringe_fusion::cli {
namespace {

std::string Millimetres(double value_m) { return fmt::format("{:.4f}", value_m * 1e3); }

Json StatisticsFigures(const DistanceStatistics& statistics) {
  return Json()
      .Set("count", statistics.count)
      .Set("num_far", statistics.num_far)
      .Set("mean_m", statistics.mean_m)
      .Set("rms_m", statistics.rms_m)
      .Set("median_abs_m", statistics.median_abs_m)
      .Set("p95_abs_m", statistics.p95_abs_m)
      .Set("max_abs_m", statistics.max_abs_m);
}

std::vector<std::string> StatisticsRow(const std::string& name,
                                       const DistanceStatistics& statistics) {
  return {name,
          std::to_string(statistics.count),
          std::to_string(statistics.num_far),
          Millimetres(statistics.mean_m),
          Millimetres(statistics.rms_m),
          Millimetres(statistics.median_abs_m),
          Millimetres(statistics.p95_abs_m),
          Millimetres(statistics.max_abs_m)};
}

}  // namespace

double Median(const Image<float>& values) {
  std::vector<float> finite;
  std::copy_if(values.begin(), values.end(), std::back_inserter(finite),
               [](float value) { return std::isfinite(value); });
  if (finite.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = finite.begin() + static_cast<std::ptrdiff_t>(finite.size() / 2);
  std::nth_element(finite.begin(), middle, finite.end());
  return static_cast<double>(*middle);
}

ReasonCount CountReasons(const Image<std::uint8_t>& mask) {
  ReasonCount counts{};
  for (const std::uint8_t reason : mask) {
    if (reason < kNumMaskReasons) ++counts[reason];
  }
  return counts;
}

std::string ReasonCounts(const Image<std::uint8_t>& mask) {
  const auto counts = CountReasons(mask);
  std::vector<std::string> words;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    words.push_back(fmt::format("{} {}", counts[i], MaskReasonName(static_cast<MaskReason>(i))));
  }
  return fmt::format("{}", fmt::join(words, ", "));
}

Json PhaseFigures(int view_id, const PhaseMap& phase) {
  const auto counts = CountReasons(phase.mask);
  Json reasons;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    reasons.Set(MaskReasonName(static_cast<MaskReason>(i)), counts[i]);
  }
  Json figures;
  figures.Set("view", view_id).Set("pixels", reasons);
  if (!phase.sigma_u.empty()) figures.Set("median_sigma_u_px", Median(phase.sigma_u));
  if (!phase.sigma_v.empty()) figures.Set("median_sigma_v_px", Median(phase.sigma_v));
  return figures.Set("median_modulation_dn", Median(phase.modulation));
}

Json RangeFigures(int view_id, const TriangulationResult& result) {
  Json figures;
  figures.Set("view", view_id).Set("num_points", CountValid(result.range));
  figures.Set("median_sigma_range_m", Median(result.range.sigma_range));
  return figures.Set("median_abs_epipolar_px", result.epipolar_residual_px.empty()
                                                   ? std::numeric_limits<double>::quiet_NaN()
                                                   : result.median_abs_epipolar_px);
}

namespace {
// Per axis, from three diagonal elements of a pose covariance.
double RmsSigma(const Matrix6d& covariance, Eigen::Index first) {
  return std::sqrt(covariance.diagonal().segment<3>(first).sum() / 3.0);
}
}  // namespace

Json RegistrationFigures(const RegistrationResult& result) {
  std::vector<Json> views;
  for (const RegisteredView& view : result.views) {
    views.push_back(Json()
                        .Set("view", view.id)
                        .Set("overlap_ratio", view.overlap_ratio)
                        .Set("rms_m", view.rms_m)
                        .Set("connected", view.connected)
                        .Set("information", view.information)
                        .Set("weak_directions", view.weak_directions)
                        .Set("prior_sigma", view.prior_sigma)
                        .Set("moved_m", view.prior_shift_m)
                        .Set("turned_rad", view.prior_turn_rad)
                        .Set("doubled_m", view.doubled_m)
                        .Set("sigma_rotation_rad", RmsSigma(view.pose.covariance, 0))
                        .Set("sigma_translation_m", RmsSigma(view.pose.covariance, 3)));
  }
  std::vector<Json> warnings;
  for (const std::string& warning : result.warnings)
    warnings.push_back(Json().Set("text", warning));
  return Json()
      .Set("rms_before_m", result.rms_before_m)
      .Set("rms_after_m", result.rms_after_m)
      .Set("iterations", result.iterations)
      .Set("converged", result.converged)
      .Set("recovered", result.recovered)
      .Set("views", views)
      .Set("warnings", warnings);
}

Json MeshFigures(const Mesh& mesh) {
  return Json()
      .Set("num_vertices", mesh.vertices.size())
      .Set("num_faces", mesh.faces.size())
      .Set("area_m2", Area(mesh));
}

Json FillStageFigures(const FillFigures& figures) {
  return Json()
      .Set("grid_m", figures.grid_m)
      .Set("num_empty", figures.num_empty)
      .Set("num_unknown", figures.num_unknown)
      .Set("num_filled", figures.num_filled)
      .Set("num_left", figures.num_left)
      .Set("num_filled_faces", figures.num_filled_faces)
      .Set("num_open_edges", figures.num_open_edges);
}

Json InspectionFigures(const InspectionResult& result) {
  return Json()
      .Set("model_to_reference", StatisticsFigures(result.model_to_reference))
      .Set("reference_to_model", StatisticsFigures(result.reference_to_model))
      .Set("completeness_ratio", result.completeness_ratio);
}

Report::Table RegistrationTable(const RegistrationResult& result) {
  Report::Table table;
  table.title =
      fmt::format("Registration: residual {} mm at the prior poses, {} mm after {} iterations{}",
                  Millimetres(result.rms_before_m), Millimetres(result.rms_after_m),
                  result.iterations, result.converged ? "" : " (not converged)");
  table.header = {"view", "overlap [%]", "rms [mm]", "connected", "placed by", "sigma [mm]"};
  for (const RegisteredView& view : result.views) {
    table.rows.push_back({std::to_string(view.id), fmt::format("{:.1f}", 100 * view.overlap_ratio),
                          Millimetres(view.rms_m), view.connected ? "yes" : "no", view.information,
                          fmt::format("{:.4f}", 1e3 * RmsSigma(view.pose.covariance, 3))});
  }
  return table;
}

Report::Table MaskTable(const std::vector<std::string>& views,
                        const std::vector<ReasonCount>& masks) {
  Report::Table table;
  table.title = "Pixels by what became of them";
  table.header = {"view"};
  table.rows.resize(views.size());
  for (std::size_t i = 0; i < views.size(); ++i) table.rows[i] = {views[i]};
  for (std::size_t reason = 0; reason < kNumMaskReasons; ++reason) {
    const bool occurs = std::any_of(masks.begin(), masks.end(),
                                    [reason](const ReasonCount& mask) { return mask[reason] > 0; });
    if (!occurs) continue;
    table.header.emplace_back(MaskReasonName(static_cast<MaskReason>(reason)));
    for (std::size_t i = 0; i < views.size(); ++i) {
      table.rows[i].push_back(std::to_string(masks[i][reason]));
    }
  }
  return table;
}

Report::Table MeshTable(const Mesh& mesh) {
  Report::Table table;
  table.title = "Mesh";
  table.header = {"vertices", "faces", "area [cm2]"};
  table.rows = {{std::to_string(mesh.vertices.size()), std::to_string(mesh.faces.size()),
                 fmt::format("{:.2f}", Area(mesh) * 1e4)}};
  return table;
}

Report::Table InspectionTable(const InspectionResult& result) {
  Report::Table table;
  table.title =
      fmt::format("Deviation in mm; completeness {:.2f} %", 100.0 * result.completeness_ratio);
  table.header = {"direction", "samples", "farther", "mean", "rms", "median", "95 %", "max"};
  table.rows = {StatisticsRow("model to reference", result.model_to_reference),
                StatisticsRow("reference to model", result.reference_to_model)};
  return table;
}

}  // namespace fringe_fusion::cli
