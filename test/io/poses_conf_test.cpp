#include "fringe_fusion/io/poses_conf.hpp"

#include <gtest/gtest.h>

#include "test/io/scan_fixture.hpp"
#include "test/support/data_path.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

TEST(PosesConf, UsesTheTransposedQuaternion) {
  const TempFolder folder;
  // q = quarter turn about z; the file's convention rotates by its inverse.
  Spit(folder / "a.conf",
       "camera 0 0 0 0 0 0 1\n# comment\n\nbmesh a.ply 1 2 3 0 0 0.70710678 0.70710678\r\n");
  const auto entries = ReadPosesConf(folder / "a.conf");
  ASSERT_TRUE(entries) << entries.error().message;
  ASSERT_EQ(entries->size(), 1U);
  EXPECT_EQ((*entries)[0].file, "a.ply");
  const Eigen::Vector3d p = (*entries)[0].T_object_camera * Eigen::Vector3d(1, 0, 0);
  EXPECT_NEAR((p - Eigen::Vector3d(1, 1, 3)).norm(), 0.0, 1e-8);
}

TEST(PosesConf, SurvivesARoundTripToTheLastDigits) {
  const TempFolder folder;
  Vector6d xi;
  xi << 0.3, -2.0, 1.0, 0.1, 1.0 / 3.0, -5.0;
  const std::vector<ConfEntry> entries = {{"a.ply", Exp(xi)}, {"sub/b.ply", Exp(-0.5 * xi)}};
  ASSERT_TRUE(WritePosesConf(entries, folder / "a.conf"));
  const auto read = ReadPosesConf(folder / "a.conf");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ((*read)[i].file, entries[i].file);
    EXPECT_EQ((*read)[i].T_object_camera.translation(), entries[i].T_object_camera.translation());
    EXPECT_LT(((*read)[i].T_object_camera.matrix() - entries[i].T_object_camera.matrix()).norm(),
              1e-15);
  }
}

TEST(PosesConf, NamesFileLineAndValueOfEveryFault) {
  const TempFolder folder;
  const std::string path = folder / "a.conf";
  const auto complaint = [&](const std::string& text) {
    Spit(path, text);
    return MessageOf(ReadPosesConf(path));
  };
  EXPECT_EQ(complaint("bmesh a.ply 0 0 0 0 0 0 1\nbmesh b.ply 0 0 0 0 0 1\n"),
            path + ": line 2: bmesh needs a file and 7 numbers, has 7 words");
  EXPECT_EQ(complaint("bmesh a.ply 0 x 0 0 0 0 1\n"), path + ": line 1: 'x' is no number");
  EXPECT_EQ(complaint("bmesh a.ply 0 0 0 0 0 0 1.1\n"),
            path + ": line 1: quaternion has length 1.1, must be 1 within 0.001");
  EXPECT_EQ(complaint("bmesh a.ply 0 nan 0 0 0 0 1\n"),
            path + ": line 1: transform has a value that is not finite");
  EXPECT_EQ(complaint("mesh a.ply\n"),
            path + ": line 1: unknown keyword 'mesh', must be bmesh or camera");
  EXPECT_EQ(complaint("camera 1 2 3 0 0 0 1\n"), path + ": has no bmesh line");
  EXPECT_NE(MessageOf(ReadPosesConf(folder / "none")), "");
}

TEST(PosesConf, RefusesToWriteWhatCannotBeRead) {
  const TempFolder folder;
  EXPECT_NE(MessageOf(WritePosesConf({{"a b.ply", Transform::Identity()}}, folder / "a")), "");
  Transform T = Transform::Identity();
  T.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(MessageOf(WritePosesConf({{"a.ply", T}}, folder / "a")), "");
}

TEST(PosesConf, ReadsTheStanfordBunny) {
  const std::string path = DataPath("stanford_bunny/bun.conf");
  FRINGE_FUSION_REQUIRE_DATA(path);
  const auto entries = ReadPosesConf(path);
  ASSERT_TRUE(entries) << entries.error().message;
  ASSERT_EQ(entries->size(), 10U);
  EXPECT_EQ((*entries)[9].file, "ear_back.ply");
}

}  // namespace
}  // namespace fringe_fusion
