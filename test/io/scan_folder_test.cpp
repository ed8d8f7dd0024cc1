#include "fringe_fusion/io/scan_folder.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "test/io/scan_fixture.hpp"
#include "test/support/data_path.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

// Sets FRINGE_FUSION_DATA for one test.
class DataVariable {
 public:
  explicit DataVariable(const char* value) {
    if (const char* old = std::getenv("FRINGE_FUSION_DATA")) old_ = old;
    if (value != nullptr) {
      setenv("FRINGE_FUSION_DATA", value, 1);
    } else {
      unsetenv("FRINGE_FUSION_DATA");
    }
  }
  ~DataVariable() {
    if (old_) {
      setenv("FRINGE_FUSION_DATA", old_->c_str(), 1);
    } else {
      unsetenv("FRINGE_FUSION_DATA");
    }
  }
  DataVariable(const DataVariable&) = delete;
  DataVariable& operator=(const DataVariable&) = delete;

 private:
  std::optional<std::string> old_;
};

class ScanFolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto scan = CreateScan(folder_ / "scan", AwkwardCalibration(), SmallSequence());
    ASSERT_TRUE(scan) << scan.error().message;
    scan_ = *scan;
  }
  [[nodiscard]] ImageStack Stack(int bit_depth, int view_id) const {
    return NoiseStack(scan_.calibration, scan_.sequence, bit_depth, view_id);
  }
  [[nodiscard]] std::string InView(const std::string& name) const {
    return ViewFolder(scan_, 3) + "/" + name;
  }

  TempFolder folder_;
  ScanFolder scan_;
};

void ExpectSameStacks(const ImageStack& a, const ImageStack& b) {
  EXPECT_EQ(a.scan_id, b.scan_id);
  EXPECT_EQ(a.camera_id, b.camera_id);
  EXPECT_EQ(a.view_id, b.view_id);
  ASSERT_EQ(a.frames.size(), b.frames.size());
  for (std::size_t i = 0; i < a.frames.size(); ++i) {
    EXPECT_EQ(a.frames[i].bit_depth, b.frames[i].bit_depth);
    EXPECT_EQ(a.frames[i].stamp_ns, b.frames[i].stamp_ns);
    EXPECT_EQ(a.frames[i].exposure_s, b.frames[i].exposure_s);
    EXPECT_EQ(a.frames[i].gain, b.frames[i].gain);
    ASSERT_EQ(a.frames[i].pixels.index(), b.frames[i].pixels.index());
    std::visit(
        [&](const auto& pixels) {
          const auto& other = std::get<std::decay_t<decltype(pixels)>>(b.frames[i].pixels);
          EXPECT_TRUE(std::equal(pixels.begin(), pixels.end(), other.begin(), other.end()));
        },
        a.frames[i].pixels);
  }
}

TEST_F(ScanFolderTest, StacksSurviveARoundTrip) {
  for (const int bit_depth : {8, 12, 16}) {
    ImageStack stack = Stack(bit_depth, 3);
    stack.frames[1].gain = 2.5;
    stack.color = Image<Rgb8>(40, 30, Rgb8{1, 2, 3});
    Pose prior;
    prior.T_object_camera = AwkwardCalibration().T_projector_camera;
    prior.covariance = PoseCovariance(0.001, 0.0002);
    prior.source = PoseSource::kTf;
    const Status written = WriteStack(scan_, stack, prior, {0.5});
    ASSERT_TRUE(written) << written.error().message;
    const auto read = ReadStack(scan_, 3);
    ASSERT_TRUE(read) << read.error().message;
    ExpectSameStacks(*read, stack);
    ASSERT_TRUE(read->color);
    EXPECT_EQ((*read->color)(5, 5).b, 3);
    const auto view = ReadViewDescription(scan_, 3);
    ASSERT_TRUE(view && view->prior);
    EXPECT_EQ(view->prior->T_object_camera.matrix(), prior.T_object_camera.matrix());
    EXPECT_EQ(view->prior->covariance, prior.covariance);
    EXPECT_EQ(view->joint_positions, std::vector<double>{0.5});
  }
}

