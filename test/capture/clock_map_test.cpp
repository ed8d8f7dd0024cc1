#include "fringe_fusion/capture/clock_map.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

namespace fringe_fusion {
namespace {

constexpr std::int64_t kMillisecond = 1000000;

// A camera whose clock started elsewhere and runs 40 ppm fast, triggered every 50 ms; the exposure
// begins up to 1 ms after the trigger and the data arrive 3 to 30 ms later.
class SimulatedCamera {
 public:
  explicit SimulatedCamera(unsigned seed) : random_(seed) {}
  struct Frame {
    std::int64_t true_start_ns;
    std::int64_t device_ns;
    std::int64_t trigger_ns;
    std::int64_t arrival_ns;
  };
  Frame Next() {
    trigger_ns_ += 50 * kMillisecond;
    const auto delay_ns = static_cast<std::int64_t>(random_() % 1000) * 1000;
    const auto transfer_ns = static_cast<std::int64_t>(3000 + random_() % 27000) * 1000;
    const std::int64_t start_ns = trigger_ns_ + delay_ns;
    const auto run_ns = static_cast<std::int64_t>(static_cast<double>(start_ns - kEpoch) * 1.00004);
    return {start_ns, kDeviceEpoch + run_ns, trigger_ns_, start_ns + transfer_ns};
  }

 private:
  static constexpr std::int64_t kEpoch = 1700000000000000000;
  static constexpr std::int64_t kDeviceEpoch = 123456789;
  std::mt19937 random_;
  std::int64_t trigger_ns_ = kEpoch;
};

TEST(ClockMap, FindsTheHostTimeDespiteDriftAndJitter) {
  SimulatedCamera camera(1);
  ClockMap map;
  std::int64_t last_ns = 0;
  for (int i = 0; i < 1000; ++i) {
    const SimulatedCamera::Frame frame = camera.Next();
    const ClockMap::HostTime time = map.Add(frame.device_ns, frame.trigger_ns, frame.arrival_ns);
    EXPECT_GE(time.host_ns, frame.trigger_ns);
    EXPECT_LE(time.host_ns, frame.arrival_ns);
    EXPECT_GT(time.host_ns, last_ns);
    EXPECT_LE(std::abs(time.host_ns - frame.true_start_ns), time.uncertainty_ns + 1) << i;
    last_ns = time.host_ns;
    // The shortest of 64 transfers is near 3 ms: half of that, of the trigger's delay and of the
    // drift remain, while the arrival alone would be wrong by up to 30 ms.
    if (i > 64) {
      EXPECT_LT(std::abs(time.host_ns - frame.true_start_ns), 3 * kMillisecond) << i;
      EXPECT_LT(time.uncertainty_ns, 4 * kMillisecond) << i;
    }
  }
}

TEST(ClockMap, StartsAnewWhenAClockWasSet) {
  SimulatedCamera camera(2);
  ClockMap map;
  for (int i = 0; i < 20; ++i) {
    const SimulatedCamera::Frame frame = camera.Next();
    map.Add(frame.device_ns, frame.trigger_ns, frame.arrival_ns);
  }
  const SimulatedCamera::Frame frame = camera.Next();
  const std::int64_t reset_device_ns = 17;
  const ClockMap::HostTime time = map.Add(reset_device_ns, frame.trigger_ns, frame.arrival_ns);
  EXPECT_GE(time.host_ns, frame.trigger_ns);
  EXPECT_LE(time.host_ns, frame.arrival_ns);
  const auto later = map.Map(reset_device_ns + 50 * kMillisecond);
  ASSERT_TRUE(later);
  EXPECT_NEAR(static_cast<double>(later->host_ns - time.host_ns), 50.0 * kMillisecond, 1.0);
}

TEST(ClockMap, KnowsNothingBeforeTheFirstFrame) {
  ClockMap map;
  EXPECT_FALSE(map.Map(5));
  map.Add(5, 100, 120);
  EXPECT_EQ(map.Map(5)->host_ns, 110);
  EXPECT_EQ(map.Map(5)->uncertainty_ns, 10);
  map.Reset();
  EXPECT_FALSE(map.Map(5));
}

TEST(ClockMap, SurvivesBoundsThatContradictEachOther) {
  ClockMap map;
  EXPECT_EQ(map.Add(5, 100, 90).host_ns, 100);
}

}  // namespace
}  // namespace fringe_fusion
