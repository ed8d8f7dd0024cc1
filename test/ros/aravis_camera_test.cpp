// The GenICam camera against GigE Vision servers on loopback, without a ROS master.
#include "nodes/backends/aravis_camera.hpp"

#include <gtest/gtest.h>
#include <ros/time.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <map>
#include <mutex>
#include <thread>
#include <vector>

#include "nodes/backends/gige_server.hpp"

namespace fringe_fusion::nodes {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr double kExposureS = 0.005;

std::int64_t NowNs() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
}

// A scene whose every exposure looks different: the first two pixels count, the rest is noise.
class Scene {
 public:
  Result<CapturedFrame> Expose(double exposure_s) {
    const std::int64_t begin_ns = NowNs();
    CapturedFrame frame;
    Image<std::uint8_t> image = Picture(++num_exposed_);
    std::this_thread::sleep_for(std::chrono::duration<double>(exposure_s));
    const std::lock_guard<std::mutex> lock(mutex_);
    begin_ns_[num_exposed_] = begin_ns;
    frame.pixels = std::move(image);
    last_exposure_s_ = exposure_s;
    return frame;
  }

  static Image<std::uint8_t> Picture(int number) {
    Image<std::uint8_t> image(kWidth, kHeight);
    auto state = static_cast<std::uint32_t>(number);
    for (std::uint8_t& pixel : image) {
      state = 1664525U * state + 1013904223U;
      pixel = static_cast<std::uint8_t>(state >> 24U);
    }
    image[0] = static_cast<std::uint8_t>(number & 255);
    image[1] = static_cast<std::uint8_t>(number >> 8);
    return image;
  }
  static int Number(const Image<std::uint8_t>& image) { return image[0] + 256 * image[1]; }

  [[nodiscard]] int num_exposed() const { return num_exposed_; }
  double last_exposure_s() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return last_exposure_s_;
  }
  std::int64_t begin_ns(int number) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return begin_ns_.at(number);
  }

 private:
  std::atomic<int> num_exposed_{0};
  std::mutex mutex_;
  std::map<int, std::int64_t> begin_ns_;
  double last_exposure_s_ = 0.0;
};

class AravisCameraTest : public ::testing::Test {
 protected:
  void StartServer(double lost_ratio) {
    auto server =
        GigeServer::Start({"127.0.0.1", "FFTEST1", lost_ratio},
                          [this](double exposure_s) { return scene_.Expose(exposure_s); });
    ASSERT_TRUE(server) << server.error().message;
    server_ = std::move(*server);
  }

  static AravisCameraConfig Config() {
    AravisCameraConfig config;
    config.device = "127.0.0.1";
    config.frame_timeout_s = 0.5;
    return config;
  }

  // Takes one picture and checks that it is the newest one of the scene, byte for byte.
  CapturedFrame CaptureChecked() { return CaptureChecked(camera_); }
  CapturedFrame CaptureChecked(AravisCamera& camera) {
    const std::int64_t before_ns = NowNs();
    const Result<CapturedFrame> frame = camera.Capture(5.0);
    if (!frame) {
      ADD_FAILURE() << frame.error().message;
      return {};
    }
    const auto& image = std::get<Image<std::uint8_t>>(frame->pixels);
    const int number = Scene::Number(image);
    EXPECT_EQ(number, scene_.num_exposed());
    const Image<std::uint8_t> expected = Scene::Picture(number);
    EXPECT_TRUE(std::equal(image.begin(), image.end(), expected.begin(), expected.end()));
    EXPECT_GT(frame->stamp_ns, before_ns);
    EXPECT_LT(frame->stamp_ns, NowNs());
    EXPECT_DOUBLE_EQ(frame->exposure_s, kExposureS);
    return *frame;
  }

  Scene scene_;
  std::unique_ptr<GigeServer> server_;
  AravisCamera camera_{Config(), kWidth, kHeight};
};

TEST_F(AravisCameraTest, GivesTheFrameOfEveryTriggerWithTrueStamps) {
  StartServer(0.0);
  ASSERT_TRUE(camera_.Configure(kExposureS, 1.0));
  std::int64_t last_ns = 0;
  std::vector<double> errors_s;
  // 200 frames: the simulated device numbers its 16 bit frames from 65401 on, so they wrap.
  for (int i = 0; i < 200; ++i) {
    const CapturedFrame frame = CaptureChecked();
    EXPECT_GT(frame.stamp_ns, last_ns);
    last_ns = frame.stamp_ns;
    const std::int64_t middle_ns =
        scene_.begin_ns(scene_.num_exposed()) + static_cast<std::int64_t>(0.5e9 * kExposureS);
    errors_s.push_back(1e-9 * static_cast<double>(std::abs(frame.stamp_ns - middle_ns)));
  }
  EXPECT_EQ(scene_.num_exposed(), 200);
  EXPECT_DOUBLE_EQ(scene_.last_exposure_s(), kExposureS);
  // Server and camera share a clock, so every stamp can be checked; what is left of the first
  // frames' uncertainty and of a busy machine stays below the time from frame to frame.
  std::nth_element(errors_s.begin(), errors_s.begin() + 100, errors_s.end());
  EXPECT_LT(errors_s[100], 0.003);
}

