// The fusion against exact truth. Subcommands (lengths in metres):
//   run    OBJECT SIGMA [VOXEL [ORDER [MESH|- [LEVELS [RADIUS]]]]]
//          renders, fuses, judges, prints one row
//   fill   OBJECT SIGMA [VOXEL [MESH]]  the same, then closes all holes: a row about what was
//   closed export OBJECT SIGMA FOLDER          writes the views (PLY, poses.conf, camera.txt) for
//   others judge  OBJECT SIGMA MESH NAME S MB  judges a mesh made elsewhere, prints one row
// OBJECT is a name of proof_objects.hpp or a mesh file in metres.

#include <sys/resource.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>

#include "bench/proof_objects.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/inspection/surface_distance.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/poses_conf.hpp"
#include "fringe_fusion/surface/fill_holes.hpp"
#include "fringe_fusion/surface/fuse_views.hpp"
#include "fringe_fusion/triangulation/point_spacing.hpp"

namespace fringe_fusion::bench {
namespace {

constexpr double kFarM = 0.0015;       // area farther from the truth counts as stray
constexpr double kCompleteM = 0.0005;  // truth nearer to the model counts as covered
constexpr std::size_t kNumPoints = 200000;

struct Figures {
  double seen_mm = 0.0;      // mean distance truth to model, seen part
  double seen95_mm = 0.0;    // 95 % of it
  double complete = 0.0;     // share of the seen part within kCompleteM
  double unseen_mm = 0.0;    // mean, unseen part
  double back_mm = 0.0;      // mean distance model to truth
  double stray = 0.0;        // share of the model's area beyond kFarM
  double sigma_ratio = 0.0;  // rms of vertex error over stated sigma, vertices within kFarM
};

std::vector<double> Distances(const SurfaceDistance& surface,
                              const std::vector<Eigen::Vector3d>& points) {
  std::vector<double> distances(points.size());
  ParallelFor(static_cast<int>(points.size()), 1024, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      const auto nearest = surface.Nearest(points[i], 1.0);
      distances[i] =
          nearest ? std::abs(nearest->distance_m) : std::numeric_limits<double>::infinity();
    }
  });
  return distances;
}

double Mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double Share(const std::vector<double>& values, double limit) {
  const auto above =
      std::count_if(values.begin(), values.end(), [&](double value) { return !(value <= limit); });
  return static_cast<double>(above) / static_cast<double>(values.size());
}

double SigmaRatio(const Mesh& model, const SurfaceDistance& truth) {
  if (model.sigma.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::vector<Eigen::Vector3d> vertices;
  for (const Eigen::Vector3f& vertex : model.vertices) vertices.push_back(vertex.cast<double>());
  const std::vector<double> errors = Distances(truth, vertices);
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (!(errors[i] < kFarM)) continue;
    sum += std::pow(errors[i] / static_cast<double>(model.sigma[i]), 2);
    ++count;
  }
  return std::sqrt(sum / static_cast<double>(count));
}

Result<Figures> Judge(const ProofScene& scene, const Mesh& model) {
  const Result<SurfaceDistance> to_model = SurfaceDistance::Create(model);
  if (!to_model) return Forward(to_model);
  const Result<SurfaceDistance> to_truth = SurfaceDistance::Create(scene.truth);
  if (!to_truth) return Forward(to_truth);
  const SurfacePoints truth_points = SpreadPoints(scene.truth, kNumPoints);
  const auto is_seen = SeenPoints(scene, truth_points);
  if (!is_seen) return Forward(is_seen);
  const std::vector<double> distances = Distances(*to_model, truth_points.points);
  std::vector<double> seen;
  std::vector<double> unseen;
  for (std::size_t i = 0; i < distances.size(); ++i) {
    ((*is_seen)[i] ? seen : unseen).push_back(distances[i]);
  }
  Figures figures;
  figures.seen_mm = 1e3 * Mean(seen);
  figures.complete = 1.0 - Share(seen, kCompleteM);
  figures.unseen_mm = 1e3 * Mean(unseen);
  const auto at95 = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() * 95 / 100);
  std::nth_element(seen.begin(), at95, seen.end());
  figures.seen95_mm = 1e3 * *at95;
  const std::vector<double> back = Distances(*to_truth, SpreadPoints(model, kNumPoints).points);
  figures.back_mm = 1e3 * Mean(back);
  figures.stray = Share(back, kFarM);
  figures.sigma_ratio = SigmaRatio(model, *to_truth);
  return figures;
}

void PrintRow(const std::string& object, double sigma_m, const std::string& method,
              const Figures& f, double seconds, double megabytes) {
  std::printf("| %s | %.1f | %s | %.4f | %.4f | %.4f | %.2f | %.3f | %.2f | %.2f | %.0f | %.2f |\n",
              object.c_str(), 1e3 * sigma_m, method.c_str(), f.seen_mm, f.seen95_mm, f.back_mm,
              100.0 * f.complete, 100.0 * f.stray, f.unseen_mm, seconds, megabytes, f.sigma_ratio);
}

double PeakMegabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

double CpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

Result<ProofScene> MakeScene(const std::string& object, double sigma_m) {
  Result<Mesh> truth = MakeProofObject(object);
  if (!truth) return Forward(truth);
  return RenderProof(std::move(*truth), sigma_m);
}

std::string ShortName(const std::string& object) {
  const std::size_t slash = object.find_last_of('/');
  return slash == std::string::npos ? object : object.substr(slash + 1);
}

Status Run(const std::vector<std::string>& words) {
  const double sigma_m = std::stod(words[1]);
  const Result<ProofScene> scene = MakeScene(words[0], sigma_m);
  if (!scene) return tl::unexpected(scene.error());
  FusionConfig config;
  std::vector<const RangeImage*> ranges;
  for (const View& view : scene->views) ranges.push_back(&view.range);
  config.voxel_m = words.size() > 2 ? std::stod(words[2]) : MedianPointSpacing(ranges);
  if (words.size() > 3) config.order = std::stoi(words[3]);
  if (words.size() > 5) config.num_levels = std::stoi(words[5]);
  if (words.size() > 6) config.kernel_radius_voxels = std::stod(words[6]);
  const double before = PeakMegabytes();
  const double cpu_before = CpuSeconds();
  const auto start = std::chrono::steady_clock::now();
  const Result<FusedSurface> fused = FuseViews(scene->views, config, CropConfig{}, SurfaceConfig{});
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  if (!fused) return tl::unexpected(fused.error());
  const double cpu_s = CpuSeconds() - cpu_before;
  const double megabytes = PeakMegabytes() - before;
  if (words.size() > 4 && words[4] != "-") {
    if (Status status = WriteMesh(fused->mesh, words[4]); !status) return status;
  }
  const Result<Figures> figures = Judge(*scene, fused->mesh);
  if (!figures) return tl::unexpected(figures.error());
  PrintRow(ShortName(words[0]), sigma_m,
           fmt::format("fringe order {}, voxel {:.3f} mm", config.order, 1e3 * config.voxel_m),
           *figures, seconds.count(), megabytes);
  std::fprintf(stderr, "integrate %.2f s, extract %.2f s, CPU %.2f s, %d points\n",
               fused->figures.integrate_s, fused->figures.extract_s, cpu_s,
               fused->figures.num_points);
  return {};
}

// How far a point lies in space that one view saw as empty [m]: before what the view measured at
// all pixels within `margin_m` of the point; 0 where one of them is empty.
double DepthInEmpty(const ProofScene& scene, const View& view, const Eigen::Vector3d& point,
                    double margin_m) {
  const Eigen::Vector3d at = view.pose.T_object_camera.inverse() * point;
  const double middle = 0.5 * (scene.image_px - 1);
  const double around = scene.focal_px * margin_m / at.z();
  const Eigen::Array2d pixel = scene.focal_px * at.head<2>().array() / at.z() + middle;
  const Eigen::Array2i low = (pixel - around).floor().cast<int>();
  const Eigen::Array2i high = (pixel + around).ceil().cast<int>();
  if (low.minCoeff() < 0 || high.maxCoeff() >= scene.image_px) return 0.0;
  double depth = std::numeric_limits<double>::infinity();
  for (int y = low.y(); y <= high.y(); ++y) {
    for (int x = low.x(); x <= high.x(); ++x) {
      const double behind = static_cast<double>(view.range.points(x, y).norm()) - at.norm();
      if (!(behind > 0.0)) return 0.0;
      depth = std::min(depth, behind);
    }
  }
  return depth;
}

// Share of points that lie in empty space by more than the margin, to all sides.
double ShareInEmpty(const ProofScene& scene, const std::vector<Eigen::Vector3d>& points,
                    double margin_m) {
  std::vector<double> depths(points.size(), 0.0);
  ParallelFor(static_cast<int>(points.size()), 1024, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      for (const View& view : scene.views) {
        depths[i] = std::max(depths[i], DepthInEmpty(scene, view, points[i], margin_m));
      }
    }
  });
  return Share(depths, margin_m);
}

Mesh FacesWhere(const Mesh& mesh, std::uint8_t flag) {
  Mesh part;
  part.vertices = mesh.vertices;
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    if (mesh.filled_faces[i] == flag) part.faces.push_back(mesh.faces[i]);
  }
  return part;
}

