// fringe simulate: an object in the simulated cell -> a scan folder with ground truth.
#include <filesystem>
#include <optional>

#include "command.hpp"
#include "fringe_fusion/io/response_yaml.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/sim/gauges.hpp"
#include "fringe_fusion/sim/simulate_scan.hpp"
#include "staged_folder.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

struct SimulateOptions {
  std::string config;
  std::string object = "freeform";
  std::string out;
  int views = 0;
  int seed = -1;
};

void Declare(Command& command, SimulateOptions& options) {
  command
      .AddOption("--config", options.config,
                 "Calibration of the simulated devices (cell.yaml), or a folder that may hold "
                 "cell.yaml, sim.yaml, pattern.yaml, response.yaml and simulate_scan.yaml "
                 "(default: the built-in "
                 "scanner without noise or pose error)")
      .TypeName("CELL.yaml|DIR");
  command
      .AddOption("--object", options.object,
                 "Mesh file in metres, or a gauge: plane, sphere, ball_bar, step_block, freeform")
      .TypeName("MESH.ply|NAME")
      .ShowDefault();
  command.AddOption("--views", options.views, "Stops of the turntable (default: 12)")
      .InRange(1, 10000)
      .TypeName("N");
  command.AddOption("--seed", options.seed, "Seed of noise and pose errors (default: sim.yaml)")
      .AtLeastZero()
      .TypeName("S");
  command
      .AddOption("--out", options.out,
                 "Scan folder to write; earlier views and truth in it are replaced as a whole")
      .Required()
      .TypeName("SCAN/");
}

/// Loads <folder>/<stage>.yaml into `config` where it exists.
template <typename Config>
Status LoadInto(const fs::path& folder, const std::string& stage, Config& config) {
  const fs::path file = folder / (stage + ".yaml");
  if (!fs::exists(file)) return {};
  auto loaded = LoadConfigFile<Config>(file.string(), MissingKeys::kTakeDefaults);
  if (!loaded) return tl::unexpected(loaded.error());
  config = std::move(*loaded);
  return {};
}

Result<sim::SimulateScanConfig> LoadSettings(const SimulateOptions& options) {
  sim::SimulateScanConfig config;
  fs::path cell_file;
  if (fs::is_directory(options.config)) {
    const fs::path folder = options.config;
    if (Status status = CheckConfigFolder(options.config); !status) {
      return tl::unexpected(status.error());
    }
    if (Status status = LoadInto(folder, "simulate_scan", config); !status) {
      return tl::unexpected(status.error());
    }
    if (Status status = LoadInto(folder, "sim", config.sim); !status) {
      return tl::unexpected(status.error());
    }
    if (Status status = LoadInto(folder, "pattern", config.pattern); !status) {
      return tl::unexpected(status.error());
    }
    if (fs::exists(folder / "response.yaml")) {
      if (config.pattern.gamma != 1.0) {
        return Fail("{}: gamma is {}, but response.yaml beside it says what is undone",
                    (folder / "pattern.yaml").string(), config.pattern.gamma);
      }
      auto response = ReadResponse((folder / "response.yaml").string());
      if (!response) return Forward(response);
      if (response->use == ResponseUse::kPatterns) config.response = std::move(*response);
    }
    if (fs::exists(folder / "cell.yaml")) cell_file = folder / "cell.yaml";
  } else {
    cell_file = options.config;
  }
  if (!cell_file.empty()) {
    auto calibration = ReadCellCalibration(cell_file.string());
    if (!calibration) return Forward(calibration);
    config.calibration = std::move(*calibration);
  }
  if (options.views > 0) config.views = options.views;
  if (options.seed >= 0) config.sim.seed = options.seed;
  return config;
}

Status Simulate(const SimulateOptions& options, Session& session) {
  const auto config = LoadSettings(options);
  if (!config) return tl::unexpected(config.error());
  // Before the work: hours of rendering must not end at a folder that cannot be written.
  auto folder = StagedFolder::Create(options.out);
  if (!folder) return tl::unexpected(folder.error());
  const auto object = sim::MakeObject(options.object);
  if (!object) return tl::unexpected(object.error());
  if (object->faces.empty()) return Fail("--object {}: has no faces", options.object);
  session.console.Begin("simulate", 1);
  if (Status status = sim::SimulateScan(*config, *object, folder->path(), session.console.Part(0));
      !status) {
    return status;
  }
  session.console.End();
  session.figures.Set("num_views", config->views)
      .Set("seed", config->sim.seed)
      .Set("calibration_id", CalibrationId(config->calibration))
      .Set("num_faces", object->faces.size());
  return folder->Commit();
}

}  // namespace

void AddSimulate(Tool& tool) {
  AddCommand<SimulateOptions>(tool, "simulate",
                              "An object in the simulated cell -> a scan folder with ground truth",
                              Declare, Simulate);
}

}  // namespace fringe_fusion::cli
