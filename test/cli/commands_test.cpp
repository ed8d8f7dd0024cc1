// Every command's ordinary use, on one small simulated scan; and the same bytes on any number of
// threads.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>

#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/poses_conf.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_program.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

constexpr int kNumViews = 4;

/// The number behind "key": in a figures file; NaN when it is absent.
double Figure(const fs::path& file, const std::string& key) {
  const std::string text = ReadBytes(file);
  const std::string quoted = '"' + key + "\": ";
  const std::size_t at = text.find(quoted);
  if (at == std::string::npos) return std::nan("");
  return std::strtod(text.c_str() + at + quoted.size(), nullptr);
}

void ExpectSuccess(const Outcome& outcome) { EXPECT_EQ(outcome.exit_status, 0) << outcome.err; }

class Commands : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>("fringe_commands");
    WriteSmallCellConfig(*folder_ / "config");
    ExpectSuccess(RunFringe({"simulate", "--config", Path("config"), "--object", "freeform",
                             "--views", std::to_string(kNumViews), "--out", Path("scan"), "--json",
                             Path("simulate.json")}));
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::string Path(const std::string& name) { return (*folder_ / name).string(); }
  /// A copy of the scan that a test may change.
  static std::string CopyScan(const std::string& name) {
    fs::copy(Path("scan"), Path(name), fs::copy_options::recursive);
    return Path(name);
  }

  static std::unique_ptr<TemporaryFolder> folder_;
};

std::unique_ptr<TemporaryFolder> Commands::folder_;

TEST_F(Commands, SimulateWritesAScanWithTruth) {
  const auto scan = OpenScan(Path("scan"));
  ASSERT_TRUE(scan) << scan.error().message;
  EXPECT_EQ(scan->view_ids.size(), static_cast<std::size_t>(kNumViews));
  EXPECT_EQ(scan->calibration.camera.width, 160);
  EXPECT_TRUE(fs::exists(Path("scan/truth/object.ply")));
  EXPECT_TRUE(fs::exists(Path("scan/truth/visible.ply")));
  EXPECT_EQ(Figure(Path("simulate.json"), "num_views"), kNumViews);
}

TEST_F(Commands, PatternsWritesPicturesAndTheirList) {
  ExpectSuccess(RunFringe({"patterns", "--size", "160x128", "--out", Path("patterns"), "--json",
                           Path("patterns.json")}));
  EXPECT_EQ(Figure(Path("patterns.json"), "num_frames"), 26);
  const auto sequence = ReadPatterns(Path("patterns/patterns.yaml"));
  ASSERT_TRUE(sequence) << sequence.error().message;
  const auto picture = ReadGrayImage(Path("patterns/002_phase_u_f1_0of4.png"));
  ASSERT_TRUE(picture) << picture.error().message;
  const auto& pixels = std::get<Image<std::uint8_t>>(*picture);
  const Image<std::uint8_t> expected = RenderPattern(sequence->frames[2], 160, 128, 1.0);
  EXPECT_TRUE(std::equal(pixels.begin(), pixels.end(), expected.begin(), expected.end()));
  const Outcome outcome = RunFringe({"patterns", "--size", "64", "--out", Path("patterns")});
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_NE(outcome.err.find("--size '64' must be like 1280x800"), std::string::npos);
}

TEST_F(Commands, SimulateReplacesAnEarlierScan) {
  const std::string scan = CopyScan("smaller");
  ExpectSuccess(RunFringe({"simulate", "--config", Path("config"), "--object", "sphere", "--views",
                           "2", "--out", scan}));
  const auto opened = OpenScan(scan);
  ASSERT_TRUE(opened) << opened.error().message;
  EXPECT_EQ(opened->view_ids, (std::vector<int>{0, 1}));
}

TEST_F(Commands, DecodeWritesPhaseMaps) {
  const std::string scan = CopyScan("decoded");
  ExpectSuccess(RunFringe({"decode", "--scan", scan, "--json", Path("decode.json")}));
  const auto opened = OpenScan(scan);
  ASSERT_TRUE(opened) << opened.error().message;
  const auto phase = ReadPhaseMap(*opened, kNumViews - 1);
  ASSERT_TRUE(phase) << phase.error().message;
  EXPECT_EQ(phase->width, 160);
  EXPECT_GT(Figure(Path("decode.json"), "median_sigma_u_px"), 0.0);
  EXPECT_LT(Figure(Path("decode.json"), "median_sigma_u_px"), 0.5);
}

