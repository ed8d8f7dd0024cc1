// What the tool says to bad input: one line that names file, field, value and limit, an exit
// status that is not 0, and earlier results as they were.
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <memory>

#include "fringe_program.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kEarlier = "an earlier result";

class BadInput : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>("fringe_bad_input");
    WriteSmallCellConfig(*folder_ / "config");
    const Outcome outcome = RunFringe({"simulate", "--config", (*folder_ / "config").string(),
                                       "--views", "2", "--out", (*folder_ / "scan").string()});
    ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  }
  static void TearDownTestSuite() { folder_.reset(); }

  void SetUp() override {
    scan_ = (*folder_ / "bad").string();
    out_ = (*folder_ / "out").string();
    fs::copy(*folder_ / "scan", scan_, fs::copy_options::recursive);
    WriteBytes(fs::path(out_) / "mesh.ply", kEarlier);
  }
  void TearDown() override {
    fs::remove_all(scan_);
    fs::remove_all(out_);
  }

  /// Checks that a call fails in one line with all of these words and touches nothing.
  void ExpectRefused(const std::vector<std::string>& arguments,
                     const std::vector<std::string>& words) const {
    std::vector<std::string> call = arguments;
    call.emplace_back("--quiet");
    const Outcome outcome = RunFringe(call);
    EXPECT_EQ(outcome.exit_status, 1) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    for (const std::string& word : words) {
      EXPECT_NE(outcome.err.find(word), std::string::npos) << outcome.err << "lacks " << word;
    }
    EXPECT_EQ(ListFiles(out_), std::vector<std::string>{"mesh.ply"});
    EXPECT_EQ(ReadBytes(fs::path(out_) / "mesh.ply"), kEarlier);
  }
  /// The same for the whole chain on the changed scan.
  void ExpectScanRefused(const std::vector<std::string>& words) const {
    ExpectRefused({"run", "--scan", scan_, "--out", out_}, words);
  }

  /// Replaces the first number behind `key: ` in a file.
  static void SetNumber(const std::string& file, const std::string& key, const std::string& value) {
    const std::string text = ReadBytes(file);
    const std::size_t begin = text.find(key + ": ");
    ASSERT_NE(begin, std::string::npos) << key;
    const std::size_t end = text.find_first_of(",}\n", begin);
    WriteBytes(file, text.substr(0, begin) + key + ": " + value + text.substr(end));
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  std::string scan_;
  std::string out_;
};

std::unique_ptr<TemporaryFolder> BadInput::folder_;

TEST_F(BadInput, MissingImage) {
  fs::remove(scan_ + "/views/001/frame_003.png");
  ExpectScanRefused({"views/001/frame_003.png"});
}

TEST_F(BadInput, TruncatedImage) {
  const std::string file = scan_ + "/views/001/frame_003.png";
  WriteBytes(file, ReadBytes(file).substr(0, 500));
  ExpectScanRefused({"views/001/frame_003.png"});
}

TEST_F(BadInput, ImageOfAnotherSize) {
  ReplaceInFile(scan_ + "/cell.yaml", "width: 160", "width: 161");
  ExpectScanRefused({"frame_000.png", "160 x 120", "161 x 120"});
}

TEST_F(BadInput, WrongFrameCount) {
  ReplaceInFile(scan_ + "/views/000/view.yaml", "  - \"frame_003.png\"\n", "");
  ExpectScanRefused({"views/000/view.yaml", "frames"});
}

TEST_F(BadInput, UnknownKey) {
  ReplaceInFile(scan_ + "/patterns.yaml", "projector:", "gammma: 1.2\nprojector:");
  ExpectScanRefused({"patterns.yaml", "gammma"});
}

TEST_F(BadInput, UnknownKeyOfAStage) {
  WriteBytes(fs::path(scan_) / "surface.yaml", "min_component_faces: 100\nsmooth: 3\n");
  ExpectRefused({"run", "--scan", scan_, "--out", out_, "--config", scan_},
                {"surface.yaml", "smooth"});
}

