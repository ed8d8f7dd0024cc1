// Drawing a target, and calibrations of other programs as cell.yaml.
#include <gtest/gtest.h>

#include <memory>

#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_program.hpp"

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

}  // namespace
}  // namespace fringe_fusion::cli
