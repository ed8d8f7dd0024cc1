#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "test/io/scan_fixture.hpp"
#include "test/support/data_path.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

std::string Matrix(const std::string& key, int rows, int cols, char type, const std::string& data) {
  return fmt::format("{}: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: {}\n   data: [ {} ]\n",
                     key, rows, cols, type, data);
}

// A quarter turn about z and 100 mm along x.
std::string SmallFile() {
  return "%YAML:1.0\n" + Matrix("cam_size", 2, 1, 'i', "640, 480") +
         Matrix("cam_K", 3, 3, 'd', "500., 0., 320.5, 0., 501., 240.5, 0., 0., 1.") +
         Matrix("cam_kc", 1, 5, 'd', "1e-1, 2e-1, 3e-3, 4e-3, 5e-1") +
         Matrix("pro_size", 2, 1, 'i', "800, 600") +
         Matrix("pro_K", 3, 3, 'd', "900., 0., 400., 0., 901., 700., 0., 0., 1.") +
         Matrix("pro_kc", 5, 1, 'd', "0., 0., 0., 0., 0.") + "stereo_rms: 6.5e-01\n" +
         Matrix("R", 3, 3, 'd', "0., -1., 0., 1., 0., 0., 0., 0., 1.") +
         Matrix("T", 3, 1, 'd', "100., 2., 3.");
}

TEST(SltkCalibration, ConvertsMillimetresAndKeepsTheOrderOfRows) {
  const TempFolder folder;
  Spit(folder / "c.yaml", SmallFile());
  const auto read = ReadSltkCalibration(folder / "c.yaml");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->camera.width, 640);
  EXPECT_EQ(read->camera.fy, 501.0);
  EXPECT_EQ(read->camera.cy, 240.5);
  EXPECT_EQ(read->camera.distortion, (std::array<double, 5>{0.1, 0.2, 0.003, 0.004, 0.5}));
  EXPECT_EQ(read->projector.cy, 700.0);
  EXPECT_EQ(read->rms_px, 0.65);
  const Eigen::Vector3d p = read->T_projector_camera * Eigen::Vector3d(1, 0, 0);
  EXPECT_NEAR((p - Eigen::Vector3d(0.1, 1.002, 0.003)).norm(), 0.0, 1e-15);
}

TEST(SltkCalibration, NamesFileAndKeyOfEveryFault) {
  const TempFolder folder;
  const std::string path = folder / "c.yaml";
  const auto complaint = [&](const std::string& from, const std::string& to) {
    Spit(path, Replaced(SmallFile(), from, to));
    return MessageOf(ReadSltkCalibration(path));
  };
  EXPECT_EQ(complaint("pro_kc", "pro_distortion"), path + ": required key 'pro_kc' is missing");
  EXPECT_EQ(complaint("900.", ".Nan").rfind(path + ": projector: ", 0), 0U);
  EXPECT_NE(complaint("0., -1.", "0., -2.").find("R is off by 3 from orthonormal"),
            std::string::npos);
  EXPECT_EQ(complaint("rows: 5\n   cols: 1\n   dt: d\n   data: [ 0., 0., 0., 0., 0. ]",
                      "rows: 2\n   cols: 1\n   dt: d\n   data: [ 0., 0. ]"),
            path + ": pro_kc has 2 numbers, must have 5");
  Spit(path, "hello");
  EXPECT_NE(MessageOf(ReadSltkCalibration(path)), "");
  EXPECT_NE(MessageOf(ReadSltkCalibration(folder / "none.yaml")), "");
}

TEST(SltkCalibration, DescriptionInTheRepositoryIsTheConvertedPublishedOne) {
  const std::string path = DataPath("sltk/procam_2016_12_09.yaml");
  FRINGE_FUSION_REQUIRE_DATA(path);
  const auto published = ReadSltkCalibration(path);
  ASSERT_TRUE(published) << published.error().message;
  const auto ours =
      ReadCellCalibration(std::string(SOURCE_DIR) + "/config/datasets/sltk/cell.yaml");
  ASSERT_TRUE(ours) << ours.error().message;
  EXPECT_EQ(ours->camera.fx, published->camera.fx);
  EXPECT_EQ(ours->camera.distortion, published->camera.distortion);
  EXPECT_EQ(ours->projector.distortion, published->projector.distortion);
  EXPECT_LT((ours->T_projector_camera.matrix() - published->T_projector_camera.matrix()).norm(),
            1e-14);
}

}  // namespace
}  // namespace fringe_fusion
