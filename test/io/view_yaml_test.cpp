#include <gtest/gtest.h>

#include "test/io/scan_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

ViewDescription FullDescription() {
  ViewDescription view;
  view.root = "../../raw: #1";
  view.frame_files = {"a [1].jpg", "b.jpg"};
  view.color_file = "c.png";
  view.stamps_ns = {1700000000123456789LL, 1700000000223456789LL};
  view.exposures_s = {0.1 + 0.2, 1e-5 / 3.0};
  view.gains = {1.5, 2.0};
  view.bit_depth = 12;
  view.joint_positions = {1.0 / 3.0, -2.0};
  view.scan_id = "scan 1";
  view.camera_id = "cam0";
  Pose prior;
  Vector6d xi;
  xi << 0.3, -1.2, 2.0, 0.1, 0.2, 1.0 / 3.0;
  prior.T_object_camera = Exp(xi);
  prior.covariance = PoseCovariance(0.001, 0.1 / 3.0);
  prior.source = PoseSource::kTf;
  view.prior = prior;
  return view;
}

TEST(ViewYaml, SurvivesARoundTripBitByBit) {
  const TempFolder folder;
  ViewDescription view = FullDescription();
  for (const bool full_covariance : {false, true}) {
    if (full_covariance) {
      Matrix6d root = Matrix6d::Random();
      view.prior->covariance = root * root.transpose();
      view.prior->covariance = view.prior->covariance.selfadjointView<Eigen::Upper>();
    }
    ASSERT_TRUE(WriteViewDescriptionFile(view, folder / "view.yaml"));
    const auto read = ReadViewDescriptionFile(folder / "view.yaml");
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->root, view.root);
    EXPECT_EQ(read->frame_files, view.frame_files);
    EXPECT_EQ(read->color_file, view.color_file);
    EXPECT_EQ(read->stamps_ns, view.stamps_ns);
    EXPECT_EQ(read->exposures_s, view.exposures_s);
    EXPECT_EQ(read->gains, view.gains);
    EXPECT_EQ(read->bit_depth, 12);
    EXPECT_EQ(read->joint_positions, view.joint_positions);
    EXPECT_EQ(read->scan_id, view.scan_id);
    EXPECT_EQ(read->camera_id, view.camera_id);
    ASSERT_TRUE(read->prior);
    EXPECT_EQ(read->prior->T_object_camera.matrix(), view.prior->T_object_camera.matrix());
    EXPECT_EQ(read->prior->covariance, view.prior->covariance);
    EXPECT_EQ(read->prior->source, PoseSource::kTf);
  }
}

TEST(ViewYaml, EveryKeyIsOptional) {
  const TempFolder folder;
  for (const char* text : {"", "{}\n", "# nothing\n"}) {
    Spit(folder / "view.yaml", text);
    const auto read = ReadViewDescriptionFile(folder / "view.yaml");
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_FALSE(read->prior);
    EXPECT_TRUE(read->frame_files.empty());
  }
  ASSERT_TRUE(WriteViewDescriptionFile({}, folder / "view.yaml"));
  EXPECT_TRUE(ReadViewDescriptionFile(folder / "view.yaml"));
}

TEST(ViewYaml, NamesFileFieldAndValueOfEveryFault) {
  const TempFolder folder;
  const std::string path = folder / "view.yaml";
  ASSERT_TRUE(WriteViewDescriptionFile(FullDescription(), path));
  const std::string good = Slurp(path);
  const auto complaint = [&](const std::string& from, const std::string& to) {
    Spit(path, Replaced(good, from, to));
    return MessageOf(ReadViewDescriptionFile(path));
  };
  EXPECT_EQ(complaint("root:", "folder:"), path + ": unknown key 'folder'");
  EXPECT_EQ(complaint("bit_depth: 12", "bit_depth: 17"),
            path + ": bit_depth = 17 is outside [1, 16]");
  EXPECT_EQ(complaint("exposures_s: [", "exposures_s: [-1, "),
            path + ": exposures_s has -1, must be >= 0");
  EXPECT_EQ(complaint("gains: [", "gains: [0, "), path + ": gains has 0, must be positive");
  EXPECT_EQ(complaint("stamps_ns: [", "stamps_ns: [-5, "),
            path + ": stamps_ns has -5, must be >= 0");
  EXPECT_EQ(complaint("stamps_ns: [", "stamps_ns: [1.5, ").rfind(path + ": stamps_ns = ", 0), 0U);
  EXPECT_EQ(complaint("sigma_rotation_rad: 0.001", "sigma_rotation_rad: -1"),
            path + ": prior: sigma_rotation_rad = -1 must be at least 0");
  EXPECT_EQ(complaint("  sigma_rotation_rad: 0.001\n", ""),
            path + ": prior: required key 'sigma_rotation_rad' is missing");
  EXPECT_EQ(complaint("source: tf", "source: guess"),
            path + ": prior: source = guess must be file, tf, epipolar or registration");
  EXPECT_EQ(complaint("translation_m: [", "translation_m: [.nan, ")
                .rfind(path + ": prior: T_object_camera: translation_m = ", 0),
            0U);
}

TEST(ViewYaml, RefusesToWriteAPriorThatIsNoPose) {
  const TempFolder folder;
  ViewDescription view = FullDescription();
  view.prior->source = PoseSource::kNone;
  EXPECT_NE(MessageOf(WriteViewDescriptionFile(view, folder / "v.yaml")), "");
  view = FullDescription();
  view.prior->T_object_camera.translation().x() = std::numeric_limits<double>::infinity();
  EXPECT_NE(MessageOf(WriteViewDescriptionFile(view, folder / "v.yaml")), "");
}

}  // namespace
}  // namespace fringe_fusion
