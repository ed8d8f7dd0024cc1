// fringe register: views with rough poses -> views with registered poses.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "command.hpp"
#include "figures.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/poses_conf.hpp"
#include "fringe_fusion/registration/register_views.hpp"
#include "views.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

struct RegisterOptions {
  ViewsOptions views;
  std::string out;
  double prior_sigma_mm = 0.0;
  double prior_sigma_deg = 0.0;
  bool no_prior = false;
};

void Declare(Command& command, RegisterOptions& options) {
  DeclareViews(command, options.views);
  command.AddOption("--out", options.out, "Registered poses, files relative to it")
      .Required()
      .TypeName("POSES.conf");
  const Option mm =
      command
          .AddOption("--prior-sigma-mm", options.prior_sigma_mm,
                     "Standard deviation of the given positions of a POSES.conf [mm]; "
                     "without it the first view is held and all others are free")
          .InRange(1e-6, 1e6)
          .TypeName("MM");
  const Option deg =
      command
          .AddOption("--prior-sigma-deg", options.prior_sigma_deg,
                     "Standard deviation of the given rotations of a POSES.conf [deg]")
          .InRange(1e-6, 180.0)
          .TypeName("DEG");
  mm.Needs(deg);
  deg.Needs(mm);
  command
      .AddFlag("--no-prior,--unordered", options.no_prior,
               "Ignore all given poses: the views assemble themselves by their shape, in the "
               "camera frame of the first one. Views that fit to none are reported and left out")
      .Excludes(mm);
}

/// Files of the views, relative to the folder of the new POSES.conf. Views of a scan that were
/// reconstructed on the fly are written, so that the new file does not name missing ones.
Result<std::vector<std::string>> ViewFiles(const RegisterOptions& options,
                                           const std::vector<View>& views) {
  const bool is_scan = fs::is_directory(options.views.views);
  const fs::path folder =
      is_scan ? fs::path(options.views.views) : fs::path(options.views.views).parent_path();
  const fs::path out_folder = fs::absolute(options.out).parent_path();
  std::vector<std::string> files;
  for (const View& view : views) {
    const fs::path file = folder / (is_scan ? RangeFile(view.id) : view.name);
    if (is_scan && !fs::exists(file)) {
      if (Status status = WriteRangeImage(view.range, file.string()); !status) {
        return tl::unexpected(status.error());
      }
    }
    files.push_back(fs::absolute(file)
                        .lexically_normal()
                        .lexically_relative(out_folder.lexically_normal())
                        .string());
  }
  return files;
}

// Registers on top of the given poses, or without any.
Result<RegistrationResult> RegisterGraph(const RegisterOptions& options, std::vector<View> views,
                                         const RegistrationConfig& config, Session& session) {
  if (options.no_prior) {
    const auto assembly = session.LoadStage<AssemblyConfig>("assembly");
    if (!assembly) return Forward(assembly);
    return RegisterUnordered(std::move(views), config, *assembly, session.console.Part(0));
  }
  ViewGraph graph;
  graph.views = std::move(views);
  if (options.prior_sigma_mm > 0.0 && !fs::is_directory(options.views.views)) {
    const Matrix6d covariance = PoseCovariance(options.prior_sigma_deg * std::acos(-1.0) / 180.0,
                                               options.prior_sigma_mm * 1e-3);
    for (View& view : graph.views) view.pose.covariance = covariance;
  }
  return RegisterViews(graph, config, session.console.Part(0));
}

Status Register(const RegisterOptions& given, Session& session) {
  RegisterOptions options = given;
  options.views.no_prior = options.no_prior;
  if (Status status = CheckOutputFile(options.out, {".conf"}); !status) return status;
  session.AdoptSettings(options.views.views);
  const auto config = session.LoadStage<RegistrationConfig>("registration");
  if (!config) return Forward(config);
  auto views = LoadViews(options.views, session);
  if (!views) return Forward(views);
  const auto files = ViewFiles(options, *views);
  if (!files) return Forward(files);
  session.console.Begin("register", 1);
  const auto result = RegisterGraph(options, std::move(*views), *config, session);
  if (!result) return Fail("{}: {}", options.views.views, result.error().message);
  session.console.End();
  std::vector<ConfEntry> entries;
  for (std::size_t i = 0; i < files->size(); ++i) {
    const Pose& pose = result->views[i].pose;
    if (pose.source == PoseSource::kNone) continue;  // fits to no other view
    entries.push_back({(*files)[i], pose.T_object_camera});
  }
  session.figures.Set("registration", RegistrationFigures(*result));
  if (Status status = WritePosesConf(entries, options.out); !status) return status;
  fmt::print("{}: {} of {} views, rms {:.4f} mm before, {:.4f} mm after {} iterations{}{}\n",
             options.out, entries.size(), result->views.size(), result->rms_before_m * 1e3,
             result->rms_after_m * 1e3, result->iterations,
             result->recovered ? ", places found by shape" : "",
             result->converged ? "" : " (not converged)");
  for (const std::string& warning : result->warnings) {
    fmt::print(stderr, "fringe register: warning: {}\n", warning);
  }
  return {};
}

}  // namespace

void AddRegister(Tool& tool) {
  AddCommand<RegisterOptions>(tool, "register", "Multi-view registration on top of given poses",
                              Declare, Register);
}

}  // namespace fringe_fusion::cli