TEST_F(BadInput, MisnamedSettings) {
  WriteBytes(fs::path(scan_) / "phaze.yaml", "gain_dn: 0.1\n");
  ExpectRefused({"run", "--scan", scan_, "--out", out_, "--config", scan_},
                {"phaze.yaml", "phase.yaml", "triangulation.yaml"});
  ExpectRefused({"simulate", "--config", scan_, "--out", out_}, {"phaze.yaml", "sim.yaml"});
}

TEST_F(BadInput, FringesFinerThanThePixels) {
  WriteBytes(fs::path(scan_) / "pattern.yaml", "fringes: \"1,8,999\"\n");
  ExpectRefused({"patterns", "--size", "1280x800", "--out", out_, "--config", scan_},
                {"fringes 999", "(0, 640]"});
}

TEST_F(BadInput, ReversedRangeLimits) {
  WriteBytes(fs::path(scan_) / "triangulation.yaml", "min_range_m: 30\n");
  ExpectRefused({"run", "--scan", scan_, "--out", out_, "--config", scan_},
                {"min_range_m = 30", "max_range_m = 10"});
}

TEST_F(BadInput, ViewWithoutAnyPoint) {
  WriteBytes(fs::path(scan_) / "triangulation.yaml", "min_range_m: 9\n");
  ExpectRefused({"reconstruct", "--scan", scan_, "--out", out_, "--config", scan_},
                {"views/000", "no valid point", "out of range", "too dark"});
}

TEST_F(BadInput, FramesOfAnotherCamera) {
  ReplaceInFile(scan_ + "/views/001/view.yaml", "\"sim-camera\"", "\"other-camera\"");
  ExpectScanRefused({"views/001/view.yaml", "'other-camera'", "'sim-camera'", "cell.yaml"});
}

TEST_F(BadInput, WrongUnit) {
  const std::string mesh = scan_ + "/object.ply";
  WriteBytes(mesh,
             "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
             "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
             "end_header\n0.1 0 0\n0.2 0 0\n0.1 0.1 0\n3 0 1 2\n");
  ExpectRefused({"inspect", "--mesh", mesh, "--reference", mesh, "--unit", "mm"},
                {"no sample", "object.ply", "max_distance_m", "diagonal", "try --unit m"});
}

TEST_F(BadInput, LeavesNoFolderOfItsOwnBehind) {
  const fs::path fresh = fs::path(scan_) / "fresh";
  fs::remove(scan_ + "/views/000/frame_003.png");
  for (const char* command : {"run", "decode", "reconstruct"}) {
    ExpectRefused({command, "--scan", scan_, "--out", (fresh / "inner").string()}, {"frame_003"});
    EXPECT_FALSE(fs::exists(fresh)) << command;
  }
}

TEST_F(BadInput, MissingRequiredKey) {
  ReplaceInFile(scan_ + "/cell.yaml", "fx: ", "fz: ");
  ExpectScanRefused({"cell.yaml", "fx"});
}

TEST_F(BadInput, NanInACalibration) {
  const std::string good = ReadBytes(scan_ + "/cell.yaml");
  SetNumber(scan_ + "/cell.yaml", "cx", ".nan");
  ExpectScanRefused({"cell.yaml", "camera", "cx", "nan"});
  WriteBytes(scan_ + "/cell.yaml", good);
  SetNumber(scan_ + "/cell.yaml", "fy", "-1");
  ExpectScanRefused({"cell.yaml", "camera", "fy", "-1"});
}

TEST_F(BadInput, ProjectorSizeZero) {
  ReplaceInFile(scan_ + "/patterns.yaml", "width: 320", "width: 0");
  ExpectScanRefused({"patterns.yaml", "projector size", "0 x 200"});
}

TEST_F(BadInput, ViewWithoutPose) {
  RemovePrior(scan_ + "/views/001/view.yaml");
  ExpectScanRefused({"view 1 has no pose", "prior"});
}

