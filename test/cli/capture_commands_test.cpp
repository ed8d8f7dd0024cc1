// The commands about the capture itself: diagnose, response, suggest.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/response_yaml.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_program.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

double JsonFigure(const fs::path& file, const std::string& key) {
  const std::string text = ReadBytes(file);
  const std::string quoted = '"' + key + "\": ";
  const std::size_t at = text.find(quoted);
  if (at == std::string::npos) return std::nan("");
  return std::strtod(text.c_str() + at + quoted.size(), nullptr);
}

bool Contains(const std::string& text, const std::string& words) {
  return text.find(words) != std::string::npos;
}

/// One view of the small simulated cell, with what a test adds to its settings.
class Capture : public ::testing::Test {
 protected:
  Capture() : folder_("fringe_capture") { WriteSmallCellConfig(folder_ / "config"); }

  [[nodiscard]] std::string Path(const std::string& name) const {
    return (folder_ / name).string();
  }
  /// Replaces one line of a settings file.
  void Set(const std::string& file, const std::string& from, const std::string& to) {
    ReplaceInFile(folder_ / "config" / file, from, to);
  }
  void Simulate(const std::string& scan) {
    const Outcome outcome = RunFringe({"simulate", "--config", Path("config"), "--object", "sphere",
                                       "--views", "1", "--out", Path(scan)});
    ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  }

  TemporaryFolder folder_;
};

TEST_F(Capture, DiagnoseNamesAShortExposureAndNothingElseIsAnError) {
  Set("sim.yaml", "projector_gamma: 1.2", "projector_gamma: 1.0");
  Simulate("clean");
  const Outcome clean =
      RunFringe({"diagnose", "--scan", Path("clean"), "--strict", "--json", Path("clean.json")});
  EXPECT_EQ(clean.exit_status, 0) << clean.err << clean.out;
  EXPECT_TRUE(Contains(clean.out, "view 0: 0 findings")) << clean.out;
  EXPECT_EQ(JsonFigure(Path("clean.json"), "num_findings"), 0.0);
  // The limits come from the settings.
  WriteBytes(Path("limits/diagnosis.yaml"), "min_light_ratio: 0.999\n");
  const Outcome strange =
      RunFringe({"diagnose", "--scan", Path("clean"), "--config", Path("limits")});
  EXPECT_EQ(strange.exit_status, 0) << strange.err;
  EXPECT_TRUE(Contains(strange.out, "too_little_light   failed")) << strange.out;

  Set("simulate_scan.yaml", "exposure_s: 0.02", "exposure_s: 0.001");
  Simulate("dark");
  const Outcome dark =
      RunFringe({"diagnose", "--scan", Path("dark"), "--view", "0", "--json", Path("dark.json")});
  EXPECT_EQ(dark.exit_status, 0) << dark.err;
  EXPECT_TRUE(Contains(dark.out, "too_little_light")) << dark.out;
  EXPECT_TRUE(Contains(dark.out, "do: expose longer")) << dark.out;
  EXPECT_TRUE(Contains(ReadBytes(Path("dark.json")), "\"name\": \"too_little_light\""));
  const Outcome strict = RunFringe({"diagnose", "--scan", Path("dark"), "--strict"});
  EXPECT_EQ(strict.exit_status, 1);
  EXPECT_TRUE(Contains(strict.err, "findings in 1 views")) << strict.err;
}

TEST_F(Capture, RunReportsAFindingAndGoesOn) {
  Set("sim.yaml", "projector_gamma: 1.2", "projector_gamma: 1.8");
  Simulate("scan");
  const Outcome run =
      RunFringe({"run", "--scan", Path("scan"), "--out", Path("out"), "--config", Path("config")});
  EXPECT_EQ(run.exit_status, 0) << run.err;
  const std::string report = ReadBytes(Path("out/report.html"));
  EXPECT_TRUE(Contains(report, "<h2>Capture</h2>")) << report;
  EXPECT_TRUE(Contains(report, "<td>response</td>")) << report;
  EXPECT_TRUE(Contains(run.out, "findings about the capture")) << run.out;
}

