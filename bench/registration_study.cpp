// Registration of disturbed views: share of starts that converge, error and time.
//   registration_study run DATA [SCENES [DISTURBANCES [SEEDS]]]   e.g. knot,bunny 0,2 20
//   registration_study export DATA FOLDER [SCENES]                range images, poses and starts
//   registration_study judge DATA SCENE REFERENCE.conf POSES.conf...  of other systems' poses:
//   error
//                                                 and residual of the overlaps on half of the
//                                                 pixels
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <sstream>

#include "bench/registration_scenes.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/poses_conf.hpp"
#include "fringe_fusion/registration/overlap_check.hpp"

namespace fringe_fusion::bench {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> Split(const std::string& list) {
  std::vector<std::string> words;
  std::istringstream in(list);
  for (std::string word; std::getline(in, word, ',');) words.push_back(word);
  return words;
}

double CpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  const auto last = static_cast<double>(values.size() - 1);
  return values[static_cast<std::size_t>(std::lround(share * last))];
}

struct Tally {
  std::vector<std::vector<Transform>> converged;
  std::vector<double> error_m;
  std::vector<double> cpu_s;
  std::vector<double> wall_s;
  int starts = 0;
};

// Of every converged start to the first one: on real scans there is no truth.
double Spread(const RegistrationScene& scene, const Tally& tally) {
  double spread = 0.0;
  for (const std::vector<Transform>& poses : tally.converged) {
    const auto compared = RigidAlign(scene.graph, poses, tally.converged.front());
    if (compared) spread = std::max(spread, compared->max_rms_m);
  }
  return spread;
}

void RunStart(const RegistrationScene& scene, const Disturbance& disturbance, unsigned seed,
              Tally& tally) {
  ViewGraph graph = scene.graph;
  const std::vector<Transform> start = DisturbedPoses(scene, disturbance, seed);
  for (std::size_t i = 0; i < start.size(); ++i) graph.views[i].pose.T_object_camera = start[i];
  RegistrationConfig config;
  config.max_distance_m = std::max(config.max_distance_m, 2.0 * disturbance.shift_m);
  const double cpu = CpuSeconds();
  const auto wall = std::chrono::steady_clock::now();
  const auto result = RegisterViews(graph, config);
  tally.cpu_s.push_back(CpuSeconds() - cpu);
  tally.wall_s.push_back(
      std::chrono::duration<double>(std::chrono::steady_clock::now() - wall).count());
  ++tally.starts;
  if (!result) {
    std::printf("  seed %u: %s\n", seed, result.error().message.c_str());
    return;
  }
  std::vector<Transform> poses;
  for (const RegisteredView& view : result->views) poses.push_back(view.pose.T_object_camera);
  const auto compared = RigidAlign(scene.graph, poses, scene.T_object_camera_reference);
  if (!compared || !(compared->max_rms_m <= kConvergedM)) {
    std::printf("  seed %u: %.2f mm from the reference\n", seed,
                compared ? 1e3 * compared->max_rms_m : std::nan(""));
    return;
  }
  tally.error_m.push_back(compared->max_rms_m);
  tally.converged.push_back(std::move(poses));
}

Status Run(const std::string& data, const std::vector<std::string>& names,
           const std::vector<std::string>& disturbances, int num_seeds) {
  for (const std::string& name : names) {
    const auto scene = MakeRegistrationScene(name, data);
    if (!scene) return Forward(scene);
    for (const std::string& which : disturbances) {
      const Disturbance& disturbance = kDisturbances.at(std::stoul(which));
      Tally tally;
      for (int seed = 1; seed <= num_seeds; ++seed) {
        RunStart(*scene, disturbance, static_cast<unsigned>(seed), tally);
      }
      std::printf("| %s | %.0f deg, %.0f mm | %zu of %d | %.4f | %.4f | %.4f | %.2f | %.2f |\n",
                  name.c_str(), disturbance.angle_deg, 1e3 * disturbance.shift_m,
                  tally.converged.size(), tally.starts, 1e3 * Quantile(tally.error_m, 0.5),
                  1e3 * Quantile(tally.error_m, 1.0),
                  tally.converged.empty() ? std::nan("") : 1e3 * Spread(*scene, tally),
                  Quantile(tally.cpu_s, 0.5), Quantile(tally.wall_s, 0.5));
      std::fflush(stdout);
    }
  }
  return {};
}