TEST_F(BadInput, PosesOfAScanWithoutRangeImages) {
  const std::string poses = (fs::path(scan_) / "poses.conf").string();
  WriteBytes(poses, "bmesh views/000/range.ply 0 0 0 0 0 0 1\n");
  ExpectRefused({"fuse", "--views", poses, "--out", (fs::path(out_) / "mesh.ply").string()},
                {"views/000/range.ply", "`fringe reconstruct --scan " + scan_ + "` writes it"});
}

TEST_F(BadInput, MissingScan) {
  ExpectRefused({"run", "--scan", scan_ + "/nowhere", "--out", out_}, {"nowhere"});
}

TEST_F(BadInput, MissingView) {
  ExpectRefused({"decode", "--scan", scan_, "--view", "7"}, {"no view 7"});
}

TEST_F(BadInput, LyingPlyHeader) {
  WriteBytes(fs::path(scan_) / "lying.ply",
             "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\n"
             "property float x\nproperty float y\nproperty float z\nend_header\nabc");
  ExpectRefused({"inspect", "--mesh", scan_ + "/lying.ply", "--reference",
                 scan_ + "/truth/object.ply", "--unit", "m"},
                {"lying.ply"});
  WriteBytes(fs::path(scan_) / "bad.conf", "bmesh lying.ply 0 0 0 0 0 0 1\n");
  ExpectRefused({"fuse", "--views", scan_ + "/bad.conf", "--out", out_ + "/mesh.ply"},
                {"lying.ply"});
}

TEST_F(BadInput, EmptyCloud) {
  WriteBytes(fs::path(scan_) / "empty.ply",
             "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\n"
             "property float z\nend_header\n");
  ExpectRefused({"inspect", "--mesh", scan_ + "/empty.ply", "--reference",
                 scan_ + "/truth/object.ply", "--unit", "m"},
                {"empty"});
}

TEST_F(BadInput, BagWithoutTheTopic) {
  ExpectRefused({"import", "--bag", SOURCE_DIR "/test/data/tf_only.bag", "--out", out_},
                {"tf_only.bag", "camera_info", "/tf (tf2_msgs/TFMessage)"});
  ExpectRefused({"import", "--bag", SOURCE_DIR "/test/data/tf_only.bag", "--cloud", "/points",
                 "--out", out_ + "/mesh.ply"},
                {"tf_only.bag", "no topic /points", "/tf (tf2_msgs/TFMessage)"});
}

TEST_F(BadInput, BagThatIsNone) {
  WriteBytes(fs::path(scan_) / "broken.bag", "#ROSBAG V2.0\nand then nothing");
  ExpectRefused({"import", "--bag", scan_ + "/broken.bag", "--out", out_}, {"broken.bag"});
  ExpectRefused({"import", "--bag", scan_ + "/absent.bag", "--out", out_}, {"absent.bag"});
}

TEST_F(BadInput, UnwritableOutputFolder) {
  // Not even root may create files in /proc.
  ExpectRefused({"run", "--scan", scan_, "--out", "/proc/fringe"}, {"/proc/fringe"});
  // Before it looks at the object, let alone renders it.
  ExpectRefused({"simulate", "--object", "nothing", "--out", "/proc/fringe"}, {"/proc/fringe"});
  ExpectRefused({"fuse", "--views", scan_, "--out", scan_ + "/nowhere/mesh.ply"},
                {"nowhere", "does not exist"});
  ExpectRefused({"fuse", "--views", scan_, "--out", out_ + "/mesh.xyz"}, {"mesh.xyz", ".ply"});
  ExpectRefused({"fuse", "--views", scan_, "--out", "/proc/mesh.ply"}, {"/proc/mesh.ply"});
}

