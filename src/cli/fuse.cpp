// fringe fuse: posed views -> mesh.
#include "command.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fuse_views.hpp"
#include "views.hpp"

namespace fringe_fusion::cli {
namespace {

struct FuseOptions {
  ViewsOptions views;
  std::string out;
  std::string method = "gie";
  double voxel_m = 0.0;
};

void Declare(CLI::App& command, FuseOptions& options) {
  DeclareViews(command, options.views);
  command.add_option("--out", options.out, "Mesh to write: .ply, .stl or .obj")
      ->required()
      ->type_name("MESH.ply");
  command.add_option("--method", options.method, "gie: generalised implicit equation")
      ->check(CLI::IsMember({"gie"}))
      ->capture_default_str();
  command
      .add_option("--voxel", options.voxel_m,
                  "Edge of a voxel [m] (default: fusion.yaml of --config, else the median distance "
                  "of neighbouring points)")
      ->check(CLI::Range(1e-6, 10.0))
      ->type_name("M");
}

Status Fuse(const FuseOptions& options, Session& session) {
  if (Status status = CheckOutputFile(options.out, {".ply", ".stl", ".obj"}); !status) {
    return status;
  }
  session.AdoptSettings(options.views.views);
  const auto config = LoadFuseConfig(session, options.voxel_m);
  if (!config) return Forward(config);
  const auto views = LoadViews(options.views, session);
  if (!views) return Forward(views);
  const auto mesh = FuseToMesh(*views, *config, session);
  if (!mesh) return Fail("{}: {}", options.views.views, mesh.error().message);
  if (Status status = WriteMesh(mesh->mesh, options.out); !status) return status;
  fmt::print("{}: {}\n", options.out, FusionSummary(*mesh));
  return {};
}

}  // namespace

void AddFuse(Tool& tool) {
  AddCommand<FuseOptions>(tool, "fuse", "Posed views -> one implicit model -> mesh", Declare, Fuse);
}

}  // namespace fringe_fusion::cli
