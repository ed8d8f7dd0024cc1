#include <benchmark/benchmark.h>

#include "test/registration/bumpy_views.hpp"

namespace fringe_fusion {
namespace {

// Twelve views of a bumpy body that fills half of an image of the given size, from turntable
// priors of 0.05 deg and 0.2 mm.
void BM_RegisterViews(benchmark::State& state) {
  testing::BumpyScene scene;
  scene.num_views = 12;
  scene.width = static_cast<int>(state.range(0));
  scene.height = static_cast<int>(state.range(1));
  const testing::BumpyGraph truth = testing::MakeBumpyGraph(scene);
  double num_points = 0.0;
  for (const View& view : truth.graph.views) num_points += CountValid(view.range);
  int iterations = 0;
  for (auto _ : state) {
    const Result<RegistrationResult> result = RegisterViews(truth.graph, RegistrationConfig());
    if (!result) {
      state.SkipWithError(result.error().message.c_str());
      break;
    }
    iterations = result->iterations;
  }
  state.counters["points"] = num_points;
  state.counters["iterations"] = iterations;
}
BENCHMARK(BM_RegisterViews)
    ->Args({640, 480})
    ->Args({1280, 1024})
    ->Args({2448, 2048})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();

}  // namespace
}  // namespace fringe_fusion
