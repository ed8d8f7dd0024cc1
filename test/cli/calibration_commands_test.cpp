// Drawing a target, calibrating with it, and calibrations of other programs as cell.yaml.
#include <gtest/gtest.h>

#include <cmath>

#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_program.hpp"
#include "test/support/data_path.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

class CalibrationCommands : public ::testing::Test {
 protected:
  [[nodiscard]] std::string Path(const std::string& name) const {
    return (folder_ / name).string();
  }
  /// The one line of a call that must fail.
  [[nodiscard]] static std::string Refusal(const std::vector<std::string>& arguments) {
    const Outcome outcome = RunFringe(arguments);
    EXPECT_NE(outcome.exit_status, 0);
    return outcome.err;
  }

  TemporaryFolder folder_{"fringe_calibration_commands"};
};

TEST_F(CalibrationCommands, TargetDrawsAndDescribesEveryKind) {
  for (const std::string kind :
       {"chessboard", "charuco", "circles", "asymmetric_circles", "ring_dots", "shifted_dots"}) {
    const std::string drawing = Path(kind + (kind == "charuco" ? ".svg" : ".pdf"));
    const Outcome outcome = RunFringe({"target", "--kind", kind, "--columns", "9", "--rows", "6",
                                       "--pitch-mm", "20", "--out", drawing});
    ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
    EXPECT_TRUE(fs::exists(drawing)) << drawing;
    const auto target = LoadTarget(Path(kind + ".yaml"));
    ASSERT_TRUE(target) << target.error().message;
    EXPECT_EQ(TargetKindName(target->kind), kind);
    EXPECT_EQ(target->num_columns, 9);
    EXPECT_EQ(target->num_rows, 6);
    EXPECT_DOUBLE_EQ(target->pitch_m, 0.02);
  }
}

TEST_F(CalibrationCommands, TargetSaysWhatIsWrong) {
  const auto call = [&](const std::string& kind, const std::string& pitch_mm) {
    return Refusal({"target", "--kind", kind, "--columns", "9", "--rows", "6", "--pitch-mm",
                    pitch_mm, "--out", Path("t.pdf")});
  };
  EXPECT_NE(call("chess", "20").find("--kind 'chess' must be one of chessboard"),
            std::string::npos);
  EXPECT_NE(call("chessboard", "60").find("a sheet of 210.0 x 297.0 mm holds"), std::string::npos)
      << call("chessboard", "60");
  EXPECT_NE(call("chessboard", "-1").find("pitch_m = -0.001 is outside"), std::string::npos);
  EXPECT_FALSE(fs::exists(Path("t.pdf")));
  EXPECT_FALSE(fs::exists(Path("t.yaml")));
}

