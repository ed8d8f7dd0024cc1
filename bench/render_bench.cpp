#include <benchmark/benchmark.h>

#include "bench/bench_scene.hpp"

namespace fringe_fusion {
namespace {

constexpr double kMega = 1e-6;

sim::SimConfig NoisyConfig() {
  sim::SimConfig config;
  config.gain_dn = 0.05;
  config.read_noise_dn = 1.0;
  return config;
}

void Sizes(benchmark::internal::Benchmark* bench) {
  bench->Args({640, 480})->Args({1280, 1024})->Args({2448, 2048});
  bench->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
}

void CountPixels(benchmark::State& state) {
  const double pixels = static_cast<double>(state.range(0)) * static_cast<double>(state.range(1));
  state.counters["Mpx/s"] =
      benchmark::Counter(kMega * pixels, benchmark::Counter::kIsIterationInvariantRate);
}

// One picture of a phase pattern at a known pose.
void Expose(benchmark::State& state, sim::SimCell cell) {
  Pattern pattern;
  pattern.kind = PatternKind::kPhase;
  pattern.fringes = 64.0;
  pattern.steps = 4;
  const CameraModel& projector = cell.calibration().projector;
  const Image<std::uint8_t> picture =
      RenderPattern(pattern, projector.width, projector.height, 1.0);
  int frame_index = 0;
  for (auto _ : state) {
    const Result<CapturedFrame> frame = cell.Expose(picture, 0.02, frame_index++);
    if (!frame) state.SkipWithError(frame.error().message.c_str());
    benchmark::DoNotOptimize(frame);
  }
  CountPixels(state);
}

sim::SimCell PartCell(const benchmark::State& state, const sim::SimConfig& config) {
  return bench::MakeBenchCell(config, static_cast<int>(state.range(0)),
                              static_cast<int>(state.range(1)), 3);
}

void BM_Expose(benchmark::State& state) { Expose(state, PartCell(state, NoisyConfig())); }
BENCHMARK(BM_Expose)->Apply(Sizes);

// The dearest case: every pixel is lit.
void BM_ExposeFilled(benchmark::State& state) {
  Result<sim::SimCell> cell = sim::SimCell::Create(
      NoisyConfig(),
      bench::ScannerOfSize(static_cast<int>(state.range(0)), static_cast<int>(state.range(1))),
      sim::MakePlane(0.5, 50), Mesh{});
  const Transform T = sim::TurntablePose(0, 1, 0.5, 80.0, Eigen::Vector3d::Zero());
  if (!cell || !cell->MoveTo(T, 0)) {
    state.SkipWithError("no cell");
    return;
  }
  Expose(state, std::move(*cell));
}
BENCHMARK(BM_ExposeFilled)->Apply(Sizes);

void BM_ExposeBlurred(benchmark::State& state) {
  sim::SimConfig config = NoisyConfig();
  config.projector_blur_px = 0.8;
  config.camera_blur_px = 0.6;
  config.bit_depth = 12;
  Expose(state, PartCell(state, config));
}
BENCHMARK(BM_ExposeBlurred)->Apply(Sizes);

void BM_ExposeInterreflection(benchmark::State& state) {
  sim::SimConfig config = NoisyConfig();
  config.interreflection = true;
  Expose(state, PartCell(state, config));
}
BENCHMARK(BM_ExposeInterreflection)->Apply(Sizes);

// All rays of one pose.
void BM_MoveTo(benchmark::State& state) {
  sim::SimCell cell = bench::MakeBenchCell(NoisyConfig(), static_cast<int>(state.range(0)),
                                           static_cast<int>(state.range(1)), 3);
  const Transform T = sim::TurntablePose(4, 12, 0.5, 25.0, Eigen::Vector3d(0.0, 0.0, 0.035));
  for (auto _ : state) {
    const Status status = cell.MoveTo(T, 4);
    if (!status) state.SkipWithError(status.error().message.c_str());
  }
  CountPixels(state);
}
BENCHMARK(BM_MoveTo)->Apply(Sizes);

}  // namespace
}  // namespace fringe_fusion
