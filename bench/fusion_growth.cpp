// How time and memory of the fusion grow with the number of points, at ten points per voxel of the
// surface of a ball. Subcommands:
//   whole N...          twelve views with about N points together, model and mesh in memory
//   slabs GB FILE N...  views of about 850 000 points, read one at a time, fused slab by slab
// Each N runs in a process of its own where peak memory counts: give one.

#include <sys/resource.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "bench/fusion_scene.hpp"
#include "fringe_fusion/surface/fuse_slabs.hpp"
#include "fringe_fusion/surface/fuse_views.hpp"

namespace fringe_fusion::bench {
namespace {

constexpr double kPointsPerVoxel = 10.0;
constexpr double kBallRadiusM = 0.05;
constexpr double kShareOfImage = 0.518;  // of height^2 that the ball covers in BallView
constexpr int kNumViews = 12;

double VoxelFor(double num_points) {
  const double area = 4.0 * M_PI * kBallRadiusM * kBallRadiusM;
  return std::sqrt(kPointsPerVoxel * area / num_points);
}

double CpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double PeakMegabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

void Print(const char* how, std::size_t num_points, double voxel_m, double cpu_s,
           double megabytes) {
  const auto count = static_cast<double>(num_points);
  std::printf("| %s | %.3g | %.4f | %.2f | %.2f | %.0f | %.0f |\n", how, count, 1e3 * voxel_m,
              cpu_s, 1e6 * cpu_s / count, megabytes, megabytes * 1024.0 * 1024.0 / count);
}

Status Whole(double num_points) {
  const auto height =
      static_cast<int>(std::lround(std::sqrt(num_points / kNumViews / kShareOfImage)));
  const std::vector<View> views = BallViews(kNumViews, height, height);
  FusionConfig config;
  config.voxel_m = VoxelFor(num_points);
  const double memory = PeakMegabytes();
  const double start = CpuSeconds();
  const auto fused = FuseViews(views, config, CropConfig{}, SurfaceConfig{});
  if (!fused) return tl::unexpected(fused.error());
  Print("whole", static_cast<std::size_t>(fused->figures.num_points), config.voxel_m,
        CpuSeconds() - start, PeakMegabytes() - memory);
  return {};
}

Status Slabs(double limit_gb, const std::string& file, double num_points) {
  constexpr int kHeight = 1280;
  const double per_view = kShareOfImage * kHeight * kHeight;
  const int count = std::max(1, static_cast<int>(std::lround(num_points / per_view)));
  SlabJob job;
  job.fusion.voxel_m = VoxelFor(num_points);
  job.fusion.max_memory_gb = limit_gb;
  job.mesh_path = file;
  double render_s = 0.0;
  const ViewReader read = [&](int index) {
    const double start = CpuSeconds();
    const double angle = 2.4 * index;
    const double z = -1.0 + 2.0 * (index + 0.5) / count;
    const double r = std::sqrt(1.0 - z * z);
    View view = BallView(index, kHeight, kHeight,
                         Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), z));
    render_s += CpuSeconds() - start;
    return view;
  };
  const double start = CpuSeconds();
  const auto figures = FuseSlabs(job, count, read);
  if (!figures) return tl::unexpected(figures.error());
  Print("slabs", figures->num_points, job.fusion.voxel_m, CpuSeconds() - start - render_s,
        PeakMegabytes());
  std::printf(
      "  %d views, %d slabs, %zu blocks, %zu faces, scratch %.2f GB; wall: samples %.1f s "
      "(rendering "
      "%.1f s of CPU included), weights %.1f s, mesh %.1f s\n",
      figures->num_views, figures->num_slabs, figures->num_blocks, figures->num_faces,
      1e-9 * static_cast<double>(figures->scratch_bytes), figures->read_s, render_s,
      figures->weigh_s, figures->extract_s);
  return {};
}

int Main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  Status status = Fail("usage: fusion_growth whole N... | slabs GB FILE.ply N...");
  const std::string command = words.empty() ? "" : words[0];
  const std::size_t first = command == "slabs" ? 3 : 1;
  for (std::size_t i = first; i < words.size(); ++i) {
    const double count = std::stod(words[i]);
    status = command == "slabs" ? Slabs(std::stod(words[1]), words[2], count) : Whole(count);
    if (!status) break;
  }
  if (!status) std::fprintf(stderr, "fusion_growth: %s\n", status.error().message.c_str());
  return status ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace fringe_fusion::bench

int main(int argc, char** argv) { return fringe_fusion::bench::Main(argc, argv); }
