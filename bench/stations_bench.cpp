#include <benchmark/benchmark.h>

#include "test/pose/station_scene.hpp"

namespace fringe_fusion {
namespace {

// Joint solution of four rolled stations; argument: tracks; all intrinsics are free.
void BM_Stations(benchmark::State& state) {
  const testing::StationScene scene = testing::MakeStationScene(4, 90.0);
  const int rows = static_cast<int>(std::sqrt(static_cast<double>(state.range(0)) / 1.6));
  const TrackSet tracks = testing::MakeTracks(scene, 8 * rows / 5, rows, 0.08, 1);
  const IntrinsicsPrior free{kFree, kFree, kFree};
  int iterations = 0;
  for (auto _ : state) {
    const auto result = SolveStations(tracks, free, free, testing::BaselineOf(scene), {}, {});
    if (!result) {
      state.SkipWithError(result.error().message.c_str());
      break;
    }
    iterations = result->iterations;
  }
  state.counters["tracks"] = static_cast<double>(tracks.anchor_px.size());
  state.counters["sightings"] = static_cast<double>(tracks.observations.size());
  state.counters["iterations"] = iterations;
}
BENCHMARK(BM_Stations)->Arg(1000)->Arg(100000)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace fringe_fusion
