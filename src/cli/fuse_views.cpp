#include "fuse_views.hpp"

#include "figures.hpp"
#include "fringe_fusion/surface/fuse_views.hpp"
#include "fringe_fusion/triangulation/point_spacing.hpp"

namespace fringe_fusion::cli {
namespace {

std::vector<Json> AgreementFigures(const std::vector<ViewAgreement>& views) {
  std::vector<Json> figures;
  for (const ViewAgreement& view : views) {
    Json figure;
    figure.Set("view", view.view_id)
        .Set("num_points", view.num_points)
        .Set("offset_m", view.offset_m)
        .Set("ratio", view.ratio)
        .Set("shift_m", view.shift_m.norm())
        .Set("displaced", view.displaced);
    figures.push_back(std::move(figure));
  }
  return figures;
}

Json FusionStageFigures(const FusionFigures& figures, double voxel_m) {
  return Json()
      .Set("num_views", figures.num_views)
      .Set("num_points", figures.num_points)
      .Set("num_outside_box", figures.num_outside_box)
      .Set("num_on_plane", figures.num_on_plane)
      .Set("num_on_fixture", figures.num_on_fixture)
      .Set("num_empty_views", figures.num_empty_views)
      .Set("voxel_m", voxel_m)
      .Set("num_blocks", figures.num_blocks)
      .Set("memory_bytes", figures.memory_bytes)
      .Set("views", AgreementFigures(figures.views))
      .Set("integrate_s", figures.integrate_s)
      .Set("extract_s", figures.extract_s);
}

/// One voxel per measured point: finer ones cost memory without more detail, coarser ones smooth.
Result<double> VoxelFromSpacing(const std::vector<View>& views) {
  std::vector<const RangeImage*> ranges;
  for (const View& view : views) ranges.push_back(&view.range);
  const double spacing_m = MedianPointSpacing(ranges);
  if (!(spacing_m > 0.0)) return Fail("views have no neighbouring points: give --voxel");
  return spacing_m;
}

}  // namespace

Result<FuseConfig> LoadFuseConfig(const Session& session, double voxel_m) {
  const auto fusion = session.LoadStage<FusionConfig>("fusion");
  if (!fusion) return Forward(fusion);
  const auto crop = session.LoadStage<CropConfig>("crop");
  if (!crop) return Forward(crop);
  const auto surface = session.LoadStage<SurfaceConfig>("surface");
  if (!surface) return Forward(surface);
  FuseConfig config{*fusion, *crop, *surface, session.StatesKey("fusion", "voxel_m")};
  if (voxel_m != 0.0) {
    config.fusion.voxel_m = voxel_m;
    config.voxel_is_given = true;
  }
  if (Status status = CheckBounds(config.fusion, "--voxel"); !status) {
    return tl::unexpected(status.error());
  }
  return config;
}

Result<FusedMesh> FuseToMesh(const std::vector<View>& views, const FuseConfig& config,
                             Session& session) {
  FusionConfig fusion = config.fusion;
  if (!config.voxel_is_given) {
    const auto voxel_m = VoxelFromSpacing(views);
    if (!voxel_m) return Forward(voxel_m);
    fusion.voxel_m = *voxel_m;
  }
  session.console.Begin("fuse", 1);
  auto fused = FuseViews(views, fusion, config.crop, config.surface, session.console.Part(0));
  if (!fused) return Forward(fused);
  session.console.End();
  session.figures.Set("fusion", FusionStageFigures(fused->figures, fusion.voxel_m));
  session.figures.Set("mesh", MeshFigures(fused->mesh));
  return FusedMesh{std::move(fused->model), std::move(fused->mesh), std::move(fused->figures),
                   fusion.voxel_m};
}

std::string FusionSummary(const FusedMesh& fused) {
  return fmt::format("{} views, {} points, voxel {:.3g} mm, {} vertices, {} faces",
                     fused.figures.num_views, fused.figures.num_points, fused.voxel_m * 1e3,
                     fused.mesh.vertices.size(), fused.mesh.faces.size());
}

Report::Table PointTable(const FusionFigures& figures) {
  Report::Table table;
  table.title = "Points of the fusion";
  table.header = {"fused", "outside the crop box", "on the plane or below", "in the fixture",
                  "views without a point"};
  table.rows = {{std::to_string(figures.num_points), std::to_string(figures.num_outside_box),
                 std::to_string(figures.num_on_plane), std::to_string(figures.num_on_fixture),
                 std::to_string(figures.num_empty_views)}};
  return table;
}

}  // namespace fringe_fusion::cli
