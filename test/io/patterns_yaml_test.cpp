#include <gtest/gtest.h>

#include "test/io/scan_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

TEST(PatternsYaml, SurvivesARoundTrip) {
  const TempFolder folder;
  PatternSequence sequence = SmallSequence();
  for (Pattern& pattern : sequence.frames) {
    if (pattern.kind == PatternKind::kGray) {
      pattern.cell_px = 2;
      pattern.offset_px = -1.0 / 3.0;
    } else if (pattern.kind == PatternKind::kPhase) {
      pattern.phase_sign = -1.0;
      pattern.phase_offset_rad = 0.1;
      pattern.fringes = 16.0 / 3.0;
    }
  }
  ASSERT_TRUE(WritePatterns(sequence, folder / "p.yaml"));
  const auto read = ReadPatterns(folder / "p.yaml");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->frames.size(), sequence.frames.size());
  EXPECT_EQ(read->width, 64);
  EXPECT_EQ(read->height, 32);
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    const Pattern& a = sequence.frames[i];
    const Pattern& b = read->frames[i];
    EXPECT_EQ(PatternName(a), PatternName(b));
    EXPECT_EQ(a.cell_px, b.cell_px);
    EXPECT_EQ(a.offset_px, b.offset_px);
    EXPECT_EQ(a.fringes, b.fringes);
    EXPECT_EQ(a.phase_sign, b.phase_sign);
    EXPECT_EQ(a.phase_offset_rad, b.phase_offset_rad);
  }
}

TEST(PatternsYaml, CarriesExposuresCarriersAndMicroPhaseShifting) {
  const TempFolder folder;
  PatternConfig modulated;
  modulated.fringes = "1,4";
  modulated.carrier_period_px = 12.5;
  modulated.exposures = "1,0.25";
  PatternConfig micro;
  micro.micro = true;
  micro.fringes = "7,8,9";
  for (const PatternConfig& config : {modulated, micro}) {
    const auto sequence = MakeSequence(config, 64, 32);
    ASSERT_TRUE(sequence) << sequence.error().message;
    ASSERT_TRUE(WritePatterns(*sequence, folder / "p.yaml"));
    const auto read = ReadPatterns(folder / "p.yaml");
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_EQ(read->frames.size(), sequence->frames.size());
    for (std::size_t i = 0; i < read->frames.size(); ++i) {
      EXPECT_EQ(PatternName(read->frames[i]), PatternName(sequence->frames[i]));
      EXPECT_EQ(read->frames[i].exposure_ratio, sequence->frames[i].exposure_ratio);
      EXPECT_EQ(read->frames[i].carrier_period_px, sequence->frames[i].carrier_period_px);
    }
  }
}

TEST(PatternsYaml, NamesFileFrameAndFieldOfEveryFault) {
  const TempFolder folder;
  const std::string path = folder / "patterns.yaml";
  ASSERT_TRUE(WritePatterns(SmallSequence(), path));
  const std::string good = Slurp(path);
  const auto complaint = [&](const std::string& from, const std::string& to) {
    Spit(path, Replaced(good, from, to));
    return MessageOf(ReadPatterns(path));
  };
  EXPECT_EQ(complaint("width: 64", "width: 0"),
            path + ": projector size 0 x 32 px must be from 1 x 1 to 16384 x 16384");
  EXPECT_EQ(complaint("height: 32", "height: -1"),
            path + ": projector size 64 x -1 px must be from 1 x 1 to 16384 x 16384");
  EXPECT_EQ(complaint("width: 64", "width: 100000"),
            path + ": projector size 100000 x 32 px must be from 1 x 1 to 16384 x 16384");
  EXPECT_EQ(complaint("kind: black", "kind: dark"),
            path + ": frame 1: kind = dark must be white, black, gray, phase or micro");
  EXPECT_EQ(complaint("axis: u", "axis: w"), path + ": frame 2: axis = w must be u or v");
  EXPECT_EQ(complaint("axis: u, ", ""), path + ": frame 2: required key 'axis' is missing");
  EXPECT_EQ(complaint("kind: white", "kind: white, bit: 1"), path + ": frame 0: unknown key 'bit'");
  EXPECT_EQ(complaint("fringes: 4", "fringes: .nan"),
            path + ": frame 14: fringes = .nan must be finite");
  EXPECT_EQ(complaint("frames:", "pictures:"), path + ": required key 'frames' is missing");
  EXPECT_NE(complaint("step: 0", "step: 1"), "");
  EXPECT_NE(complaint("bit: 5, inverse: false", "bit: 7, inverse: false"), "");
  Spit(path, "projector: {width: 64, height: 32}\nframes: []\n");
  EXPECT_EQ(MessageOf(ReadPatterns(path)), path + ": no frames");
  Spit(path, "projector: {width: 64, height: 32}\nframes: 3\n");
  EXPECT_EQ(MessageOf(ReadPatterns(path)), path + ": frames = 3 must be a list");
}

}  // namespace
}  // namespace fringe_fusion
