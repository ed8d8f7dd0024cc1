#include "fill_option.hpp"

#include "figures.hpp"

namespace fringe_fusion::cli {

void DeclareFill(Command& command, FillOptions& options) {
  const Option fill = command.AddFlag(
      "--fill-holes", options.fill_holes,
      "Close holes where no sensor saw that space is empty; their faces are flagged `filled`");
  const Option max_hole =
      command
          .AddOption("--max-hole-mm", options.max_hole_mm,
                     "Larger holes stay open (default: max_hole_m of fill.yaml)")
          .InRange(1e-3, 1e5)
          .Needs(fill)
          .TypeName("MM");
  command.AddFlag("--watertight", options.watertight, "Close all holes, whatever their size")
      .Excludes(max_hole);
}

Result<std::optional<FillConfig>> LoadFillConfig(const FillOptions& options,
                                                 const Session& session) {
  if (!options.Wanted()) return std::optional<FillConfig>();
  auto config = session.LoadStage<FillConfig>("fill");
  if (!config) return Forward(config);
  if (options.max_hole_mm > 0.0) config->max_hole_m = options.max_hole_mm * 1e-3;
  if (options.watertight) config->watertight = true;
  return std::optional<FillConfig>(*config);
}

Result<FilledSurface> FillMesh(const FillConfig& config, const VoxelField& field,
                               const std::vector<View>& views, Session& session) {
  const auto surface = session.LoadStage<SurfaceConfig>("surface");
  if (!surface) return Forward(surface);
  session.console.Begin("fill holes", 1);
  auto filled = FillHoles(field, views, config, *surface, session.console.Part(0));
  if (!filled) return Forward(filled);
  session.console.End();
  const FillFigures& figures = filled->figures;
  session.figures.Set("fill", FillStageFigures(figures));
  session.figures.Set("mesh", MeshFigures(filled->mesh));
  fmt::print("filled: {} holes with {} faces, {} left open, {} open edges\n", figures.num_filled,
             figures.num_filled_faces, figures.num_left, figures.num_open_edges);
  return filled;
}

Report::Table FillTable(const FillFigures& figures) {
  Report::Table table;
  table.title = "Holes";
  table.header = {"closed", "faces that close them", "left open", "open edges of the mesh"};
  table.rows = {{std::to_string(figures.num_filled), std::to_string(figures.num_filled_faces),
                 std::to_string(figures.num_left), std::to_string(figures.num_open_edges)}};
  return table;
}

}  // namespace fringe_fusion::cli
