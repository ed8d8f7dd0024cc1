// fringe inspect: deviation of a mesh or cloud from a reference, both ways.
#include <filesystem>

#include "command.hpp"
#include "figures.hpp"
#include "fringe_fusion/inspection/compare.hpp"
#include "fringe_fusion/inspection/picture.hpp"
#include "fringe_fusion/inspection/report.hpp"
#include "fringe_fusion/inspection/visible_faces.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "staged_folder.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

struct InspectOptions {
  std::string mesh;
  std::string reference;
  std::string unit;
  std::string mesh_unit = "m";
  std::string visible;
  std::string report;
  double limit_mm = 0.0;
};

void Declare(Command& command, InspectOptions& options) {
  const std::vector<std::string> units = {"m", "mm"};
  command.AddOption("--mesh", options.mesh, "Mesh or cloud to inspect: .ply, .stl, .obj, .pcd")
      .Required()
      .TypeName("MESH.ply");
  command.AddOption("--reference", options.reference, "Reference mesh in the same frame")
      .Required()
      .TypeName("REF.ply|.stl|.obj");
  command.AddOption("--unit", options.unit, "Unit of the reference").Required().OneOf(units);
  command.AddOption("--mesh-unit", options.mesh_unit, "Unit of the inspected mesh")
      .OneOf(units)
      .ShowDefault();
  command
      .AddOption("--visible", options.visible,
                 "Which faces of the reference the cell could see: a mesh of just those (truth/"
                 "visible.ply of a simulated scan), or .txt with 0 or 1 per face; the reference "
                 "counts only there")
      .TypeName("FILE");
  command
      .AddOption("--report", options.report,
                 "Write report.html, deviation.png and deviation.ply to this folder")
      .TypeName("DIR");
  command
      .AddOption("--limit-mm", options.limit_mm,
                 "Ends of the colour scale [mm] (default: three times the 95 % deviation)")
      .InRange(1e-6, 1e6)
      .TypeName("MM");
}

double UnitMetres(const std::string& unit) { return unit == "mm" ? 1e-3 : 1.0; }

/// A hint where the sizes of mesh and reference differ as only units do; "" elsewhere.
std::string UnitAdvice(const InspectOptions& options, const Mesh& mesh, const Mesh& reference) {
  if (mesh.vertices.empty() || reference.vertices.empty()) return "";
  constexpr double kUnlikelyRatio = 30.0;
  const double ratio = BoxDiagonal(mesh) / BoxDiagonal(reference);
  const bool too_small = ratio > kUnlikelyRatio;
  const bool too_large = ratio < 1.0 / kUnlikelyRatio;
  if (too_small && options.unit == "mm") return " (try --unit m)";
  if (too_large && options.unit == "m") return " (try --unit mm)";
  if (too_large && options.mesh_unit == "mm") return " (try --mesh-unit m)";
  if (too_small && options.mesh_unit == "m") return " (try --mesh-unit mm)";
  return "";
}

Status WriteDeviationReport(const InspectOptions& options, Mesh mesh,
                            const InspectionResult& result) {
  auto folder = StagedFolder::Create(options.report);
  if (!folder) return tl::unexpected(folder.error());
  const double limit_m = options.limit_mm > 0.0
                             ? options.limit_mm * 1e-3
                             : std::max(1e-6, 3.0 * result.model_to_reference.p95_abs_m);
  mesh.colors = DeviationColors(result.deviation_m, limit_m);
  const fs::path path = folder->path();
  if (Status status = WriteMesh(mesh, (path / "deviation.ply").string()); !status) return status;
  Report report;
  report.title = "Inspection";
  report.paragraphs = {fmt::format(
      "{} against {}. Nothing is aligned: both are taken in the same frame. Positive "
      "deviation is material outside the reference.",
      fs::path(options.mesh).filename().string(), fs::path(options.reference).filename().string())};
  report.tables = {InspectionTable(result)};
  if (!mesh.faces.empty()) {
    const auto picture = RenderMesh(mesh, Eigen::Vector3f(0.6F, -0.7F, 0.4F), 1000, 800, true);
    if (!picture) return Forward(picture);
    const std::string file = (path / "deviation.png").string();
    if (Status status = WriteImage(WithColorBar(*picture, limit_m * 1e3), file); !status) {
      return status;
    }
    report.pictures = {{"Signed deviation", "deviation.png"}};
  }
  if (Status status = WriteReport(report, (path / "report.html").string()); !status) return status;
  return folder->Commit();
}

Status Inspect(const InspectOptions& options, Session& session) {
  const auto config = session.LoadStage<InspectionConfig>("inspection");
  if (!config) return Forward(config);
  session.console.Begin("load", 1);
  auto mesh = ReadMesh(options.mesh, UnitMetres(options.mesh_unit));
  if (!mesh) return Forward(mesh);
  const auto reference = ReadMesh(options.reference, UnitMetres(options.unit));
  if (!reference) return Forward(reference);
  std::optional<std::vector<std::uint8_t>> visible;
  if (!options.visible.empty()) {
    auto flags = ReadVisibleFaces(options.visible, *reference, UnitMetres(options.unit));
    if (!flags) return Forward(flags);
    visible = std::move(*flags);
  }
  session.console.End();
  session.console.Begin("compare", 1);
  const auto result = Compare(*mesh, *reference, *config, visible, session.console.Part(0));
  if (!result) {
    return Fail("{} against {}: {}{}", options.mesh, options.reference, result.error().message,
                UnitAdvice(options, *mesh, *reference));
  }
  session.console.End();
  session.figures.Set("inspection", InspectionFigures(*result).Set("complete_distance_m",
                                                                   config->complete_distance_m));
  fmt::print(
      "model to reference: rms {:.4f} mm, 95 % {:.4f} mm, max {:.4f} mm ({} of {} farther)\n",
      result->model_to_reference.rms_m * 1e3, result->model_to_reference.p95_abs_m * 1e3,
      result->model_to_reference.max_abs_m * 1e3, result->model_to_reference.num_far,
      result->model_to_reference.num_far + result->model_to_reference.count);
  fmt::print("reference to model: rms {:.4f} mm, 95 % {:.4f} mm, max {:.4f} mm\n",
             result->reference_to_model.rms_m * 1e3, result->reference_to_model.p95_abs_m * 1e3,
             result->reference_to_model.max_abs_m * 1e3);
  fmt::print("completeness: {:.2f} % within {:.4g} mm\n", 100.0 * result->completeness_ratio,
             config->complete_distance_m * 1e3);
  if (options.report.empty()) return {};
  return WriteDeviationReport(options, std::move(*mesh), *result);
}

}  // namespace

void AddInspect(Tool& tool) {
  AddCommand<InspectOptions>(tool, "inspect",
                             "Signed deviation of a mesh or cloud from a reference, both ways",
                             Declare, Inspect);
}

}  // namespace fringe_fusion::cli
