#include <benchmark/benchmark.h>

#include "bench/fusion_scene.hpp"
#include "fringe_fusion/surface/fuse_views.hpp"

namespace fringe_fusion {
namespace {

constexpr double kMega = 1e-6;

// One view into an empty model. Arguments: width, height, voxel [um].
void BM_AddView(benchmark::State& state) {
  const View view = bench::BallView(0, static_cast<int>(state.range(0)),
                                    static_cast<int>(state.range(1)), {1.0, 0.5, 0.3});
  const double voxel_m = 1e-6 * static_cast<double>(state.range(2));
  for (auto _ : state) {
    ImplicitModel model = bench::MakeModel(voxel_m);
    const Status status = model.AddView(view);
    if (!status) state.SkipWithError(status.error().message.c_str());
    benchmark::DoNotOptimize(model);
  }
  state.counters["points"] = CountValid(view.range);
  state.counters["Mpoints/s"] = benchmark::Counter(kMega * CountValid(view.range),
                                                   benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(BM_AddView)
    ->Args({640, 480, 1000})
    ->Args({1280, 1024, 2000})
    ->Args({1280, 1024, 1000})
    ->Args({2448, 2048, 1000})
    ->Args({640, 480, 500})
    ->Args({1280, 1024, 500})
    ->Args({2448, 2048, 500})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();

// Twelve views of about 150 000 points each, fused and extracted. Argument: voxel [um].
void BM_FuseTwelveViews(benchmark::State& state) {
  const std::vector<View> views = bench::BallViews(12, 560, 460);
  FusionConfig config;
  config.voxel_m = 1e-6 * static_cast<double>(state.range(0));
  std::size_t num_faces = 0;
  std::size_t memory_bytes = 0;
  for (auto _ : state) {
    const Result<FusedSurface> fused = FuseViews(views, config, CropConfig{}, SurfaceConfig{});
    if (!fused) {
      state.SkipWithError(fused.error().message.c_str());
      continue;
    }
    num_faces = fused->mesh.faces.size();
    memory_bytes = fused->figures.memory_bytes;
  }
  state.counters["points"] = 12.0 * CountValid(views[0].range);
  state.counters["faces"] = static_cast<double>(num_faces);
  state.counters["model_MB"] = kMega * static_cast<double>(memory_bytes);
}
BENCHMARK(BM_FuseTwelveViews)
    ->Arg(1000)
    ->Arg(500)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();

}  // namespace
}  // namespace fringe_fusion
