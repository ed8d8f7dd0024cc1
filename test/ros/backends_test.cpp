// Device backends that need no ROS master: simulated axes and recordings.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/sim/gauges.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"
#include "nodes/backends/replay_camera.hpp"
#include "nodes/backends/replay_motion.hpp"
#include "nodes/backends/replay_projector.hpp"
#include "nodes/backends/sim_motion.hpp"
#include "nodes/truth_folder.hpp"

namespace fringe_fusion::nodes {
namespace {

class SimMotionTest : public ::testing::Test {
 protected:
  Motion::State StateAt(double time_s) {
    now_s_ = time_s;
    return motion_.Poll().value();
  }

  double now_s_ = 0.0;
  SimMotionConfig config_{3.0, 15.0, 0.1};
  SimMotion motion_{config_, {0.0, 1.0}, [this] { return now_s_; }};
};

TEST_F(SimMotionTest, KeepsSpeedAndAccelerationAndArrivesExactly) {
  const std::vector<double> target = {2.0, 0.5};
  ASSERT_TRUE(motion_.MoveTo(target));
  // Trapezoid: 2 rad at 3 rad/s and 15 rad/s^2 take 2 / 3 + 3 / 15 s.
  const double duration_s = 2.0 / 3.0 + 3.0 / 15.0;
  constexpr double kStepS = 1e-4;
  std::vector<double> last = StateAt(0.0).joint_positions;
  double last_speed = 0.0;
  for (double t = kStepS; t < duration_s; t += kStepS) {
    const Motion::State state = StateAt(t);
    const double speed = (state.joint_positions[0] - last[0]) / kStepS;
    EXPECT_LE(speed, 3.0 + 1e-6);
    EXPECT_LE(std::abs(speed - last_speed) / kStepS, 15.0 + 1e-3) << t;
    EXPECT_NEAR(state.joint_velocities[0], speed, 15.0 * kStepS);
    EXPECT_NEAR(state.joint_positions[1], 1.0 - 0.25 * state.joint_positions[0], 1e-12);
    EXPECT_FALSE(state.settled);
    last = state.joint_positions;
    last_speed = speed;
  }
  EXPECT_NEAR(last[0], 2.0, 1e-5);
  EXPECT_FALSE(StateAt(duration_s + 0.09).settled);
  const Motion::State end = StateAt(duration_s + 0.11);
  EXPECT_TRUE(end.settled);
  EXPECT_EQ(end.joint_positions, target);
  EXPECT_EQ(end.joint_velocities, std::vector<double>({0.0, 0.0}));
}

TEST_F(SimMotionTest, MovesThirtyDegreesWithinHalfASecond) {
  ASSERT_TRUE(motion_.MoveTo({std::acos(-1.0) / 6.0, 1.0}));
  EXPECT_FALSE(StateAt(0.0).settled);
  EXPECT_TRUE(StateAt(0.5).settled);
}

TEST_F(SimMotionTest, StopsByBrakingAndStaysThere) {
  ASSERT_TRUE(motion_.MoveTo({2.0, 1.0}));
  const double begin = StateAt(0.4).joint_positions[0];
  ASSERT_TRUE(motion_.Stop());
  // v^2 / (2 a) with v = 3, a = 15.
  const Motion::State end = StateAt(0.4 + 3.0 / 15.0 + 0.11);
  EXPECT_TRUE(end.settled);
  EXPECT_NEAR(end.joint_positions[0], begin + 0.3, 1e-9);
  EXPECT_EQ(StateAt(10.0).joint_positions, end.joint_positions);
  ASSERT_TRUE(motion_.MoveTo({0.0, 1.0}));
  EXPECT_EQ(StateAt(20.0).joint_positions, std::vector<double>({0.0, 1.0}));
}

TEST_F(SimMotionTest, RefusesWhatItCannotDo) {
  EXPECT_FALSE(motion_.MoveTo({1.0}));
  EXPECT_FALSE(motion_.MoveTo({1.0, std::numeric_limits<double>::quiet_NaN()}));
  ASSERT_TRUE(motion_.MoveTo({1.0, 1.0}));
  now_s_ = 0.1;
  const Status refused = motion_.MoveTo({0.0, 0.0});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("still moving"), std::string::npos);
}

TEST(TruthFolder, MarksWhatAnyStopSaw) {
  const std::string path = (std::filesystem::temp_directory_path() /
                            ("fringe_fusion_truth_" + std::to_string(::getpid())))
                               .string();
  const Mesh object = sim::MakePlane(0.1, 1);
  ASSERT_EQ(object.faces.size(), 2U);
  Result<TruthFolder> folder = TruthFolder::Create(path, object);
  ASSERT_TRUE(folder) << folder.error().message;
  EXPECT_EQ(ReadMesh(path + "/object.ply").value().faces.size(), 2U);
  EXPECT_EQ(ReadFile(path + "/face_visible.txt").value(), "0\n0\n");
  ASSERT_TRUE(folder->AddStop({0, 1}));
  ASSERT_TRUE(folder->AddStop({0, 0}));
  EXPECT_EQ(ReadFile(path + "/face_visible.txt").value(), "0\n1\n");
  EXPECT_FALSE(folder->AddStop({1, 1, 1}));
  std::filesystem::remove_all(path);
  EXPECT_FALSE(TruthFolder::Create("/proc/none", object));
}

class ReplayTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("fringe_fusion_replay_" + std::to_string(::getpid()));
    std::filesystem::remove_all(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  static PatternSequence Sequence(const std::string& fringes) {
    PatternConfig pattern;
    pattern.fringes = fringes;
    pattern.axis_v = false;
    return MakeSequence(pattern, 1280, 800).value();
  }

  // Frame i of view 3 is grey 10 i + 5 and stamped 1000 (i + 1) ns.
  void WriteScan() const {
    CellCalibration calibration = sim::DefaultCalibration();
    calibration.camera.width = 8;
    calibration.camera.height = 6;
    ImageStack stack;
    stack.view_id = 3;
    stack.sequence = Sequence("1");
    for (std::size_t i = 0; i < stack.sequence.frames.size(); ++i) {
      CapturedFrame frame;
      frame.pixels = Image<std::uint8_t>(8, 6, static_cast<std::uint8_t>(10 * i + 5));
      frame.stamp_ns = static_cast<std::int64_t>(1000 * (i + 1));
      frame.exposure_s = 0.01;
      stack.frames.push_back(frame);
    }
    const ScanFolder scan = CreateScan(folder_.string(), calibration, stack.sequence).value();
    const Status written = WriteStack(scan, stack, std::nullopt, {0.5});
    ASSERT_TRUE(written) << written.error().message;
  }

  std::filesystem::path folder_;
};

TEST_F(ReplayTest, CameraGivesTheFrameThatIsAskedFor) {
  ReplayCamera camera({folder_.string(), true});
  ASSERT_TRUE(camera.Configure(0.01, 1.0));
  camera.Announce(3, 0);
  const Result<CapturedFrame> missing = camera.Capture(1.0);
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().message.find(folder_.string()), std::string::npos);
  ASSERT_NO_FATAL_FAILURE(WriteScan());  // The device appears.
  for (const int index : {0, 1, 5, 2, 2}) {
    camera.Announce(3, index);
    const Result<CapturedFrame> frame = camera.Capture(1.0);
    ASSERT_TRUE(frame) << frame.error().message;
    EXPECT_EQ(std::get<Image<std::uint8_t>>(frame->pixels)(7, 5), 10 * index + 5);
    EXPECT_EQ(frame->stamp_ns, 1000 * (index + 1));
    EXPECT_EQ(frame->exposure_s, 0.01);
  }
  camera.Announce(3, 6);  // white, black, 4 phase steps
  EXPECT_NE(camera.Capture(1.0).error().message.find("frame 6 of view 3 must be below 6"),
            std::string::npos);
  camera.Announce(4, 0);
  EXPECT_FALSE(camera.Capture(1.0));
}

