#include <benchmark/benchmark.h>

#include "bench/fusion_scene.hpp"
#include "fringe_fusion/surface/extract_mesh.hpp"

namespace fringe_fusion {
namespace {

// The mesh of a closed ball from its model. Arguments: width, height of the twelve views, voxel
// [um].
void BM_ExtractMesh(benchmark::State& state) {
  ImplicitModel model = bench::MakeModel(1e-6 * static_cast<double>(state.range(2)));
  const Status status = model.AddViews(
      bench::BallViews(12, static_cast<int>(state.range(0)), static_cast<int>(state.range(1))));
  if (!status) state.SkipWithError(status.error().message.c_str());
  std::size_t num_faces = 0;
  for (auto _ : state) {
    const Result<Mesh> mesh = ExtractMesh(model, SurfaceConfig{});
    if (!mesh) {
      state.SkipWithError(mesh.error().message.c_str());
      continue;
    }
    num_faces = mesh->faces.size();
  }
  state.counters["faces"] = static_cast<double>(num_faces);
  state.counters["blocks"] = static_cast<double>(model.NumBlocks());
}
BENCHMARK(BM_ExtractMesh)
    ->Args({640, 480, 1000})
    ->Args({1280, 1024, 500})
    ->Args({2448, 2048, 500})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->MeasureProcessCPUTime();

}  // namespace
}  // namespace fringe_fusion
