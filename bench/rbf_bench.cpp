// The variational surface: time, memory and error. Subcommands (lengths in metres):
//   scale N...                   N noisy points on a torus, fit and extraction
//   reference [WIDTH]            5000 points: cells beside one dense system
//   proof OBJECT SIGMA MESH [WIDTH [VOXEL]]   an object of proof_objects.hpp; judge the mesh with
//                                fusion_proof judge OBJECT SIGMA MESH NAME S MB

#include <sys/resource.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "bench/proof_objects.hpp"
#include "fringe_fusion/fusion/variational_surface.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/surface/extract_mesh.hpp"
#include "fringe_fusion/triangulation/point_spacing.hpp"

namespace fringe_fusion::bench {
namespace {

constexpr double kRingM = 0.04;
constexpr double kTubeM = 0.015;
constexpr double kSigmaM = 5e-5;

double TorusDistance(const Eigen::Vector3d& p) {
  return std::hypot(p.head<2>().norm() - kRingM, p.z()) - kTubeM;
}

double TorusSpacing(std::size_t count) {
  return std::sqrt(4.0 * M_PI * M_PI * kRingM * kTubeM / static_cast<double>(count));
}

// Even by area: more points on the outer side of the ring. The normals have the noise of plane fits
// with a radius of three spacings.
std::vector<MeasuredPoint> TorusPoints(std::size_t count, double sigma_m, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> normal(0.0, 1.0);
  const double radius = 3.0 * TorusSpacing(count);
  const double sigma_normal = 2.0 * sigma_m / (radius * std::sqrt(M_PI * 9.0));
  std::vector<MeasuredPoint> points;
  while (points.size() < count) {
    const double u = 2.0 * M_PI * uniform(random);
    const double v = 2.0 * M_PI * uniform(random);
    if (uniform(random) * (kRingM + kTubeM) > kRingM + kTubeM * std::cos(v)) continue;
    const Eigen::Vector3d n(std::cos(u) * std::cos(v), std::sin(u) * std::cos(v), std::sin(v));
    const Eigen::Vector3d ring(kRingM * std::cos(u), kRingM * std::sin(u), 0.0);
    MeasuredPoint point;
    point.position = (ring + (kTubeM + sigma_m * normal(random)) * n).cast<float>();
    const Eigen::Vector3d tilt(normal(random), normal(random), normal(random));
    point.normal = (n + sigma_normal * tilt).normalized().cast<float>();
    point.sigma = static_cast<float>(sigma_m);
    points.push_back(point);
  }
  return points;
}

struct Usage {
  double wall_s;
  double cpu_s;
  double peak_mb;
};

Usage Now() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now().time_since_epoch();
  return {wall.count(), seconds(usage.ru_utime) + seconds(usage.ru_stime),
          static_cast<double>(usage.ru_maxrss) / 1024.0};
}

void PrintFit(const VariationalFigures& f) {
  std::printf(
      "  spacing %.4f mm, width %.4f mm (%.2f spacings), %zu centres, %zu cells, left-out "
      "ratio %.4f, model %.0f B/point\n",
      1e3 * f.spacing_m, 1e3 * f.smoothing_width_m, f.smoothing_width_m / f.spacing_m,
      f.num_centers, f.num_cells, f.validation_ratio,
      static_cast<double>(f.memory_bytes) / static_cast<double>(f.num_points));
}

Status Scale(const std::vector<std::string>& words) {
  for (const std::string& word : words) {
    const auto count = static_cast<std::size_t>(std::stod(word));
    const std::vector<MeasuredPoint> points = TorusPoints(count, kSigmaM, 11);
    VariationalConfig config;
    config.voxel_m = std::max(1.5 * TorusSpacing(count), 0.0002);
    const Usage start = Now();
    const Result<VariationalSurface> surface = VariationalSurface::Fit(points, config);
    if (!surface) return tl::unexpected(surface.error());
    const Usage fitted = Now();
    const Result<Mesh> mesh = ExtractMesh(*surface, SurfaceConfig{});
    if (!mesh) return tl::unexpected(mesh.error());
    const Usage done = Now();
    double squares = 0.0;
    double stated = 0.0;
    for (std::size_t i = 0; i < mesh->vertices.size(); ++i) {
      squares += std::pow(TorusDistance(mesh->vertices[i].cast<double>()), 2);
      stated += std::pow(static_cast<double>(mesh->sigma[i]), 2);
    }
    const double rms = std::sqrt(squares / static_cast<double>(mesh->vertices.size()));
    std::printf("| %zu | %.3f | %zu | %.2f | %.2f | %.2f | %.2f | %.0f | %.3f | %.2f |\n", count,
                1e3 * config.voxel_m, mesh->faces.size(), fitted.wall_s - start.wall_s,
                done.wall_s - fitted.wall_s, fitted.cpu_s - start.cpu_s, done.cpu_s - fitted.cpu_s,
                (done.peak_mb - start.peak_mb) * 1024.0 * 1024.0 / static_cast<double>(count),
                rms / kSigmaM, std::sqrt(squares / stated));
    PrintFit(surface->figures());
  }
  return {};
}

Status Reference(const std::vector<std::string>& words) {
  constexpr std::size_t kCount = 5000;
  constexpr double kNoiseM = 1e-4;
  const std::vector<MeasuredPoint> points = TorusPoints(kCount, kNoiseM, 12);
  VariationalConfig config;
  config.voxel_m = TorusSpacing(kCount);
  if (!words.empty()) config.smoothing_width_m = std::stod(words[0]);
  if (words.size() > 1) config.max_cell_centers = std::stoi(words[1]);
  if (words.size() > 2) config.margin_widths = std::stod(words[2]);
  if (words.size() > 4) config.reduction_ratio = std::stod(words[4]);
  const Usage start = Now();
  const Result<VariationalSurface> chosen = VariationalSurface::Fit(points, config);
  if (!chosen) return tl::unexpected(chosen.error());
  config.smoothing_width_m = chosen->figures().smoothing_width_m;
  const Usage fitted = Now();
  PrintFit(chosen->figures());
  config.reduction_ratio = 0.0;
  const Result<VariationalSurface> all = VariationalSurface::Fit(points, config);
  if (!all) return tl::unexpected(all.error());
  PrintFit(all->figures());
  const Usage second = Now();
  const bool quick = words.size() > 3;
  const Result<VariationalCloud> cloud = VariationalCloud::Fit(
      quick ? std::vector<MeasuredPoint>(points.begin(), points.begin() + 100) : points, config);
  if (!cloud) return tl::unexpected(cloud.error());
  const Usage done = Now();
  double of_cells = 0.0;
  double of_all = 0.0;
  double of_cloud = 0.0;
  std::size_t count = 0;
  for (const MeasuredPoint& point : TorusPoints(40000, 0.0, 13)) {
    const Eigen::Vector3d x = point.position.cast<double>();
    const FieldSample at = chosen->Query(x);
    const FieldSample at_all = all->Query(x);
    if (!at.supported || !at_all.supported) continue;
    of_cells += std::pow(static_cast<double>(at.distance), 2);
    of_all += std::pow(static_cast<double>(at_all.distance), 2);
    of_cloud += std::pow(cloud->Distance(x), 2);
    ++count;
  }
  const auto rms = [&](double sum) {
    return std::sqrt(sum / static_cast<double>(count)) / kNoiseM;
  };
  std::printf(
      "error / sigma at %zu true points: cells with merged points %.4f, cells with all "
      "points %.4f, one system %.4f; CPU %.2f, %.2f, %.2f s\n",
      count, rms(of_cells), rms(of_all), rms(of_cloud), fitted.cpu_s - start.cpu_s,
      second.cpu_s - fitted.cpu_s, done.cpu_s - second.cpu_s);
  return {};
}

Status Proof(const std::vector<std::string>& words) {
  Result<Mesh> truth = MakeProofObject(words[0]);
  if (!truth) return tl::unexpected(truth.error());
  const Result<ProofScene> scene = RenderProof(std::move(*truth), std::stod(words[1]));
  if (!scene) return tl::unexpected(scene.error());
  VariationalConfig config;
  std::vector<const RangeImage*> ranges;
  for (const View& view : scene->views) ranges.push_back(&view.range);
  config.voxel_m = words.size() > 4 ? std::stod(words[4]) : MedianPointSpacing(ranges);
  if (words.size() > 3) config.smoothing_width_m = std::stod(words[3]);
  const Usage start = Now();
  const auto points = MeasuredPoints(scene->views, config);
  if (!points) return tl::unexpected(points.error());
  const Result<VariationalSurface> surface = VariationalSurface::Fit(*points, config);
  if (!surface) return tl::unexpected(surface.error());
  const Usage fitted = Now();
  const Result<Mesh> mesh = ExtractMesh(*surface, SurfaceConfig{});
  if (!mesh) return tl::unexpected(mesh.error());
  const Usage done = Now();
  PrintFit(surface->figures());
  std::printf("%zu points, voxel %.3f mm: wall %.2f s, CPU %.2f + %.2f s, peak %.0f MB more\n",
              points->size(), 1e3 * config.voxel_m, done.wall_s - start.wall_s,
              fitted.cpu_s - start.cpu_s, done.cpu_s - fitted.cpu_s, done.peak_mb - start.peak_mb);
  return WriteMesh(*mesh, words[2]);
}

int Main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  const std::string command = words.empty() ? "" : words[0];
  const std::vector<std::string> rest(words.begin() + (words.empty() ? 0 : 1), words.end());
  Status status = Fail("usage: rbf_bench scale N... | reference [WIDTH] | proof OBJECT SIGMA MESH");
  if (command == "scale") status = Scale(rest);
  if (command == "reference") status = Reference(rest);
  if (command == "proof" && rest.size() >= 3) status = Proof(rest);
  if (!status) std::fprintf(stderr, "rbf_bench: %s\n", status.error().message.c_str());
  return status ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace fringe_fusion::bench

int main(int argc, char** argv) { return fringe_fusion::bench::Main(argc, argv); }
