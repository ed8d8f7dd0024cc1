// fringe fuse: posed views -> mesh.
#include <filesystem>

#include "command.hpp"
#include "figures.hpp"
#include "fill_option.hpp"
#include "fringe_fusion/fusion/model_file.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/surface/fuse_slabs.hpp"
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
  bool slabs = false;
  FillOptions fill;
};

void Declare(Command& command, FuseOptions& options) {
  DeclareViews(command, options.views);
  command.AddOption("--out", options.out, "Mesh to write: .ply, .stl, .obj or .glb")
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
  command.AddFlag(
      "--slabs", options.slabs,
      "For scans that do not fit into memory: fuse slab by slab within max_memory_gb of "
      "fusion.yaml, with scratch files beside the mesh");
  DeclareFill(command, options.fill);
}

Status CheckCommandLine(const FuseOptions& options) {
  if (options.method == "rbf" && !options.model.empty()) {
    return Fail("--model {}: --method rbf has no model file", options.model);
  }
  if (options.slabs &&
      (options.method != "gie" || !options.model.empty() || options.fill.Wanted())) {
    return Fail("--slabs: makes a mesh alone: --method rbf, --model and holes do not apply");
  }
  return {};
}

Status FuseRbf(const FuseOptions& options, Session& session) {
  const auto config = LoadVariationalConfig(session, options.voxel_m);
  if (!config) return Forward(config);
  const auto fill = LoadFillConfig(options.fill, session);
  if (!fill) return Forward(fill);
  const auto views = LoadViews(options.views, session);
  if (!views) return Forward(views);
  auto fused = FuseVariational(*views, *config, session);
  if (!fused) return Fail("{}: {}", options.views.views, fused.error().message);
  if (*fill) {
    auto filled = FillMesh(**fill, fused->surface, *views, session);
    if (!filled) return Fail("{}: {}", options.views.views, filled.error().message);
    fused->mesh = std::move(filled->mesh);
  }
  if (Status status = WriteMesh(fused->mesh, options.out); !status) return status;
  fmt::print("{}: {}\n", options.out, VariationalSummary(*fused));
  return {};
}

Json SlabStageFigures(const SlabFigures& figures, double voxel_m) {
  return Json()
      .Set("num_views", figures.num_views)
      .Set("num_points", figures.num_points)
      .Set("voxel_m", voxel_m)
      .Set("num_blocks", figures.num_blocks)
      .Set("num_slabs", figures.num_slabs)
      .Set("scratch_bytes", static_cast<std::size_t>(figures.scratch_bytes))
      .Set("read_s", figures.read_s)
      .Set("weigh_s", figures.weigh_s)
      .Set("extract_s", figures.extract_s);
}

/// The same mesh without the model in memory.
Status FuseInSlabs(const FuseOptions& options, Session& session) {
  const auto config = LoadFuseConfig(session, options.voxel_m);
  if (!config) return Forward(config);
  if (!config->voxel_is_given) return Fail("--slabs: needs --voxel, or voxel_m in fusion.yaml");
  const auto list = ListViews(options.views, session);
  if (!list) return Forward(list);
  SlabJob job{config->fusion,
              config->crop,
              config->surface,
              options.out,
              std::filesystem::absolute(options.out).parent_path().string(),
              0};
  session.console.Begin("fuse", 1);
  const ViewReader read = [&list](int index) { return list->read(index, NoProgress); };
  const auto figures = FuseSlabs(job, list->count, read, session.console.Part(0));
  if (!figures) return Fail("{}: {}", options.views.views, figures.error().message);
  session.console.End();
  session.figures.Set("fusion", SlabStageFigures(*figures, job.fusion.voxel_m));
  session.figures.Set(
      "mesh",
      Json().Set("num_vertices", figures->num_vertices).Set("num_faces", figures->num_faces));
  fmt::print("{}: {} views, {} points, voxel {:.3g} mm, {} slabs, {} vertices, {} faces\n",
             options.out, figures->num_views, figures->num_points, job.fusion.voxel_m * 1e3,
             figures->num_slabs, figures->num_vertices, figures->num_faces);
  return {};
}

bool IsModel(const std::string& path) { return std::filesystem::path(path).extension() == ".vdb"; }

/// The surface of a model that was saved.
Status ExtractSaved(const FuseOptions& options, Session& session) {
  if (options.voxel_m != 0.0 || !options.model.empty() || options.method != "gie" ||
      options.slabs) {
    return Fail(
        "--views {}: is a finished model: --voxel, --model, --method and --slabs do not apply",
        options.views.views);
  }
  if (options.fill.Wanted()) {
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
  if (Status status = CheckOutputFile(options.out, {".ply", ".stl", ".obj", ".glb"}); !status) {
    return status;
  }
  if (IsModel(options.views.views)) return ExtractSaved(options, session);
  if (!options.model.empty()) {
    if (Status status = CheckOutputFile(options.model, {".vdb"}); !status) return status;
  }
  session.AdoptSettings(options.views.views);
  if (options.slabs) return FuseInSlabs(options, session);
  if (options.method == "rbf") return FuseRbf(options, session);
  const auto config = LoadFuseConfig(session, options.voxel_m);
  if (!config) return Forward(config);
  const auto fill = LoadFillConfig(options.fill, session);
  if (!fill) return Forward(fill);
  const auto views = LoadViews(options.views, session);
  if (!views) return Forward(views);
  auto mesh = FuseToMesh(*views, *config, session);
  if (!mesh) return Fail("{}: {}", options.views.views, mesh.error().message);
  if (*fill) {
    auto filled = FillMesh(**fill, mesh->model, *views, session);
    if (!filled) return Fail("{}: {}", options.views.views, filled.error().message);
    mesh->mesh = std::move(filled->mesh);
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
  AddCommand<FuseOptions>(tool, "fuse", "Posed views -> one implicit model -> mesh", Declare, Fuse,
                          CheckCommandLine);
}

}  // namespace fringe_fusion::cli
