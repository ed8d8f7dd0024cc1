#include "fringe_fusion/sim/simulate_scan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/poses_conf.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "test/sim/scenes.hpp"

namespace fringe_fusion::sim {
namespace {

SimulateScanConfig SmallScan() {
  SimulateScanConfig config;
  config.views = 3;
  config.calibration = SmallScanner(8);
  config.pattern.fringes = "1,8";
  config.write_truth_maps = true;
  config.sim.turntable_angle_sigma_deg = 0.5;
  config.sim.read_noise_dn = 1.0;
  return config;
}

std::string FreshFolder(const std::string& name) {
  const std::string folder = testing::TempDir() + "simulate_scan_" + name;
  std::filesystem::remove_all(folder);
  return folder;
}

std::string Bytes(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

TEST(SimulateScan, WritesAScanWithPriorsAndTruth) {
  const SimulateScanConfig config = SmallScan();
  const Mesh object = MakeStepBlock(3, 0.01, 0.015, 0.04);
  const std::string folder = FreshFolder("whole");
  const Status status = SimulateScan(config, object, folder);
  ASSERT_TRUE(status) << status.error().message;

  const Result<ScanFolder> scan = OpenScan(folder);
  ASSERT_TRUE(scan) << scan.error().message;
  EXPECT_EQ(scan->view_ids, (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(CalibrationId(scan->calibration), CalibrationId(config.calibration));
  const Result<ImageStack> stack = ReadStack(*scan, 1);
  ASSERT_TRUE(stack) << stack.error().message;
  EXPECT_EQ(stack->frames.size(), scan->sequence.frames.size());

  const Result<std::vector<ConfEntry>> truth = ReadPosesConf(folder + "/truth/poses.conf");
  ASSERT_TRUE(truth) << truth.error().message;
  ASSERT_EQ(truth->size(), 3U);
  for (int k = 0; k < 3; ++k) {
    const Result<ViewDescription> view = ReadViewDescription(*scan, k);
    ASSERT_TRUE(view && view->prior);
    const Transform commanded = TurntablePose(k, 3, 0.5, 25.0, {0.0, 0.0, 0.035});
    EXPECT_LT((view->prior->T_object_camera.matrix() - commanded.matrix()).norm(), 1e-9);
    // The true pose differs, and by no more than the stated covariance allows.
    const Vector6d xi =
        Log(commanded.inverse() * (*truth)[static_cast<std::size_t>(k)].T_object_camera);
    EXPECT_GT(xi.norm(), 1e-5);
    EXPECT_LT(xi.dot(view->prior->covariance.inverse() * xi), 25.0);
  }
}

TEST(SimulateScan, TruthHoldsTheVisibleSurfaceAndMaps) {
  const Mesh object = MakeStepBlock(3, 0.01, 0.015, 0.04);
  const std::string folder = FreshFolder("truth");
  ASSERT_TRUE(SimulateScan(SmallScan(), object, folder));
  const Result<Mesh> whole = ReadMesh(folder + "/truth/object.ply");
  const Result<Mesh> visible = ReadMesh(folder + "/truth/visible.ply");
  ASSERT_TRUE(whole && visible);
  EXPECT_EQ(whole->faces.size(), object.faces.size());
  EXPECT_LT(visible->faces.size(), object.faces.size());
  EXPECT_GT(visible->faces.size(), object.faces.size() / 3);
  // Nobody sees the bottom.
  for (const Eigen::Vector3i& face : visible->faces) {
    float height = 0.0F;
    for (int i = 0; i < 3; ++i) {
      height = std::max(height, visible->vertices[static_cast<std::size_t>(face[i])].z());
    }
    EXPECT_GT(height, 0.0F);
  }
  const Result<Image<float>> u = ReadFloatImage(folder + "/truth/views/002/u.tiff");
  ASSERT_TRUE(u) << u.error().message;
  EXPECT_EQ(u->width(), 100);
  EXPECT_TRUE(ReadGrayImage(folder + "/truth/views/002/lit.png"));
}

TEST(SimulateScan, SameBytesOnAnyNumberOfThreads) {
  const Mesh object = MakeSphere({0.0, 0.0, 0.03}, 0.03, 3);
  std::vector<std::string> folders;
  for (const int threads : {1, 2, 3}) {
    const ThreadLimit limit(threads);
    folders.push_back(FreshFolder(fmt::format("threads_{}", threads)));
    ASSERT_TRUE(SimulateScan(SmallScan(), object, folders.back()));
  }
  int count = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folders[0])) {
    if (!entry.is_regular_file()) continue;
    const std::string relative = std::filesystem::relative(entry.path(), folders[0]).string();
    const std::string bytes = Bytes(entry.path().string());
    EXPECT_EQ(bytes, Bytes(folders[1] + "/" + relative)) << relative;
    EXPECT_EQ(bytes, Bytes(folders[2] + "/" + relative)) << relative;
    ++count;
  }
  EXPECT_GT(count, 50);
}

TEST(SimulateScan, ReportsProgressAndStopsWhenAsked) {
  const Mesh object = MakePlane(0.1, 2);
  std::vector<double> fractions;
  const Status cancelled = SimulateScan(SmallScan(), object, FreshFolder("cancelled"),
                                        [&](const std::string& stage, double fraction) {
                                          EXPECT_EQ(stage, "simulate");
                                          fractions.push_back(fraction);
                                          return fraction < 0.5;
                                        });
  ASSERT_FALSE(cancelled);
  EXPECT_EQ(cancelled.error().message, kCancelled);
  EXPECT_EQ(fractions.size(), 3U);
}

TEST(SimulateScan, RefusesBadSettings) {
  const Mesh object = MakePlane(0.1, 2);
  SimulateScanConfig config = SmallScan();
  config.views = 0;
  const Status views = SimulateScan(config, object, FreshFolder("bad"));
  ASSERT_FALSE(views);
  EXPECT_EQ(views.error().message, "simulate_scan: views = 0 is outside [1, 10000]");
  config = SmallScan();
  config.pattern.fringes = "";
  EXPECT_FALSE(SimulateScan(config, object, FreshFolder("bad")));
  EXPECT_FALSE(SimulateScan(SmallScan(), Mesh{}, FreshFolder("bad")));
  EXPECT_FALSE(SimulateScan(SmallScan(), object, "/proc/simulate_scan"));
  config = SmallScan();
  config.sim.drop_probability = 1.0;
  const Status dropped = SimulateScan(config, object, FreshFolder("dropped"));
  ASSERT_FALSE(dropped);
  EXPECT_NE(dropped.error().message.find("frame 0 of pose 0 was dropped"), std::string::npos);
}

TEST(SelectFaces, KeepsMarkedFacesAndTheirVertices) {
  const Mesh plane = MakePlane(0.1, 2);
  std::vector<std::uint8_t> marks(plane.faces.size(), 0);
  marks[3] = 1;
  const Mesh selected = SelectFaces(plane, marks);
  ASSERT_EQ(selected.faces.size(), 1U);
  ASSERT_EQ(selected.vertices.size(), 3U);
  EXPECT_EQ(selected.normals.size(), 3U);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(selected.vertices[static_cast<std::size_t>(selected.faces[0][i])],
              plane.vertices[static_cast<std::size_t>(plane.faces[3][i])]);
  }
  EXPECT_THROW((void)SelectFaces(plane, {1}), std::invalid_argument);
}

}  // namespace
}  // namespace fringe_fusion::sim
