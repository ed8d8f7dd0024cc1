#include <benchmark/benchmark.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "bench/bench_scene.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/phase/phase_map.hpp"

namespace fringe_fusion {
namespace {

constexpr double kMega = 1e-6;

ImageStack MakeStack(const benchmark::State& state, bool gray, const std::string& fringes) {
  sim::SimConfig config;
  config.gain_dn = 0.05;
  config.read_noise_dn = 1.0;
  sim::SimCell cell = bench::MakeBenchCell(config, static_cast<int>(state.range(0)),
                                           static_cast<int>(state.range(1)), 3);
  PatternConfig pattern;
  pattern.gray = gray;
  pattern.fringes = fringes;
  const CameraModel& projector = cell.calibration().projector;
  const auto sequence = MakeSequence(pattern, projector.width, projector.height);
  if (!sequence) throw std::runtime_error(sequence.error().message);
  Result<ImageStack> stack = CaptureStack(cell, *sequence, 1.0, config.exposure_reference_s, 0);
  if (!stack) throw std::runtime_error(stack.error().message);
  return std::move(*stack);
}

void Decode(benchmark::State& state, bool gray, const std::string& fringes) {
  const ImageStack stack = MakeStack(state, gray, fringes);
  for (auto _ : state) {
    const Result<PhaseMap> map = DecodePhase(stack, {});
    if (!map) state.SkipWithError(map.error().message.c_str());
    benchmark::DoNotOptimize(map);
  }
  const double pixels = static_cast<double>(state.range(0)) * static_cast<double>(state.range(1)) *
                        static_cast<double>(stack.frames.size());
  state.counters["Mpx-frames/s"] =
      benchmark::Counter(kMega * pixels, benchmark::Counter::kIsIterationInvariantRate);
}

void Sizes(benchmark::internal::Benchmark* bench) {
  bench->Args({640, 480})->Args({1280, 1024})->Args({2448, 2048});
  bench->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
}

// White, black and 4 steps of 1, 8 and 64 fringes on both axes: 26 frames.
void BM_DecodePhaseSteps(benchmark::State& state) { Decode(state, false, "1,8,64"); }
BENCHMARK(BM_DecodePhaseSteps)->Apply(Sizes);

// The same frames copied by the same number of threads: the yardstick of BM_DecodePhaseSteps.
void BM_CopyFrames(benchmark::State& state) {
  const ImageStack stack = MakeStack(state, false, "1,8,64");
  std::vector<CapturedFrame> copies = stack.frames;
  const int num_frames = static_cast<int>(stack.frames.size());
  const int height = static_cast<int>(state.range(1));
  constexpr int kRowsPerChunk = 64;
  const int num_chunks = (height + kRowsPerChunk - 1) / kRowsPerChunk;
  for (auto _ : state) {
    ParallelFor(num_frames * num_chunks, 1, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        const auto frame = static_cast<std::size_t>(i / num_chunks);
        const int first = (i % num_chunks) * kRowsPerChunk;
        const int rows = std::min(kRowsPerChunk, height - first);
        const auto& from = std::get<Image<std::uint8_t>>(stack.frames[frame].pixels);
        auto& to = std::get<Image<std::uint8_t>>(copies[frame].pixels);
        const auto count = static_cast<std::ptrdiff_t>(rows) * from.width();
        std::copy_n(from.row(first), count, to.row(first));
      }
    });
    benchmark::ClobberMemory();
  }
}
BENCHMARK(BM_CopyFrames)->Apply(Sizes);

// Gray code with inverses on both axes, one pixel per projector cell.
void BM_DecodeGrayCode(benchmark::State& state) { Decode(state, true, ""); }
BENCHMARK(BM_DecodeGrayCode)->Apply(Sizes);

}  // namespace
}  // namespace fringe_fusion