Status WriteConf(const RegistrationScene& scene, const std::vector<Transform>& poses,
                 const fs::path& path) {
  std::vector<ConfEntry> entries;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    entries.push_back({fmt::format("view_{:02}.ply", scene.graph.views[i].id), poses[i]});
  }
  return WritePosesConf(entries, path.string());
}

Status Export(const std::string& data, const fs::path& folder,
              const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    const auto scene = MakeRegistrationScene(name, data);
    if (!scene) return Forward(scene);
    const fs::path out = folder / name;
    fs::create_directories(out);
    for (const View& view : scene->graph.views) {
      const fs::path file = out / fmt::format("view_{:02}.ply", view.id);
      RangeImage range = view.range;
      // A file that names no device is taken for a parallel projection.
      if (scene->exact) range.line_of_sight.projector = range.line_of_sight.camera;
      if (Status status = WriteRangeImage(range, file.string()); !status) return status;
    }
    Status status = WriteConf(*scene, scene->T_object_camera_reference, out / "reference.conf");
    if (!status) return status;
    for (std::size_t level = 0; level < kDisturbances.size(); ++level) {
      for (unsigned seed = 1; seed <= kNumSeeds; ++seed) {
        const auto poses = DisturbedPoses(*scene, kDisturbances.at(level), seed);
        status = WriteConf(*scene, poses, out / fmt::format("start_{}_{:02}.conf", level, seed));
        if (!status) return status;
      }
    }
  }
  return {};
}

Result<std::vector<Transform>> PosesOf(const std::string& path) {
  const auto entries = ReadPosesConf(path);
  if (!entries) return Forward(entries);
  std::vector<Transform> poses;
  for (const ConfEntry& entry : *entries) poses.push_back(entry.T_object_camera);
  return poses;
}

Status Judge(const std::string& data, const std::string& name, const std::string& reference_file,
             const std::vector<std::string>& files) {
  const auto scene = MakeRegistrationScene(name, data);
  if (!scene) return Forward(scene);
  const auto reference = PosesOf(reference_file);
  if (!reference) return Forward(reference);
  for (const std::string& file : files) {
    const auto poses = PosesOf(file);
    if (!poses) return Forward(poses);
    const auto compared = RigidAlign(scene->graph, *poses, *reference);
    if (!compared) return Forward(compared);
    const auto residual_m = HeldOutOverlapResidual(scene->graph, *poses, {});
    std::printf("%s %.6f %.6f\n", file.c_str(), 1e3 * compared->max_rms_m,
                residual_m ? 1e3 * *residual_m : std::nan(""));
  }
  return {};
}

Status Main(const std::vector<std::string>& words) {
  const std::string usage = "registration_study run|export|judge DATA ..., see its first lines";
  if (words.size() < 2) return Fail("{}", usage);
  const auto word = [&](std::size_t i, const std::string& fallback) {
    return i < words.size() ? words[i] : fallback;
  };
  std::string all;
  for (const std::string& name : RegistrationSceneNames()) all += name + ",";
  if (words[0] == "run") {
    std::printf(
        "| scene | start | converged | median [mm] | worst [mm] | spread [mm] | CPU [s] | "
        "wall [s] |\n|---|---|---|---|---|---|---|---|\n");
    return Run(words[1], Split(word(2, all)), Split(word(3, "0,1,2")),
               std::stoi(word(4, std::to_string(kNumSeeds))));
  }
  if (words[0] == "export" && words.size() >= 3) {
    return Export(words[1], words[2], Split(word(3, all)));
  }
  if (words[0] == "judge" && words.size() >= 5) {
    return Judge(words[1], words[2], words[3], {words.begin() + 4, words.end()});
  }
  return Fail("{}", usage);
}

}  // namespace
}  // namespace fringe_fusion::bench

int main(int argc, char** argv) {
  const auto status = fringe_fusion::bench::Main({argv + 1, argv + argc});
  if (status) return 0;
  std::fprintf(stderr, "registration_study: %s\n", status.error().message.c_str());
  return 1;
}