TEST_F(Commands, ReconstructWritesOneRangeImageWhenAsked) {
  const std::string scan = CopyScan("reconstructed");
  ExpectSuccess(RunFringe({"reconstruct", "--scan", scan, "--view", "2"}));
  EXPECT_TRUE(fs::exists(scan + "/views/002/range.ply"));
  EXPECT_FALSE(fs::exists(scan + "/views/001/range.ply"));
}

TEST_F(Commands, ReconstructLeavesTheScanAloneWithOut) {
  const auto before = ListFiles(Path("scan"));
  ExpectSuccess(RunFringe({"reconstruct", "--scan", Path("scan"), "--out", Path("elsewhere")}));
  EXPECT_EQ(ListFiles(Path("scan")), before);
  const auto range = ReadRangeImage(Path("elsewhere/views/000/range.ply"));
  ASSERT_TRUE(range) << range.error().message;
  // The view is coarse: every second pixel lies beside an edge.
  EXPECT_GT(CountValid(*range), 800);
}

TEST_F(Commands, RegisterMovesPosesTowardsTheTruth) {
  const std::string scan = CopyScan("registered");
  ExpectSuccess(RunFringe({"register", "--views", scan, "--out", scan + "/poses.conf", "--json",
                           Path("register.json")}));
  EXPECT_LE(Figure(Path("register.json"), "rms_after_m"),
            Figure(Path("register.json"), "rms_before_m"));
  const auto entries = ReadPosesConf(scan + "/poses.conf");
  ASSERT_TRUE(entries) << entries.error().message;
  ASSERT_EQ(entries->size(), static_cast<std::size_t>(kNumViews));
  EXPECT_EQ((*entries)[1].file, "views/001/range.ply");
  // The files that it names are there and carry their own noise and devices.
  ExpectSuccess(RunFringe({"fuse", "--views", scan + "/poses.conf", "--out", Path("again.ply")}));
}

TEST_F(Commands, RegisterWithoutPriorAsksTheShapeAlone) {
  const std::string scan = CopyScan("unordered");
  ExpectSuccess(RunFringe({"reconstruct", "--scan", scan, "--view", "0"}));
  fs::copy_file(scan + "/views/000/range.ply", scan + "/again.ply");
  Transform far = Transform::Identity();
  far.linear() = ExpRotation(Eigen::Vector3d(1.0, 0.5, -2.0));
  far.translation() = Eigen::Vector3d(0.3, -0.2, 0.1);
  const std::string given = scan + "/far.conf";
  ASSERT_TRUE(
      WritePosesConf({{"views/000/range.ply", Transform::Identity()}, {"again.ply", far}}, given));
  const std::string out = scan + "/near.conf";
  ExpectSuccess(RunFringe({"register", "--no-prior", "--views", given, "--out", out}));
  const auto entries = ReadPosesConf(out);
  ASSERT_TRUE(entries) << entries.error().message;
  ASSERT_EQ(entries->size(), 2U);
  const Vector6d apart =
      Log((*entries)[0].T_object_camera.inverse() * (*entries)[1].T_object_camera);
  EXPECT_LT(apart.head<3>().norm(), 1e-4);
  EXPECT_LT(apart.tail<3>().norm(), 5e-5);
  const Outcome both = RunFringe({"register", "--no-prior", "--prior-sigma-mm", "1",
                                  "--prior-sigma-deg", "1", "--views", given, "--out", out});
  EXPECT_NE(both.exit_status, 0);
  EXPECT_NE(both.err.find("--no-prior"), std::string::npos) << both.err;
}

