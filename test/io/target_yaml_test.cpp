#include <gtest/gtest.h>

#include <fstream>

#include "fringe_fusion/io/calibration_files.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using test_support::TempFolder;

std::string WriteText(const TempFolder& folder, const std::string& text) {
  const std::string path = folder / "target.yaml";
  std::ofstream(path) << text;
  return path;
}

TEST(TargetYaml, RoundTripKeepsEveryValue) {
  CalibrationTarget target;
  target.kind = TargetKind::kRingDots;
  target.num_columns = 11;
  target.num_rows = 9;
  target.pitch_m = 0.1 / 3.0;
  target.dot_radius_m = 0.004;
  target.ring_radius_m = 0.011;
  target.sigma_print_m = 5e-6;
  target.print_ratio = 0.45;
  target.marked_points = {0, 12, 40};
  target.marked_radius_m = 0.0055;
  const TempFolder folder;
  ASSERT_TRUE(SaveTarget(target, folder / "target.yaml"));
  const auto read = LoadTarget(folder / "target.yaml");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->kind, target.kind);
  EXPECT_EQ(read->num_columns, target.num_columns);
  EXPECT_EQ(read->num_rows, target.num_rows);
  EXPECT_EQ(read->pitch_m, target.pitch_m);
  EXPECT_EQ(read->dot_radius_m, target.dot_radius_m);
  EXPECT_EQ(read->ring_radius_m, target.ring_radius_m);
  EXPECT_EQ(read->sigma_print_m, target.sigma_print_m);
  EXPECT_EQ(read->print_ratio, target.print_ratio);
  EXPECT_EQ(read->marked_points, target.marked_points);
  EXPECT_EQ(read->marked_radius_m, target.marked_radius_m);
}

TEST(TargetYaml, RefusesWhatItDoesNotKnow) {
  const TempFolder folder;
  const std::string head = "kind: chessboard\ncolumns: 9\nrows: 7\n";
  const std::pair<std::string, const char*> cases[] = {
      {head, "required key 'pitch_m' is missing"},
      {head + "pitch_m: 0.01\nspacing: 3\n", "unknown key 'spacing'"},
      {head + "pitch_m: ten\n", "pitch_m = ten must be a number"},
      {head + "pitch_m: -0.01\n", "pitch_m = -0.01 is outside"},
      {"kind: chess\ncolumns: 9\nrows: 7\npitch_m: 0.01\n", "kind 'chess' must be one of"},
      {"[1, 2]\n", "must be a map"},
  };
  for (const auto& [text, said] : cases) {
    const auto read = LoadTarget(WriteText(folder, text));
    ASSERT_FALSE(read) << said;
    EXPECT_NE(read.error().message.find(said), std::string::npos) << read.error().message;
  }
  EXPECT_FALSE(LoadTarget(folder / "missing.yaml"));
}

TEST(TargetYaml, SaveRefusesABadTarget) {
  const TempFolder folder;
  EXPECT_FALSE(SaveTarget(CalibrationTarget{}, folder / "target.yaml"));
}

}  // namespace
}  // namespace fringe_fusion
