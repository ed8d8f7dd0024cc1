// fringe fuse: posed views -> mesh.
#include <filesystem>

#include "command.hpp"
#include "figures.hpp"
#include "fringe_fusion/fusion/model_file.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/surface/fill_holes.hpp"
#include "fuse_variational.hpp"
#include "fuse_views.hpp"
#include "views.hpp"

namespace fringe_fusion::cli {
namespace {

struct FuseOptions {
  ViewsOptions views;
  std::string out;
  std::string model;
  std::string method = "gie";
  double voxel_m = 0.0;
  bool fill_holes = false;
  bool watertight = false;
  double max_hole_mm = 0.0;
};

void Declare(Command& command, FuseOptions& options) {
  DeclareViews(command, options.views);
  command.AddOption("--out", options.out, "Mesh to write: .ply, .stl or .obj")
      .Required()
      .TypeName("MESH.ply");
  command
      .AddOption("--model", options.model,
                 "Save the implicit model too; --views MODEL.vdb makes a mesh of it again")
      .TypeName("MODEL.vdb");
  command
      .AddOption("--method", options.method,
                 "gie: generalised implicit equation; rbf: variational surface of radial functions")
      .OneOf({"gie", "rbf"})
      .ShowDefault();
  command
      .AddOption(
          "--voxel", options.voxel_m,
          "Edge of a voxel [m] (default: voxel_m where fusion.yaml of --config states it, else "
          "the spacing of the points)")
      .InRange(1e-6, 10.0)
      .TypeName("M");
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

/// Closes the holes of a field, if that was asked for.
Status FillIfAsked(const FuseOptions& options, const VoxelField& field,
                   const std::vector<View>& views, Session& session, Mesh& mesh) {
  if (!options.fill_holes && !options.watertight) return {};
  auto fill = session.LoadStage<FillConfig>("fill");
  if (!fill) return Forward(fill);
  if (options.max_hole_mm > 0.0) fill->max_hole_m = options.max_hole_mm * 1e-3;
  if (options.watertight) fill->watertight = true;
  const auto surface = session.LoadStage<SurfaceConfig>("surface");
  if (!surface) return Forward(surface);
  session.console.Begin("fill holes", 1);
  auto filled = FillHoles(field, views, *fill, *surface, session.console.Part(0));
  if (!filled) return Forward(filled);
  session.console.End();
  mesh = std::move(filled->mesh);
  session.figures.Set("fill", FillStageFigures(filled->figures));
  session.figures.Set("mesh", MeshFigures(mesh));
  fmt::print("filled: {} holes with {} faces, {} left open, {} open edges\n",
             filled->figures.num_filled, filled->figures.num_filled_faces, filled->figures.num_left,
             filled->figures.num_open_edges);
  return {};
}

Status FuseRbf(const FuseOptions& options, Session& session) {
  if (!options.model.empty()) {
    return Fail("--model {}: --method rbf has no model file", options.model);
  }
  const auto config = LoadVariationalConfig(session, options.voxel_m);
  if (!config) return Forward(config);
  const auto views = LoadViews(options.views, session);
  if (!views) return Forward(views);
  auto fused = FuseVariational(*views, *config, session);
  if (!fused) return Fail("{}: {}", options.views.views, fused.error().message);
  if (Status status = FillIfAsked(options, fused->surface, *views, session, fused->mesh); !status) {
    return Fail("{}: {}", options.views.views, status.error().message);
  }
  if (Status status = WriteMesh(fused->mesh, options.out); !status) return status;
  fmt::print("{}: {}\n", options.out, VariationalSummary(*fused));
  return {};
}

bool IsModel(const std::string& path) { return std::filesystem::path(path).extension() == ".vdb"; }

/// The surface of a model that was saved.
Status ExtractSaved(const FuseOptions& options, Session& session) {
  if (options.voxel_m != 0.0 || !options.model.empty() || options.method != "gie") {
    return Fail("--views {}: is a finished model: --voxel, --model and --method do not apply",
                options.views.views);
  }
  if (options.fill_holes || options.watertight) {
    return Fail(
        "--views {}: a model does not know what its views saw as empty: fill holes from "
        "the views",
        options.views.views);
  }
  const auto surface = session.LoadStage<SurfaceConfig>("surface");
  if (!surface) return Forward(surface);
  session.console.Begin("load", 1);
  const auto saved = LoadModel(options.views.views, session.console.Part(0));
  if (!saved) return Forward(saved);
  session.console.End();
  session.console.Begin("extract", 1);
  const auto mesh = ExtractMesh(saved->model, *surface, session.console.Part(0));
  if (!mesh) return Fail("{}: {}", options.views.views, mesh.error().message);
  session.console.End();
  session.figures.Set("mesh", MeshFigures(*mesh));
  if (Status status = WriteMesh(*mesh, options.out); !status) return status;
  fmt::print("{}: {} views, voxel {:.3g} mm, {} vertices, {} faces\n", options.out,
             saved->model.ViewIds().size(), saved->model.config().voxel_m * 1e3,
             mesh->vertices.size(), mesh->faces.size());
  return {};
}

Status Fuse(const FuseOptions& options, Session& session) {
  if (Status status = CheckOutputFile(options.out, {".ply", ".stl", ".obj"}); !status) {
    return status;
  }
  if (IsModel(options.views.views)) return ExtractSaved(options, session);
  if (!options.model.empty()) {
    if (Status status = CheckOutputFile(options.model, {".vdb"}); !status) return status;
  }
  session.AdoptSettings(options.views.views);
  if (options.method == "rbf") return FuseRbf(options, session);
  const auto config = LoadFuseConfig(session, options.voxel_m);
  if (!config) return Forward(config);
  const auto views = LoadViews(options.views, session);
  if (!views) return Forward(views);
  auto mesh = FuseToMesh(*views, *config, session);
  if (!mesh) return Fail("{}: {}", options.views.views, mesh.error().message);
  if (Status status = FillIfAsked(options, mesh->model, *views, session, mesh->mesh); !status) {
    return Fail("{}: {}", options.views.views, status.error().message);
  }
  if (Status status = WriteMesh(mesh->mesh, options.out); !status) return status;
  if (!options.model.empty()) {
    if (Status status = SaveModel(mesh->model, options.model); !status) return status;
  }
  fmt::print("{}: {}\n", options.out, FusionSummary(*mesh));
  return {};
}

}  // namespace

void AddFuse(Tool& tool) {
  AddCommand<FuseOptions>(tool, "fuse", "Posed views -> one implicit model -> mesh", Declare, Fuse);
}

}  // namespace fringe_fusion::cli