TEST_F(Commands, FuseMakesAMeshNearTheTruth) {
  ExpectSuccess(RunFringe({"fuse", "--views", Path("scan"), "--out", Path("mesh.ply"), "--json",
                           Path("fuse.json"), "--config", Path("config")}));
  EXPECT_GT(Figure(Path("fuse.json"), "num_faces"), 1000.0);
  ExpectSuccess(RunFringe({"inspect", "--mesh", Path("mesh.ply"), "--reference",
                           Path("scan/truth/object.ply"), "--unit", "m", "--visible",
                           Path("scan/truth/visible.ply"), "--report", Path("inspection"), "--json",
                           Path("inspect.json")}));
  // One pixel of this small camera is 1.2 mm wide on the part; poses are off by 0.1 mm.
  EXPECT_LT(Figure(Path("inspect.json"), "rms_m"), 0.5e-3);
  EXPECT_GT(Figure(Path("inspect.json"), "completeness_ratio"), 0.5);
  for (const char* file : {"report.html", "deviation.png", "deviation.ply"}) {
    EXPECT_TRUE(fs::exists(fs::path(Path("inspection")) / file)) << file;
  }
}

TEST_F(Commands, FuseSavesAModelThatGivesTheMeshAgain) {
  ExpectSuccess(RunFringe({"fuse", "--views", Path("scan"), "--out", Path("one.ply"), "--model",
                           Path("one.vdb"), "--config", Path("config")}));
  ExpectSuccess(RunFringe(
      {"fuse", "--views", Path("one.vdb"), "--out", Path("two.ply"), "--config", Path("config")}));
  EXPECT_EQ(ReadBytes(Path("one.ply")), ReadBytes(Path("two.ply")));
  const Outcome refused = RunFringe(
      {"fuse", "--views", Path("one.vdb"), "--out", Path("three.ply"), "--voxel", "0.001"});
  EXPECT_NE(refused.exit_status, 0);
  EXPECT_NE(refused.err.find("do not apply"), std::string::npos) << refused.err;
  const Outcome unknown =
      RunFringe({"fuse", "--views", Path("one.vdb"), "--out", Path("three.ply"), "--watertight"});
  EXPECT_NE(unknown.exit_status, 0);
  EXPECT_NE(unknown.err.find("fill holes from the views"), std::string::npos) << unknown.err;
}

TEST_F(Commands, FuseInSlabsMakesTheSameMesh) {
  const std::vector<std::string> common{"fuse",         "--views", Path("scan"), "--config",
                                        Path("config"), "--voxel", "0.002"};
  const auto fuse = [&](std::vector<std::string> more) {
    more.insert(more.begin(), common.begin(), common.end());
    return RunFringe(more);
  };
  ExpectSuccess(fuse({"--out", Path("whole.ply")}));
  ExpectSuccess(fuse({"--out", Path("slabs.ply"), "--slabs", "--json", Path("slabs.json")}));
  EXPECT_EQ(ReadBytes(Path("whole.ply")), ReadBytes(Path("slabs.ply")));
  EXPECT_GE(Figure(Path("slabs.json"), "num_slabs"), 1.0);
  const Outcome refused = fuse({"--out", Path("slabs.ply"), "--slabs", "--watertight"});
  EXPECT_NE(refused.exit_status, 0);
  EXPECT_NE(refused.err.find("--slabs"), std::string::npos) << refused.err;
}

TEST_F(Commands, FuseClosesHolesAndFlagsTheirFaces) {
  ExpectSuccess(RunFringe({"fuse", "--views", Path("scan"), "--out", Path("closed.ply"), "--json",
                           Path("closed.json"), "--config", Path("config"), "--watertight"}));
  EXPECT_EQ(Figure(Path("closed.json"), "num_open_edges"), 0.0);
  const auto mesh = ReadMesh(Path("closed.ply"));
  ASSERT_TRUE(mesh) << mesh.error().message;
  double num_filled = 0.0;
  for (const std::uint8_t flag : mesh->filled_faces) num_filled += flag;
  EXPECT_GT(num_filled, 0.0);
  EXPECT_EQ(num_filled, Figure(Path("closed.json"), "num_filled_faces"));
  ExpectSuccess(RunFringe({"fuse", "--views", Path("scan"), "--out", Path("part.ply"), "--json",
                           Path("part.json"), "--config", Path("config"), "--fill-holes",
                           "--max-hole-mm", "0.001"}));
  EXPECT_EQ(Figure(Path("part.json"), "num_filled_faces"), 0.0);
  EXPECT_GT(Figure(Path("part.json"), "num_open_edges"), 0.0);
}