TEST_F(CalibrationCommands, ImportReadsTheCalibrationOfAnotherProgram) {
  const auto matrix = [](const std::string& key, int rows, int columns, const std::string& data) {
    return key + ": !!opencv-matrix\n   rows: " + std::to_string(rows) +
           "\n   cols: " + std::to_string(columns) + "\n   dt: d\n   data: [ " + data + " ]\n";
  };
  WriteBytes(Path("procam.yaml"),
             "%YAML:1.0\n---\n" +
                 matrix("cam_int", 3, 3, "1000., 0., 320., 0., 1001., 240., 0., 0., 1.") +
                 matrix("cam_dist", 5, 1, "0.1, 0., 0., 0., 0.") +
                 matrix("proj_int", 3, 3, "1500., 0., 512., 0., 1501., 700., 0., 0., 1.") +
                 matrix("proj_dist", 5, 1, "0., 0., 0., 0., 0.") +
                 matrix("img_shape", 2, 1, "480., 640.") +
                 matrix("roration", 3, 3, "1., 0., 0., 0., 1., 0., 0., 0., 1.") +
                 matrix("translation", 3, 1, "-200., 0., 10.") + "rms: 0.4\n");
  EXPECT_NE(Refusal({"import", "--calibration", Path("procam.yaml"), "--out", Path("cell.yaml")})
                .find("does not state the size of the projector"),
            std::string::npos);
  const Outcome outcome = RunFringe({"import", "--calibration", Path("procam.yaml"),
                                     "--projector-size", "1024x768", "--out", Path("cell.yaml")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto cell = ReadCellCalibration(Path("cell.yaml"));
  ASSERT_TRUE(cell) << cell.error().message;
  EXPECT_EQ(cell->camera.width, 640);
  EXPECT_EQ(cell->projector.height, 768);
  EXPECT_EQ(cell->projector.cy, 700.0);
  EXPECT_EQ(cell->T_projector_camera.translation(), Eigen::Vector3d(-0.2, 0.0, 0.01));
}

TEST_F(CalibrationCommands, ImportWantsOneSource) {
  EXPECT_NE(Refusal({"import", "--out", Path("x")}).find("exactly one of --bag and --calibration"),
            std::string::npos);
  EXPECT_NE(Refusal({"import", "--calibration", Path("absent.xml"), "--out", Path("c.yaml")})
                .find("absent.xml"),
            std::string::npos);
}

/// A pinhole cell before a board at tilted poses; truth is the scene.
SightingsFile SceneSightings() {
  SightingsFile file;
  file.target.num_columns = 7;
  file.target.num_rows = 6;
  file.target.pitch_m = 0.03;
  file.camera_width = 1280;
  file.camera_height = 1024;
  file.projector_width = 1024;
  file.projector_height = 768;
  const CameraModel camera{1280, 1024, 1500.0, 1500.0, 640.0, 510.0, {}};
  const CameraModel projector{1024, 768, 1400.0, 1400.0, 512.0, 700.0, {}};
  const Transform T_projector_camera(Eigen::Translation3d(-0.2, 0.05, 0.02));
  const auto points = TargetPoints(file.target);
  for (int k = 0; k < 6; ++k) {
    Transform T = Transform::Identity();
    const Eigen::Vector3d axis(std::cos(1.1 * k), std::sin(1.1 * k), 0.2);
    T.linear() = Eigen::AngleAxisd(0.4, axis.normalized()).toRotationMatrix();
    T.translation() = Eigen::Vector3d(-0.02, -0.08, 0.6 + 0.03 * k);
    TargetSighting sighting;
    sighting.name = "pose " + std::to_string(k);
    for (std::size_t j = 0; j < points.size(); ++j) {
      PointSighting seen;
      seen.point = static_cast<int>(j);
      // Noise of a few hundredths of a pixel, the same in every run.
      const double wave = 0.02 * std::sin(12.9898 * static_cast<double>(j) + 78.233 * k);
      seen.pixel_camera = Project(camera, T * points[j]) + Eigen::Vector2d(wave, -0.7 * wave);
      seen.pixel_projector =
          Project(projector, T_projector_camera * (T * points[j])) + Eigen::Vector2d(-wave, wave);
      seen.covariance_camera_px2 = seen.covariance_projector_px2 =
          4e-4 * Eigen::Matrix2d::Identity();
      seen.has_projector = true;
      sighting.points.push_back(seen);
    }
    file.sightings.push_back(std::move(sighting));
  }
  return file;
}

TEST_F(CalibrationCommands, CalibrateSolvesSightings) {
  ASSERT_TRUE(SaveSightings(SceneSightings(), Path("s.yaml")));
  const Outcome outcome = RunFringe({"calibrate", "--sightings", Path("s.yaml"), "--out",
                                     Path("cell.yaml"), "--camera-info", Path("info"), "--report",
                                     Path("report"), "--json", Path("c.json")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("accepted: 6 of 6 poses"), std::string::npos) << outcome.out;
  const auto cell = ReadCellCalibration(Path("cell.yaml"));
  ASSERT_TRUE(cell) << cell.error().message;
  const auto covariance = ReadCellCovariance(Path("cell.yaml"));
  ASSERT_TRUE(covariance) << covariance.error().message;
  EXPECT_NEAR(cell->camera.fx, 1500.0, 6.0 * std::sqrt((*covariance)(0, 0)));
  EXPECT_NEAR(cell->projector.cy, 700.0, 6.0 * std::sqrt((*covariance)(12, 12)));
  EXPECT_NEAR(cell->T_projector_camera.translation().x(), -0.2, 5e-4);
  EXPECT_TRUE(fs::exists(Path("info/projector.yaml")));
  const std::string page = ReadBytes(Path("report/report.html"));
  EXPECT_NE(page.find("accepted: 6 of 6 poses"), std::string::npos);
  EXPECT_NE(page.find("<td>projector cy</td>"), std::string::npos);
  EXPECT_TRUE(fs::exists(Path("report/error_field.png")));
  EXPECT_NE(ReadBytes(Path("c.json")).find("\"accepted\": true"), std::string::npos);
}

TEST_F(CalibrationCommands, CalibrateKeepsTheEarlierFileWhenItRejects) {
  ASSERT_TRUE(SaveSightings(SceneSightings(), Path("s.yaml")));
  WriteBytes(Path("config/calibration.yaml"), "max_rms_px: 0.002\n");
  WriteBytes(Path("cell.yaml"), "earlier");
  const std::vector<std::string> call = {"calibrate",       "--sightings",  Path("s.yaml"),
                                         "--config",        Path("config"), "--out",
                                         Path("cell.yaml"), "--report",     Path("report")};
  EXPECT_NE(Refusal(call).find("rms of the camera"), std::string::npos) << Refusal(call);
  EXPECT_EQ(ReadBytes(Path("cell.yaml")), "earlier");
  EXPECT_NE(ReadBytes(Path("report/report.html")).find("rejected: "), std::string::npos);
  std::vector<std::string> forced = call;
  forced.emplace_back("--force");
  EXPECT_EQ(RunFringe(forced).exit_status, 0);
  EXPECT_TRUE(ReadCellCalibration(Path("cell.yaml")));
}

TEST_F(CalibrationCommands, CalibrateSaysWhatIsWrong) {
  EXPECT_NE(Refusal({"calibrate", "--out", Path("c.yaml")})
                .find("exactly one of --dataset and --sightings"),
            std::string::npos);
  SightingsFile file = SceneSightings();
  file.sightings.resize(2);
  ASSERT_TRUE(SaveSightings(file, Path("two.yaml")));
  const std::string few =
      Refusal({"calibrate", "--sightings", Path("two.yaml"), "--out", Path("c.yaml")});
  EXPECT_NE(few.find("2 of 2 poses are usable, 3 are needed"), std::string::npos) << few;
  EXPECT_FALSE(fs::exists(Path("c.yaml")));
}

TEST_F(CalibrationCommands, CalibrateReadsRealScans) {
  const std::string data = test_support::DataPath("slstudio");
  FRINGE_FUSION_REQUIRE_DATA(data);
  WriteBytes(Path("board.yaml"), "kind: chessboard\ncolumns: 13\nrows: 9\npitch_m: 0.01\n");
  const Outcome outcome =
      RunFringe({"calibrate", "--dataset", SOURCE_DIR "/config/datasets/slstudio", "--target",
                 Path("board.yaml"), "--out", Path("cell.yaml")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto cell = ReadCellCalibration(Path("cell.yaml"));
  ASSERT_TRUE(cell) << cell.error().message;
  // Published: 2195.1 and 2601.5 px.
  EXPECT_NEAR(cell->camera.fx, 2195.12, 0.01 * 2195.12);
  EXPECT_NEAR(cell->projector.fx, 2601.53, 0.01 * 2601.53);
  EXPECT_LT(cell->rms_px, 0.403);
}

}  // namespace
}  // namespace fringe_fusion::cli