TEST_F(BadInput, BadCommandLine) {
  for (const std::vector<std::string>& call :
       {std::vector<std::string>{},
        {"fly"},
        {"fuse"},
        {"fuse", "--views", scan_, "--voxel", "-1"},
        {"inspect", "--mesh", "a.ply", "--reference", "b.ply", "--unit", "inch"},
        {"import"},
        {"import", "--bag", "a.bag"},
        {"import", "--calibration", "a.xml", "--out", "c.yaml", "--camera-size", "640"},
        {"patterns", "--out", out_},
        {"patterns", "--size", "0x800", "--out", out_},
        {"target", "--kind", "squares", "--columns", "9", "--rows", "6", "--pitch-mm", "20",
         "--out", "t.pdf"},
        {"calibrate", "--dataset", scan_, "--out", "cell.yaml"},
        {"hand-eye", "--poses", "poses.yaml", "--out", "hand_eye.yaml"},
        {"turntable", "--out", "turntable.yaml"},
        {"recalibrate", "--cell", "cell.yaml", "--out", "new.yaml"},
        {"fuse", "--views", scan_, "--out", "m.ply", "--method", "rbf", "--slabs"}}) {
    const Outcome outcome = RunFringe(call);
    EXPECT_EQ(outcome.exit_status, 2) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
}

TEST_F(BadInput, CommandLineErrorsNameCommandAndLimit) {
  const auto message = [](const std::vector<std::string>& call) { return RunFringe(call).err; };
  EXPECT_EQ(message({"decode", "--scan", scan_, "--view", "-1"}),
            "fringe decode: --view: -1 must be >= 0\n");
  EXPECT_EQ(message({"fuse", "--views", scan_}), "fringe fuse: --out is required\n");
  EXPECT_EQ(message({"fly"}).rfind("fringe: unknown command 'fly', must be one of patterns ", 0),
            0U);
}

/// A file system of a given size, mounted for a test.
class SmallDisk {
 public:
  SmallDisk(const fs::path& folder, const std::string& size) : folder_(folder) {
    fs::create_directories(folder);
    mounted_ = mount("tmpfs", folder.c_str(), "tmpfs", 0, ("size=" + size).c_str()) == 0;
  }
  ~SmallDisk() {
    if (mounted_) umount(folder_.c_str());
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  [[nodiscard]] bool mounted() const { return mounted_; }

 private:
  fs::path folder_;
  bool mounted_ = false;
};

TEST_F(BadInput, DiskThatFillsUp) {
  const fs::path folder = *folder_ / "disk";
  const SmallDisk disk(folder, "64k");
  if (!disk.mounted()) GTEST_SKIP() << "skipped: this user may not mount a small file system";
  for (const char* file : {"mesh.ply", "run/mesh.ply"}) WriteBytes(folder / file, kEarlier);
  const std::vector<std::vector<std::string>> calls = {
      {"fuse", "--views", scan_, "--out", (folder / "mesh.ply").string()},
      {"run", "--scan", scan_, "--out", (folder / "run").string()},
      {"simulate", "--config", (*folder_ / "config").string(), "--views", "1", "--out",
       (folder / "run").string()}};
  for (const auto& call : calls) {
    ExpectRefused(call, {folder.string(), "No space left on device"});
    EXPECT_EQ(ListFiles(folder), (std::vector<std::string>{"mesh.ply", "run/mesh.ply"}));
    for (const char* file : {"mesh.ply", "run/mesh.ply"}) {
      EXPECT_EQ(ReadBytes(folder / file), kEarlier) << file;
    }
  }
}

TEST_F(BadInput, InterruptLeavesEarlierResults) {
  const Outcome outcome = RunFringe({"run", "--scan", scan_, "--out", out_, "--quiet"}, SIGINT);
  EXPECT_EQ(outcome.exit_status, 130) << outcome.err;
  EXPECT_NE(outcome.err.find("cancelled"), std::string::npos) << outcome.err;
  EXPECT_EQ(ListFiles(out_), std::vector<std::string>{"mesh.ply"});
  EXPECT_EQ(ReadBytes(fs::path(out_) / "mesh.ply"), kEarlier);
}

}  // namespace
}  // namespace fringe_fusion::cli