TEST_F(ScanFolderTest, FramesOfAnotherCameraAreRefused) {
  ImageStack stack = Stack(8, 3);
  stack.camera_id = "cam8";
  ASSERT_TRUE(WriteStack(scan_, stack, std::nullopt, {}));
  const std::string message = MessageOf(ReadStack(scan_, 3));
  for (const char* word : {"003/view.yaml", "'cam8'", "'cam: \"7\"'", "cell.yaml"}) {
    EXPECT_NE(message.find(word), std::string::npos) << message << " lacks " << word;
  }
  // Who states no camera contradicts nobody.
  stack.camera_id = "";
  ASSERT_TRUE(WriteStack(scan_, stack, std::nullopt, {}));
  EXPECT_TRUE(ReadStack(scan_, 3));
  stack.camera_id = "cam8";
  ASSERT_TRUE(WriteStack(scan_, stack, std::nullopt, {}));
  scan_.calibration.camera_serial = "";
  EXPECT_TRUE(ReadStack(scan_, 3));
}

TEST_F(ScanFolderTest, FilesAreTheSameBytesOnAnyNumberOfThreads) {
  std::string first;
  for (const int threads : {1, 3}) {
    const ThreadLimit limit(threads);
    ASSERT_TRUE(WriteStack(scan_, Stack(8, 3), std::nullopt, {}));
    std::string all = Slurp(InView("view.yaml"));
    for (int i = 0; i < 4; ++i) all += Slurp(InView(fmt::format("frame_{:03d}.png", i)));
    if (first.empty()) first = all;
    EXPECT_EQ(all, first);
  }
}

TEST_F(ScanFolderTest, ListsViewsInOrderAndNamesIncompleteOnes) {
  for (const int id : {12, 3, 1000}) {
    ASSERT_TRUE(WriteStack(scan_, Stack(8, id), std::nullopt, {}));
  }
  std::filesystem::create_directories(scan_.path + "/views/notes");  // no view
  const auto scan = OpenScan(scan_.path);
  ASSERT_TRUE(scan) << scan.error().message;
  EXPECT_EQ(scan->view_ids, (std::vector<int>{3, 12, 1000}));
  EXPECT_EQ(CalibrationId(scan->calibration), CalibrationId(AwkwardCalibration()));
  std::filesystem::rename(scan_.path + "/views/003", scan_.path + "/views/3");
  EXPECT_EQ(MessageOf(OpenScan(scan_.path)),
            scan_.path + "/views/3: the folder of view 3 must be named 003");
  std::filesystem::rename(scan_.path + "/views/3", scan_.path + "/views/003");
  std::filesystem::create_directories(scan_.path + "/views/007");
  EXPECT_EQ(MessageOf(OpenScan(scan_.path)),
            scan_.path + "/views/007: has no view.yaml: complete the view, or remove its folder");
}

TEST_F(ScanFolderTest, KeepsTheEarlierViewWhenTheDiskFillsUp) {
  ASSERT_TRUE(WriteStack(scan_, Stack(8, 3), std::nullopt, {}));
  const std::string before = Slurp(InView("frame_000.png")) + Slurp(InView("view.yaml"));
  // A limit on the file size fails the larger 16-bit frames as a full disk does.
  rlimit unlimited{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &unlimited), 0);
  const auto old_handler = signal(SIGXFSZ, SIG_IGN);
  const rlimit limited{1500, unlimited.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limited), 0);
  const std::string message = MessageOf(WriteStack(scan_, Stack(16, 3), std::nullopt, {}));
  setrlimit(RLIMIT_FSIZE, &unlimited);
  signal(SIGXFSZ, old_handler);
  EXPECT_NE(message.find("frame_000.png: cannot write: File too large"), std::string::npos)
      << message;
  EXPECT_EQ(Slurp(InView("frame_000.png")) + Slurp(InView("view.yaml")), before);
  EXPECT_FALSE(std::filesystem::exists(scan_.path + "/views/.003.part"));
}

TEST_F(ScanFolderTest, ANewStackReplacesTheViewAndWhatWasDecodedFromIt) {
  ASSERT_TRUE(WriteStack(scan_, Stack(8, 3), std::nullopt, {}));
  Spit(InView("range.ply"), "stale");
  ImageStack next = Stack(12, 3);
  ASSERT_TRUE(WriteStack(scan_, next, std::nullopt, {}));
  EXPECT_FALSE(std::filesystem::exists(InView("range.ply")));
  const auto read = ReadStack(scan_, 3);
  ASSERT_TRUE(read) << read.error().message;
  ExpectSameStacks(*read, next);
  int entries = 0;
  for (const auto& entry : std::filesystem::directory_iterator(scan_.path + "/views")) {
    entries += entry.exists();
  }
  EXPECT_EQ(entries, 1) << "temporary folders are left";
}