TEST_F(Commands, FuseFitsAVariationalSurface) {
  ExpectSuccess(RunFringe({"fuse", "--views", Path("scan"), "--out", Path("rbf.ply"), "--method",
                           "rbf", "--json", Path("rbf.json"), "--config", Path("config")}));
  EXPECT_GT(Figure(Path("rbf.json"), "num_faces"), 1000.0);
  EXPECT_GT(Figure(Path("rbf.json"), "smoothing_width_m"), 0.0);
  const Outcome refused = RunFringe({"fuse", "--views", Path("scan"), "--out", Path("rbf.ply"),
                                     "--method", "rbf", "--model", Path("rbf.vdb")});
  EXPECT_NE(refused.exit_status, 0);
  EXPECT_NE(refused.err.find("--method rbf has no model file"), std::string::npos) << refused.err;
}

TEST_F(Commands, SettingsWithoutAVoxelLeaveItToThePoints) {
  ExpectSuccess(RunFringe({"fuse", "--views", Path("scan"), "--out", Path("auto.ply")}));
  fs::create_directories(Path("order"));
  WriteBytes(Path("order/fusion.yaml"), "order: 2  # the default\n");
  ExpectSuccess(RunFringe(
      {"fuse", "--views", Path("scan"), "--out", Path("order.ply"), "--config", Path("order")}));
  EXPECT_EQ(ReadBytes(Path("auto.ply")), ReadBytes(Path("order.ply")));
}

TEST_F(Commands, InspectReadsMillimetres) {
  Mesh square;
  square.vertices = {{0, 0, 0}, {0.1F, 0, 0}, {0.1F, 0.1F, 0}, {0, 0.1F, 0}};
  square.faces = {{0, 1, 2}, {0, 2, 3}};
  Mesh cloud;
  for (int i = 1; i < 10; ++i)
    cloud.vertices.emplace_back(0.01F * static_cast<float>(i), 0.05F, 2e-4F);
  ASSERT_TRUE(WriteMesh(cloud, Path("cloud.ply")));
  for (Eigen::Vector3f& vertex : square.vertices) vertex *= 1000.0F;
  ASSERT_TRUE(WriteMesh(square, Path("square_mm.ply")));
  ExpectSuccess(RunFringe({"inspect", "--mesh", Path("cloud.ply"), "--reference",
                           Path("square_mm.ply"), "--unit", "mm", "--json", Path("mm.json")}));
  EXPECT_NEAR(Figure(Path("mm.json"), "mean_m"), 2e-4, 1e-8);
  EXPECT_EQ(Figure(Path("mm.json"), "count"), 9.0);
}

TEST_F(Commands, RunDoesAllStages) {
  const Outcome outcome = RunFringe({"run", "--scan", Path("scan"), "--out", Path("run")});
  ExpectSuccess(outcome);
  EXPECT_EQ(outcome.out.rfind(Path("run/mesh.ply: 4 views, "), 0), 0U) << outcome.out;
  EXPECT_NE(outcome.out.find("registration rms"), std::string::npos) << outcome.out;
  const std::string report = ReadBytes(Path("run/report.html"));
  for (const char* words : {"too dark", "outside the crop box"}) {
    EXPECT_NE(report.find(words), std::string::npos) << words;
  }
  for (const char* file : {"mesh.ply", "cloud.ply", "poses.conf", "mesh.png", "phase.png",
                           "report.html", "views/000/range.ply", "views/003/range.ply"}) {
    EXPECT_TRUE(fs::exists(fs::path(Path("run")) / file)) << file;
  }
  // Nothing hidden stays behind.
  for (const std::string& file : ListFiles(Path("run"))) {
    EXPECT_EQ(file.find(".partial"), std::string::npos) << file;
  }
}

TEST_F(Commands, RunClosesHolesAndTakesTheCameraFrameOfASingleView) {
  const std::string scan = CopyScan("single");
  for (const char* view : {"001", "002", "003"}) fs::remove_all(scan + "/views/" + view);
  RemovePrior(scan + "/views/000/view.yaml");
  ExpectSuccess(RunFringe({"run", "--scan", scan, "--out", Path("run_single"), "--watertight",
                           "--json", Path("run_single.json")}));
  const std::string report = ReadBytes(Path("run_single/report.html"));
  for (const char* words : {"camera frame is the object frame", "faces that close them"}) {
    EXPECT_NE(report.find(words), std::string::npos) << words;
  }
  EXPECT_EQ(Figure(Path("run_single.json"), "num_open_edges"), 0.0);
  const auto mesh = ReadMesh(Path("run_single/mesh.ply"));
  ASSERT_TRUE(mesh) << mesh.error().message;
  double num_filled = 0.0;
  for (const std::uint8_t flag : mesh->filled_faces) num_filled += flag;
  EXPECT_GT(num_filled, 0.0);
  EXPECT_EQ(num_filled, Figure(Path("run_single.json"), "num_filled_faces"));
}