TEST_F(Capture, ResponseTableUndoesTheGammaOfTheProjector) {
  Set("sim.yaml", "projector_gamma: 1.2", "projector_gamma: 2.2");
  Simulate("scan");
  const Outcome outcome =
      RunFringe({"response", "--scan", Path("scan"), "--out", Path("config/response.yaml"),
                 "--json", Path("response.json")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_NEAR(JsonFigure(Path("response.json"), "gamma"), 2.2, 0.05);
  EXPECT_GT(JsonFigure(Path("response.json"), "sigma_gamma"), 0.0);
  EXPECT_GE(JsonFigure(Path("response.json"), "steps"), 4.0);
  EXPECT_LT(JsonFigure(Path("response.json"), "corrected_steps"),
            JsonFigure(Path("response.json"), "steps"));
  // The same projector, its response undone by the table.
  Simulate("again");
  ASSERT_EQ(
      RunFringe({"response", "--scan", Path("again"), "--json", Path("again.json")}).exit_status,
      0);
  EXPECT_NEAR(JsonFigure(Path("again.json"), "gamma"), 1.0, 0.03);
  // The pictures to show are those of the table.
  const Outcome patterns = RunFringe(
      {"patterns", "--size", "256x128", "--out", Path("patterns"), "--config", Path("config")});
  ASSERT_EQ(patterns.exit_status, 0) << patterns.err;
  const auto response = ReadResponse(Path("config/response.yaml"));
  const auto sequence = ReadPatterns(Path("patterns/patterns.yaml"));
  const auto picture = ReadGrayImage(Path("patterns/002_phase_u_f1_0of4.png"));
  ASSERT_TRUE(response && sequence && picture);
  const Image<std::uint8_t> expected =
      RenderCorrectedPattern(sequence->frames[2], 256, 128, *response);
  const auto& pixels = std::get<Image<std::uint8_t>>(*picture);
  EXPECT_TRUE(std::equal(pixels.begin(), pixels.end(), expected.begin(), expected.end()));
  WriteBytes(Path("config/pattern.yaml"), "gamma: 2.2\n");
  const Outcome both = RunFringe(
      {"patterns", "--size", "256x128", "--out", Path("patterns"), "--config", Path("config")});
  EXPECT_EQ(both.exit_status, 1);
  EXPECT_TRUE(Contains(both.err, "response.yaml beside it")) << both.err;
}

TEST_F(Capture, PhasesOfAScanAreCorrectedWhereTheTableSaysSo) {
  Set("sim.yaml", "projector_gamma: 1.2", "projector_gamma: 1.6");
  Simulate("scan");
  const auto decode = [&](const std::string& scan, const std::string& out) {
    return RunFringe(
        {"decode", "--scan", Path(scan), "--out", Path(out), "--config", Path("config")});
  };
  ASSERT_EQ(decode("scan", "plain").exit_status, 0);
  const Outcome outcome = RunFringe({"response", "--scan", Path("scan"), "--undo-in", "phase",
                                     "--out", Path("config/response.yaml")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  for (const char* out : {"corrected", "again"}) {
    const Outcome decoded = decode("scan", out);
    ASSERT_EQ(decoded.exit_status, 0) << decoded.err;
  }
  const auto codes = [&](const char* out) {
    return ReadBytes(Path(std::string(out) + "/views/000/u.tiff"));
  };
  EXPECT_FALSE(codes("plain").empty());
  EXPECT_NE(codes("corrected"), codes("plain"));
  EXPECT_EQ(codes("corrected"), codes("again"));
  // The patterns stay as they are, and those that were corrected are not corrected again.
  Simulate("uncorrected");
  EXPECT_EQ(decode("uncorrected", "other").exit_status, 0);
  ReplaceInFile(Path("config/response.yaml"), "undo_in: phase", "undo_in: patterns");
  Simulate("straight");
  ReplaceInFile(Path("config/response.yaml"), "undo_in: patterns", "undo_in: phase");
  const Outcome twice = decode("straight", "other");
  EXPECT_EQ(twice.exit_status, 1);
  EXPECT_TRUE(Contains(twice.err, "corrected already")) << twice.err;
  WriteBytes(Path("config/pattern.yaml"), "gamma: 2.2\n");
  const Outcome both = decode("scan", "other");
  EXPECT_EQ(both.exit_status, 1);
  EXPECT_TRUE(Contains(both.err, "undone in the phases")) << both.err;
}

TEST_F(Capture, ResponseComesFromAGreyRampAsWell) {
  const Outcome patterns =
      RunFringe({"patterns", "--size", "64x32", "--ramp", "16", "--out", Path("ramp")});
  ASSERT_EQ(patterns.exit_status, 0) << patterns.err;
  // A camera that sees the light of a projector of gamma 1.7.
  for (int i = 0; i < 16; ++i) {
    const std::string file = Path(fmt::format("ramp/ramp_{:03d}.png", 17 * i));
    const double grey = 20.0 + 200.0 * std::pow(17.0 * i / 255.0, 1.7);
    ASSERT_TRUE(fs::exists(file));
    ASSERT_TRUE(WriteImage(
        Image<std::uint8_t>(64, 32, static_cast<std::uint8_t>(std::lround(grey))), file));
  }
  const Outcome outcome = RunFringe(
      {"response", "--ramp", Path("ramp"), "--noise-ratio", "0.02", "--json", Path("ramp.json")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_NEAR(JsonFigure(Path("ramp.json"), "gamma"), 1.7, 0.02);
  EXPECT_GE(JsonFigure(Path("ramp.json"), "steps"), 4.0);
  fs::rename(Path("ramp/ramp_017.png"), Path("ramp/other.png"));
  const Outcome unnamed = RunFringe({"response", "--ramp", Path("ramp")});
  EXPECT_EQ(unnamed.exit_status, 1);
  EXPECT_TRUE(Contains(unnamed.err, "must end in the value sent")) << unnamed.err;
  EXPECT_EQ(RunFringe({"response"}).exit_status, 2);
}

TEST_F(Capture, SuggestTurnsTestExposuresIntoSettings) {
  const Outcome patterns = RunFringe({"patterns", "--cell", Path("config/cell.yaml"),
                                      "--test-exposures", "--out", Path("test_patterns")});
  ASSERT_EQ(patterns.exit_status, 0) << patterns.err;
  const auto sequence = ReadPatterns(Path("test_patterns/patterns.yaml"));
  ASSERT_TRUE(sequence) << sequence.error().message;
  EXPECT_EQ(sequence->frames.size() % 3, 0U);  // three exposures
  WriteBytes(Path("config/pattern.yaml"),
             "axis_v: false\nfringes: \"1,3,12\"\nexposures: \"0.25,1,4\"\n");
  Set("simulate_scan.yaml", "exposure_s: 0.02", "exposure_s: 0.01");
  Simulate("test");
  const Outcome outcome = RunFringe({"suggest", "--scan", Path("test"), "--frames", "20", "--out",
                                     Path("pattern.yaml"), "--json", Path("suggest.json")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_LE(JsonFigure(Path("suggest.json"), "num_frames"), 20.0);
  EXPECT_GE(JsonFigure(Path("suggest.json"), "steps"), 3.0);
  const double sigma_m = JsonFigure(Path("suggest.json"), "sigma_depth_m");
  EXPECT_GT(sigma_m, 1e-6);
  EXPECT_LT(sigma_m, 1e-3);
  // What it writes is what `patterns` reads.
  fs::create_directories(Path("chosen"));
  fs::rename(Path("pattern.yaml"), Path("chosen/pattern.yaml"));
  EXPECT_EQ(RunFringe({"patterns", "--cell", Path("config/cell.yaml"), "--out", Path("final"),
                       "--config", Path("chosen")})
                .exit_status,
            0);
  const Outcome none = RunFringe({"suggest", "--scan", Path("test")});
  EXPECT_EQ(none.exit_status, 2);
  EXPECT_TRUE(Contains(none.err, "one of --frames and --seconds")) << none.err;
  const Outcome few = RunFringe({"suggest", "--scan", Path("test"), "--frames", "3"});
  EXPECT_EQ(few.exit_status, 1);
  EXPECT_TRUE(Contains(few.err, "no code fits")) << few.err;
}

TEST_F(Capture, EstimatedNoiseServesEveryCommandThatDecodes) {
  Set("sim.yaml", "gain_dn: 0.02", "gain_dn: 0.2");
  Set("sim.yaml", "read_noise_dn: 0.5", "read_noise_dn: 2.5");
  Simulate("scan");
  const auto sigma = [&](const std::string& phase, const std::string& diagnosis) {
    WriteBytes(Path("noise/phase.yaml"), phase);
    WriteBytes(Path("noise/diagnosis.yaml"), diagnosis);
    const Outcome outcome = RunFringe({"decode", "--scan", Path("scan"), "--out", Path("decoded"),
                                       "--config", Path("noise"), "--json", Path("decode.json")});
    EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
    return JsonFigure(Path("decode.json"), "median_sigma_u_px");
  };
  const double estimated = sigma("# as configured\n", "estimate_noise: true\n");
  const double truth = sigma("read_noise_dn: 2.5\ngain_dn: 0.2\n", "# none\n");
  EXPECT_NEAR(estimated, truth, 0.08 * truth);
  EXPECT_GT(truth, 1.5 * sigma("# as configured\n", "# none\n"));
  EXPECT_TRUE(fs::exists(Path("decoded/views/000/mask_color.png")));
  EXPECT_TRUE(fs::exists(Path("decoded/views/000/mask_legend.png")));
}

}  // namespace
}  // namespace fringe_fusion::cli