Status PrintFilled(const std::string& object, double sigma_m, const ProofScene& scene,
                   const FilledSurface& filled, double seconds) {
  const Mesh patches = FacesWhere(filled.mesh, 1);
  const auto measured = Judge(scene, FacesWhere(filled.mesh, 0));
  const auto all = Judge(scene, filled.mesh);
  const auto truth = SurfaceDistance::Create(scene.truth);
  if (!measured || !all || !truth) return Fail("{}: the mesh cannot be judged", object);
  double back_mm = 0.0;
  double in_empty = 0.0;
  if (!patches.faces.empty()) {
    const std::vector<Eigen::Vector3d> points = SpreadPoints(patches, kNumPoints).points;
    back_mm = 1e3 * Mean(Distances(*truth, points));
    // Lines of sight keep a clearance of 1.5 cells from the surface.
    in_empty = ShareInEmpty(scene, points, 2.0 * filled.figures.grid_m);
  }
  const FillFigures& f = filled.figures;
  std::printf(
      "| %s | %.1f | %d | %zu of %zu | %zu | %.4f | %.3f | %.2f -> %.2f | %.2f | %.2f | %.4f | "
      "%.2f |\n",
      object.c_str(), 1e3 * sigma_m, f.num_filled, f.num_filled_faces, filled.mesh.faces.size(),
      f.num_open_edges, all->seen_mm, 100.0 * measured->stray, measured->unseen_mm, all->unseen_mm,
      back_mm, 1e3 * f.grid_m, 100.0 * in_empty, seconds);
  return {};
}

Status Fill(const std::vector<std::string>& words) {
  const double sigma_m = std::stod(words[1]);
  const Result<ProofScene> scene = MakeScene(words[0], sigma_m);
  if (!scene) return tl::unexpected(scene.error());
  FusionConfig config;
  std::vector<const RangeImage*> ranges;
  for (const View& view : scene->views) ranges.push_back(&view.range);
  config.voxel_m = words.size() > 2 ? std::stod(words[2]) : MedianPointSpacing(ranges);
  const Result<FusedSurface> fused = FuseViews(scene->views, config, CropConfig{}, SurfaceConfig{});
  if (!fused) return tl::unexpected(fused.error());
  FillConfig fill;
  fill.watertight = true;
  const double before = CpuSeconds();
  const auto filled = FillHoles(fused->model, scene->views, fill, SurfaceConfig{});
  if (!filled) return tl::unexpected(filled.error());
  const double seconds = CpuSeconds() - before;
  if (words.size() > 3) {
    if (Status status = WriteMesh(filled->mesh, words[3]); !status) return status;
  }
  return PrintFilled(ShortName(words[0]), sigma_m, *scene, *filled, seconds);
}

Status Export(const std::vector<std::string>& words) {
  const Result<ProofScene> scene = MakeScene(words[0], std::stod(words[1]));
  if (!scene) return tl::unexpected(scene.error());
  const std::string& folder = words[2];
  if (Status status = MakeFolder(folder); !status) return status;
  std::vector<ConfEntry> entries;
  for (const View& view : scene->views) {
    entries.push_back({view.name + ".ply", view.pose.T_object_camera});
    if (Status status = WriteRangeImage(view.range, folder + "/" + entries.back().file); !status) {
      return status;
    }
  }
  if (Status status = WritePosesConf(entries, folder + "/poses.conf"); !status) return status;
  std::ofstream camera(folder + "/camera.txt");
  camera << scene->image_px << " " << fmt::format("{:.9f}", scene->focal_px) << "\n";
  if (!camera) return Fail("{}/camera.txt: cannot be written", folder);
  return {};
}

Status JudgeFile(const std::vector<std::string>& words) {
  const double sigma_m = std::stod(words[1]);
  const Result<ProofScene> scene = MakeScene(words[0], sigma_m);
  if (!scene) return tl::unexpected(scene.error());
  const Result<Mesh> mesh = ReadMesh(words[2]);
  if (!mesh) return tl::unexpected(mesh.error());
  const Result<Figures> figures = Judge(*scene, *mesh);
  if (!figures) return tl::unexpected(figures.error());
  PrintRow(ShortName(words[0]), sigma_m, words[3], *figures, std::stod(words[4]),
           std::stod(words[5]));
  return {};
}

int Main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  const std::string command = words.empty() ? "" : words[0];
  const std::vector<std::string> rest(words.begin() + (words.empty() ? 0 : 1), words.end());
  Status status = Fail("usage: fusion_proof run|fill|export|judge OBJECT SIGMA ...");
  if (command == "run" && rest.size() >= 2) status = Run(rest);
  if (command == "fill" && rest.size() >= 2) status = Fill(rest);
  if (command == "export" && rest.size() == 3) status = Export(rest);
  if (command == "judge" && rest.size() == 6) status = JudgeFile(rest);
  if (!status) std::fprintf(stderr, "fusion_proof: %s\n", status.error().message.c_str());
  return status ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace fringe_fusion::bench

int main(int argc, char** argv) { return fringe_fusion::bench::Main(argc, argv); }