TEST_F(ScanFolderTest, NamesTheFrameThatIsMissingTruncatedOrOfAnotherSize) {
  ASSERT_TRUE(WriteStack(scan_, Stack(8, 3), std::nullopt, {}));
  const std::string frame = InView("frame_002.png");
  const std::string good = Slurp(frame);
  std::filesystem::remove(frame);
  EXPECT_EQ(MessageOf(ReadStack(scan_, 3)), frame + ": cannot be read: No such file or directory");
  Spit(frame, good.substr(0, good.size() / 2));
  EXPECT_EQ(MessageOf(ReadStack(scan_, 3)).rfind(frame + ": truncated PNG: ", 0), 0U);
  ASSERT_TRUE(WriteImage(Image<std::uint8_t>(41, 30), frame));
  EXPECT_EQ(MessageOf(ReadStack(scan_, 3)),
            frame + ": the image is 41 x 30, but the camera of cell.yaml has 40 x 30");
  ASSERT_TRUE(WriteImage(FramePixels(Image<std::uint16_t>(40, 30)), frame));
  EXPECT_NE(MessageOf(ReadStack(scan_, 3)), "") << "8 and 16 bit mixed";
}

TEST_F(ScanFolderTest, NamesAWrongNumberOfFrames) {
  ASSERT_TRUE(WriteStack(scan_, Stack(8, 3), std::nullopt, {}));
  const std::string path = InView("view.yaml");
  const std::string good = Slurp(path);
  Spit(path, Replaced(good, "  - \"frame_003.png\"\n", ""));
  EXPECT_EQ(MessageOf(ReadStack(scan_, 3)),
            path + ": frames has 17 entries, but patterns.yaml has 18 frames");
  Spit(path, Replaced(good, "stamps_ns: [", "stamps_ns: [1, "));
  EXPECT_EQ(MessageOf(ReadStack(scan_, 3)),
            path + ": stamps_ns has 19 entries, but patterns.yaml has 18 frames");
  std::filesystem::remove(path);
  EXPECT_EQ(MessageOf(ReadStack(scan_, 3)), path + ": cannot be read: No such file or directory");
}

TEST_F(ScanFolderTest, RefusesGreyValuesAboveFullScale) {
  ASSERT_TRUE(WriteStack(scan_, Stack(12, 3), std::nullopt, {}));
  const std::string frame = InView("frame_001.png");
  ASSERT_TRUE(WriteImage(FramePixels(Image<std::uint16_t>(40, 30, 65520)), frame));
  EXPECT_EQ(MessageOf(ReadStack(scan_, 3)),
            frame + ": grey value 65520 exceeds 4095, the full scale of 12 bit");
}

TEST_F(ScanFolderTest, RefusesAnotherCalibrationBesideExistingViews) {
  CellCalibration other = AwkwardCalibration();
  other.camera.fx += 1e-9;
  EXPECT_TRUE(CreateScan(scan_.path, other, SmallSequence())) << "no views yet";
  ASSERT_TRUE(CreateScan(scan_.path, AwkwardCalibration(), SmallSequence()));
  ASSERT_TRUE(WriteStack(scan_, Stack(8, 3), std::nullopt, {}));
  const auto same = CreateScan(scan_.path, AwkwardCalibration(), SmallSequence());
  ASSERT_TRUE(same) << same.error().message;
  EXPECT_EQ(same->view_ids, std::vector<int>{3});
  const std::string refused = MessageOf(CreateScan(scan_.path, other, SmallSequence()));
  EXPECT_NE(refused.find("has 1 views taken with calibration"), std::string::npos) << refused;
  PatternSequence fewer = SmallSequence();
  fewer.frames.resize(2);
  EXPECT_EQ(MessageOf(CreateScan(scan_.path, AwkwardCalibration(), fewer)),
            scan_.path + ": has 1 views taken with other patterns");
}