TEST_F(AravisCameraTest, TriggersAgainWhenPacketsAreLost) {
  StartServer(0.005);  // 56 packets a frame: one frame in four is incomplete.
  AravisCameraConfig config = Config();
  config.retries = 15;  // The losses are random: with the usual 3 one run in ten would fail.
  AravisCamera camera(config, kWidth, kHeight);
  ASSERT_TRUE(camera.Configure(kExposureS, 1.0));
  for (int i = 0; i < 30; ++i) CaptureChecked(camera);
  EXPECT_GT(scene_.num_exposed(), 30);
}

TEST_F(AravisCameraTest, SaysSoWhenEveryFrameIsIncompleteAndRecovers) {
  StartServer(0.3);
  ASSERT_TRUE(camera_.Configure(kExposureS, 1.0));
  const Result<CapturedFrame> lossy = camera_.Capture(5.0);
  ASSERT_FALSE(lossy);
  EXPECT_NE(lossy.error().message.find("after 4 software triggers"), std::string::npos)
      << lossy.error().message;
  EXPECT_NE(lossy.error().message.find("FFTEST1"), std::string::npos) << lossy.error().message;
  server_.reset();
  StartServer(0.0);
  (void)camera_.Capture(5.0);  // May still find out that the device went away.
  CaptureChecked();
}

TEST_F(AravisCameraTest, SaysThatTheDeviceIsMissingAndWorksOnceItIsThere) {
  ASSERT_TRUE(camera_.Configure(kExposureS, 1.0));
  const Result<CapturedFrame> missing = camera_.Capture(2.0);
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().message.find("'127.0.0.1' was not found"), std::string::npos)
      << missing.error().message;
  StartServer(0.0);
  CaptureChecked();
}

TEST_F(AravisCameraTest, FindsTheDeviceByItsSerialNumber) {
  StartServer(0.0);
  AravisCameraConfig config = Config();
  config.device = "FFTEST1";
  AravisCamera camera(config, kWidth, kHeight);
  ASSERT_TRUE(camera.Configure(kExposureS, 1.0));
  CaptureChecked(camera);
  config.device = "FFTEST2";
  AravisCamera other(config, kWidth, kHeight);
  ASSERT_TRUE(other.Configure(kExposureS, 1.0));
  const Result<CapturedFrame> missing = other.Capture(2.0);
  ASSERT_FALSE(missing);
  for (const char* word : {"'FFTEST2' was not found", "FFTEST1 at 127.0.0.1"}) {
    EXPECT_NE(missing.error().message.find(word), std::string::npos) << missing.error().message;
  }
}

TEST_F(AravisCameraTest, NamesADeviceThatStopsAnswering) {
  StartServer(0.0);
  ASSERT_TRUE(camera_.Configure(kExposureS, 1.0));
  CaptureChecked();
  server_.reset();
  const auto begin = std::chrono::steady_clock::now();
  const Result<CapturedFrame> dead = camera_.Capture(2.0);
  const std::chrono::duration<double> duration = std::chrono::steady_clock::now() - begin;
  ASSERT_FALSE(dead);
  EXPECT_NE(dead.error().message.find("FFTEST1"), std::string::npos) << dead.error().message;
  EXPECT_LT(duration.count(), 8.0);
}

TEST_F(AravisCameraTest, RefusesAnExposureThatTheDeviceDoesNotKnow) {
  StartServer(0.0);
  ASSERT_TRUE(camera_.Configure(1e6, 1.0));
  const Result<CapturedFrame> refused = camera_.Capture(2.0);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("exposure 1000000 s is outside"), std::string::npos)
      << refused.error().message;
  ASSERT_TRUE(camera_.Configure(kExposureS, 1.0));
  CaptureChecked();
}

TEST(AravisCameraConfig, KnowsItsPixelFormats) {
  AravisCameraConfig config;
  EXPECT_TRUE(Validate(config, "aravis"));
  config.pixel_format = "BayerRG8";
  EXPECT_FALSE(Validate(config, "aravis"));
}

}  // namespace
}  // namespace fringe_fusion::nodes

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::Time::init();  // The throttled log of the server asks for the time.
  return RUN_ALL_TESTS();
}
