#include "fuse_variational.hpp"

#include "figures.hpp"
#include "fringe_fusion/triangulation/point_spacing.hpp"

namespace fringe_fusion::cli {

Result<VariationalStages> LoadVariationalConfig(const Session& session, double voxel_m) {
  const auto variational = session.LoadStage<VariationalConfig>("variational");
  if (!variational) return Forward(variational);
  const auto crop = session.LoadStage<CropConfig>("crop");
  if (!crop) return Forward(crop);
  const auto surface = session.LoadStage<SurfaceConfig>("surface");
  if (!surface) return Forward(surface);
  VariationalStages stages{*variational, *crop, *surface,
                           session.StatesKey("variational", "voxel_m")};
  if (voxel_m != 0.0) {
    stages.variational.voxel_m = voxel_m;
    stages.voxel_is_given = true;
  }
  return stages;
}

Result<VariationalMesh> FuseVariational(const std::vector<View>& views,
                                        const VariationalStages& config, Session& session) {
  std::vector<View> cropped;
  std::vector<const RangeImage*> ranges;
  for (const View& view : views) {
    auto crop = CropView(view, config.crop);
    if (!crop) return Forward(crop);
    if (crop->num_kept > 0) cropped.push_back(std::move(crop->view));
  }
  for (const View& view : cropped) ranges.push_back(&view.range);
  VariationalConfig variational = config.variational;
  if (!config.voxel_is_given) {
    variational.voxel_m = MedianPointSpacing(ranges);
    if (!(variational.voxel_m > 0.0)) {
      return Fail("views have no neighbouring points: give --voxel");
    }
  }
  const auto points = MeasuredPoints(cropped, variational);
  if (!points) return Forward(points);
  session.console.Begin("fuse", 2);
  auto surface = VariationalSurface::Fit(*points, variational, session.console.Part(0));
  if (!surface) return Forward(surface);
  auto mesh = ExtractMesh(*surface, config.surface, session.console.Part(1));
  if (!mesh) return Forward(mesh);
  session.console.End();
  const VariationalFigures& figures = surface->figures();
  session.figures.Set("fusion", Json()
                                    .Set("num_views", cropped.size())
                                    .Set("num_points", figures.num_points)
                                    .Set("num_unusable", figures.num_unusable)
                                    .Set("num_centers", figures.num_centers)
                                    .Set("num_cells", figures.num_cells)
                                    .Set("voxel_m", variational.voxel_m)
                                    .Set("spacing_m", figures.spacing_m)
                                    .Set("smoothing_width_m", figures.smoothing_width_m)
                                    .Set("alpha", figures.alpha)
                                    .Set("validation_ratio", figures.validation_ratio)
                                    .Set("memory_bytes", figures.memory_bytes));
  session.figures.Set("mesh", MeshFigures(*mesh));
  return VariationalMesh{std::move(*surface), std::move(*mesh), static_cast<int>(cropped.size())};
}

std::string VariationalSummary(const VariationalMesh& fused) {
  const VariationalFigures& figures = fused.surface.figures();
  return fmt::format(
      "{} views, {} points, {} centres, smoothing width {:.3g} mm, voxel {:.3g} mm, {} vertices, "
      "{} faces",
      fused.num_views, figures.num_points, figures.num_centers, figures.smoothing_width_m * 1e3,
      fused.surface.voxel_m() * 1e3, fused.mesh.vertices.size(), fused.mesh.faces.size());
}

}  // namespace fringe_fusion::cli