TEST_F(ScanFolderTest, OpenNamesWhatIsMissingOrContradicts) {
  EXPECT_EQ(MessageOf(OpenScan(folder_ / "none")), (folder_ / "none") + ": no such scan folder");
  const std::string patterns = scan_.path + "/patterns.yaml";
  Spit(patterns, Replaced(Slurp(patterns), "width: 64", "width: 60"));
  EXPECT_EQ(MessageOf(OpenScan(scan_.path)),
            patterns + ": projector size 60 x 32 differs from 64 x 32 of cell.yaml");
  std::filesystem::remove(patterns);
  EXPECT_EQ(MessageOf(OpenScan(scan_.path)),
            patterns + ": cannot be read: No such file or directory");
}

TEST_F(ScanFolderTest, WritingIntoAFileFails) {
  Spit(folder_ / "file", "x");
  EXPECT_NE(MessageOf(CreateScan(folder_ / "file", AwkwardCalibration(), SmallSequence())), "");
  EXPECT_NE(MessageOf(CreateScan("/proc/none/scan", AwkwardCalibration(), SmallSequence())), "");
}

TEST_F(ScanFolderTest, ReadsForeignFramesInPlace) {
  const std::string foreign = folder_ / "shared/data/foreign";
  std::filesystem::create_directories(foreign);
  const ImageStack stack = Stack(8, 3);
  std::string yaml = "root: ../../../shared/data/foreign\nframes:\n";
  for (std::size_t i = 0; i < stack.frames.size(); ++i) {
    const std::string name = fmt::format("{} [x].png", 100 - i);
    ASSERT_TRUE(WriteImage(stack.frames[i].pixels, foreign + "/" + name));
    yaml += fmt::format("  - \"{}\"\n", name);
  }
  std::filesystem::create_directories(ViewFolder(scan_, 3));
  Spit(InView("view.yaml"), yaml);
  for (const bool elsewhere : {false, true}) {
    if (elsewhere) std::filesystem::rename(folder_ / "shared/data", folder_ / "moved");
    const std::string moved = folder_ / "moved";
    const DataVariable variable(elsewhere ? moved.c_str() : nullptr);
    const auto read = ReadStack(scan_, 3);
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(std::get<Image<std::uint8_t>>(read->frames[5].pixels)(3, 4),
              std::get<Image<std::uint8_t>>(stack.frames[5].pixels)(3, 4));
  }
}

TEST(SltkDescription, NamesEveryFrameOfTheDataSet) {
  const std::string data = DataPath("sltk/scan_0020");
  FRINGE_FUSION_REQUIRE_DATA(data);
  const auto scan = OpenScan(std::string(SOURCE_DIR) + "/config/datasets/sltk");
  ASSERT_TRUE(scan) << scan.error().message;
  ASSERT_EQ(scan->view_ids, std::vector<int>{0});
  const auto view = ReadViewDescription(*scan, 0);
  ASSERT_TRUE(view) << view.error().message;
  const std::filesystem::path folder = FrameFolder(*scan, 0, *view);
  ASSERT_TRUE(std::filesystem::equivalent(folder, data));
  for (std::size_t i = 0; i < view->frame_files.size(); ++i) {
    const Pattern& p = scan->sequence.frames[i];
    const std::string tag = fmt::format("[{:02d}-{:02d}-{:02d}_{:02d}]", p.axis == Axis::kV ? 1 : 0,
                                        p.bit, p.inverse ? 1 : 0, i);
    EXPECT_NE(view->frame_files[i].find(tag), std::string::npos) << view->frame_files[i];
    EXPECT_TRUE(std::filesystem::exists(folder / view->frame_files[i]));
    const std::string seconds = fmt::format("{}.{:06d}_", view->stamps_ns[i] / 1000000000,
                                            view->stamps_ns[i] % 1000000000 / 1000);
    EXPECT_EQ(view->frame_files[i].rfind(seconds, 0), 0U);
  }
  const auto color = ReadColorImage((folder / view->color_file).string());
  ASSERT_TRUE(color) << color.error().message;
  EXPECT_EQ(color->width(), scan->calibration.camera.width);
  const auto frame = ReadGrayImage((folder / view->frame_files[0]).string());
  ASSERT_TRUE(frame) << frame.error().message;
  EXPECT_EQ(std::get<Image<std::uint8_t>>(*frame).height(), scan->calibration.camera.height);
}

}  // namespace
}  // namespace fringe_fusion