TEST_F(Commands, SettingsMayStateOnlyWhatDiffers) {
  WriteBytes(Path("settings/crop.yaml"), "# the plate\nremove_plane: true\nplane_margin_m: 0.02\n");
  WriteBytes(Path("settings/surface.yaml"), "# nothing\n");
  const auto fuse = [](const std::string& config) {
    ExpectSuccess(RunFringe({"fuse", "--views", Path("scan"), "--out", Path("cropped.ply"),
                             "--config", config, "--json", Path("cropped.json")}));
    return Figure(Path("cropped.json"), "num_on_plane");
  };
  const double few = fuse(Path("config"));
  EXPECT_GT(fuse(Path("settings")), few + 100.0);
}

TEST_F(Commands, KnowsEverySettingsFileOfThePackage) {
  ExpectSuccess(RunFringe(
      {"patterns", "--size", "160x128", "--out", Path("known"), "--config", SOURCE_DIR "/config"}));
}

TEST_F(Commands, TellTheirOptions) {
  const Outcome version = RunFringe({"--version"});
  EXPECT_EQ(version.exit_status, 0);
  EXPECT_EQ(version.out.rfind("fringe_fusion ", 0), 0U) << version.out;
  const Outcome help = RunFringe({"--help"});
  EXPECT_EQ(help.exit_status, 0);
  for (const char* command : {"patterns", "simulate", "diagnose", "response", "suggest", "decode",
                              "reconstruct", "register", "fuse", "inspect", "import", "run"}) {
    EXPECT_NE(help.out.find(command), std::string::npos) << command;
    const Outcome own = RunFringe({command, "--help"});
    EXPECT_EQ(own.exit_status, 0) << command;
    EXPECT_NE(own.out.find("--json"), std::string::npos) << command;
    EXPECT_NE(own.out.find("--threads"), std::string::npos) << command;
  }
}

/// Every command once, with all products in one folder.
void RunChain(const std::string& config, const std::string& folder, const std::string& threads) {
  const std::string scan = folder + "/scan";
  const std::vector<std::vector<std::string>> calls = {
      {"simulate", "--config", config, "--views", "4", "--out", scan},
      {"decode", "--scan", scan},
      {"reconstruct", "--scan", scan},
      {"register", "--views", scan, "--out", folder + "/poses.conf"},
      {"fuse", "--views", folder + "/poses.conf", "--out", folder + "/mesh.ply"},
      {"inspect", "--mesh", folder + "/mesh.ply", "--reference", scan + "/truth/object.ply",
       "--unit", "m", "--report", folder + "/inspection"},
      {"run", "--scan", scan, "--out", folder + "/run"}};
  for (std::vector<std::string> call : calls) {
    call.insert(call.end(), {"--threads", threads, "--quiet"});
    ExpectSuccess(RunFringe(call));
  }
}

TEST_F(Commands, GiveTheSameBytesOnAnyNumberOfThreads) {
  // The same folder each time, so that no path can differ.
  const fs::path folder = *folder_ / "chain";
  std::vector<std::string> names;
  std::vector<std::string> bytes;
  for (const char* threads : {"1", "2", "3"}) {
    fs::remove_all(folder);
    fs::create_directories(folder);
    RunChain(Path("config"), folder.string(), threads);
    const std::vector<std::string> files = ListFiles(folder);
    ASSERT_GT(files.size(), 50U);
    if (names.empty()) {
      names = files;
      for (const std::string& file : files) bytes.push_back(ReadBytes(folder / file));
    }
    ASSERT_EQ(files, names) << threads << " threads";
    for (std::size_t i = 0; i < files.size(); ++i) {
      // A comparison that prints megabytes helps nobody.
      EXPECT_TRUE(ReadBytes(folder / files[i]) == bytes[i])
          << files[i] << " differs on " << threads << " threads";
    }
  }
}

}  // namespace
}  // namespace fringe_fusion::cli