TEST_F(ReplayTest, CameraStampsByTheClockUnlessAsked) {
  ASSERT_NO_FATAL_FAILURE(WriteScan());
  ReplayCamera camera({folder_.string(), false});
  camera.Announce(3, 0);
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  EXPECT_GE(camera.Capture(1.0)->stamp_ns,
            std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
}

TEST_F(ReplayTest, ProjectorRefusesWhatWasNotShown) {
  const CameraModel model = sim::DefaultCalibration().projector;
  ReplayProjector projector({folder_.string()}, model, PatternCorrection{2.2, {}});
  const PatternSequence recorded = Sequence("1");
  const auto show = [&](const PatternSequence& sequence, std::size_t index) {
    return projector.Show(
        RenderPattern(sequence.frames[index], sequence.width, sequence.height, 2.2));
  };
  EXPECT_FALSE(show(recorded, 0));  // Nothing is recorded yet.
  ASSERT_NO_FATAL_FAILURE(WriteScan());
  for (const std::size_t index : {0U, 1U, 2U, 2U, 3U, 0U, 5U}) EXPECT_TRUE(show(recorded, index));
  const Status refused = show(Sequence("2"), 3);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("none of the 6 patterns"), std::string::npos)
      << refused.error().message;
  EXPECT_FALSE(projector.Show(Image<std::uint8_t>(8, 6, 255)));
}

TEST_F(ReplayTest, AxesStopWhereTheyStoodThen) {
  ReplayMotion motion({folder_.string(), 1e-3}, {0.0});
  EXPECT_EQ(motion.Poll()->joint_positions, std::vector<double>({0.0}));
  EXPECT_FALSE(motion.MoveTo({0.5}));
  ASSERT_NO_FATAL_FAILURE(WriteScan());
  ASSERT_TRUE(motion.MoveTo({0.5002}));
  EXPECT_EQ(motion.Poll()->joint_positions, std::vector<double>({0.5}));
  EXPECT_TRUE(motion.Poll()->settled);
  for (const std::vector<double>& wrong :
       {std::vector<double>{0.502}, {0.5, 0.5}, {}, {std::numeric_limits<double>::quiet_NaN()}}) {
    const Status refused = motion.MoveTo(wrong);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message.find("none of its 1 views"), std::string::npos)
        << refused.error().message;
  }
  EXPECT_EQ(motion.Poll()->joint_positions, std::vector<double>({0.5}));
}

TEST(CellYaml, HoldsTheSimulatedDevices) {
  const auto calibration =
      ReadCellCalibration(std::string(SOURCE_DIR) + "/config/cell_sim/cell.yaml");
  ASSERT_TRUE(calibration) << calibration.error().message;
  EXPECT_EQ(CalibrationId(*calibration), CalibrationId(sim::DefaultCalibration()));
}

}  // namespace
}  // namespace fringe_fusion::nodes
