#include <benchmark/benchmark.h>

#include <stdexcept>
#include <utility>

#include "bench/bench_scene.hpp"
#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion {
namespace {

constexpr double kMega = 1e-6;

sim::SimCell MakeCell(const benchmark::State& state) {
  sim::SimConfig config;
  config.gain_dn = 0.05;
  config.read_noise_dn = 1.0;
  return bench::MakeBenchCell(config, static_cast<int>(state.range(0)),
                              static_cast<int>(state.range(1)), 3);
}

PhaseMap MakeMap(sim::SimCell& cell) {
  const CameraModel& projector = cell.calibration().projector;
  const auto sequence = MakeSequence({}, projector.width, projector.height);
  if (!sequence) throw std::runtime_error(sequence.error().message);
  const auto stack = CaptureStack(cell, *sequence, 1.0, cell.config().exposure_reference_s, 0);
  if (!stack) throw std::runtime_error(stack.error().message);
  Result<PhaseMap> map = DecodePhase(*stack, {});
  if (!map) throw std::runtime_error(map.error().message);
  return std::move(*map);
}

void Sizes(benchmark::internal::Benchmark* bench) {
  bench->Args({640, 480})->Args({1280, 1024})->Args({2448, 2048});
  bench->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
}

void CountPoints(benchmark::State& state, const RangeImage& range) {
  state.counters["points"] = CountValid(range);
  state.counters["Mpoints/s"] =
      benchmark::Counter(kMega * CountValid(range), benchmark::Counter::kIsIterationInvariantRate);
}

// Points with normals, specks removed; the ray table is made once per camera.
void BM_Triangulate(benchmark::State& state) {
  sim::SimCell cell = MakeCell(state);
  const PhaseMap map = MakeMap(cell);
  const Image<Eigen::Vector2f> rays = MakeRayTable(cell.calibration().camera);
  RangeImage range;
  for (auto _ : state) {
    Result<TriangulationResult> result = Triangulate(map, cell.calibration(), rays, {});
    if (!result) state.SkipWithError(result.error().message.c_str());
    range = std::move(result->range);
    benchmark::DoNotOptimize(range);
  }
  CountPoints(state, range);
}
BENCHMARK(BM_Triangulate)->Apply(Sizes);

void BM_EstimateNormals(benchmark::State& state) {
  sim::SimCell cell = MakeCell(state);
  const Result<TriangulationResult> result = Triangulate(MakeMap(cell), cell.calibration(), {});
  if (!result) {
    state.SkipWithError(result.error().message.c_str());
    return;
  }
  RangeImage range;
  for (auto _ : state) {
    range = EstimateNormals(result->range, {});
    benchmark::DoNotOptimize(range);
  }
  CountPoints(state, range);
}
BENCHMARK(BM_EstimateNormals)->Apply(Sizes);

void BM_MakeRayTable(benchmark::State& state) {
  const CameraModel camera =
      bench::ScannerOfSize(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)))
          .camera;
  for (auto _ : state) {
    const Image<Eigen::Vector2f> rays = MakeRayTable(camera);
    benchmark::DoNotOptimize(rays);
  }
}
BENCHMARK(BM_MakeRayTable)->Apply(Sizes);

}  // namespace
}  // namespace fringe_fusion
