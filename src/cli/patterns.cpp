// fringe patterns: settings of the pattern stage -> patterns.yaml and one picture per frame.
#include <cmath>
#include <filesystem>

#include "command.hpp"
#include "fringe_fusion/diagnosis/capture_assistant.hpp"
#include "fringe_fusion/diagnosis/response.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/opencv_calibration.hpp"
#include "fringe_fusion/io/response_yaml.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "staged_folder.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

struct PatternsOptions {
  std::string cell;
  std::string size;
  std::string patterns;
  std::string out;
  int ramp = 0;
  bool test_exposures = false;
};

void Declare(Command& command, PatternsOptions& options) {
  command
      .AddOption("--cell", options.cell,
                 "Calibration whose projector gives the size of the pictures")
      .TypeName("CELL.yaml");
  command.AddOption("--size", options.size, "Size of the projector, instead of --cell")
      .TypeName("WxH");
  command
      .AddOption("--patterns", options.patterns,
                 "Show the frames of this file instead of those of pattern.yaml")
      .TypeName("PATTERNS.yaml");
  command
      .AddOption("--ramp", options.ramp,
                 "Flat pictures of N values from 0 to 255 instead, ramp_VVV.png, for `fringe "
                 "response --ramp`")
      .InRange(3, 256)
      .TypeName("N");
  command.AddFlag("--test-exposures", options.test_exposures,
                  "The test exposures of `fringe suggest` instead; needs --cell");
  command.AddOption("--out", options.out, "Folder for patterns.yaml and the pictures")
      .Required()
      .TypeName("DIR");
}

Status CheckCommandLine(const PatternsOptions& options) {
  const int num_sources = static_cast<int>(!options.cell.empty()) +
                          static_cast<int>(!options.size.empty()) +
                          static_cast<int>(!options.patterns.empty());
  if (options.test_exposures && options.cell.empty()) {
    return Fail("--test-exposures needs --cell: the axis that moves with the depth is coded");
  }
  if (num_sources != 1) {
    return Fail("exactly one of --cell, --size and --patterns is needed, {} are given",
                num_sources);
  }
  if (options.size.empty()) return {};
  const auto size = ParsePictureSize("--size", options.size);
  return size ? Status() : Forward(size);
}

/// @return for a ramp: the size alone.
Result<PatternSequence> ChooseSequence(const PatternsOptions& options,
                                       const PatternConfig& config) {
  if (!options.patterns.empty()) return ReadPatterns(options.patterns);
  if (!options.size.empty()) {
    const auto size = ParsePictureSize("--size", options.size);
    if (!size) return Forward(size);
    if (options.ramp > 0) return PatternSequence{size->width, size->height, {}};
    return MakeSequence(config, size->width, size->height);
  }
  const auto calibration = ReadCellCalibration(options.cell);
  if (!calibration) return Forward(calibration);
  const CameraModel& projector = calibration->projector;
  if (options.ramp > 0) return PatternSequence{projector.width, projector.height, {}};
  return MakeSequence(options.test_exposures ? TestPattern(*calibration) : config, projector.width,
                      projector.height);
}

/// What the settings say is undone in the pictures.
Result<PatternCorrection> LoadCorrection(const PatternConfig& config, const Session& session) {
  PatternCorrection correction;
  correction.gamma = config.gamma;
  if (!session.HasStage("response")) return correction;
  if (config.gamma != 1.0) {
    return Fail("pattern.yaml: gamma is {}, but response.yaml beside it says what is undone",
                config.gamma);
  }
  auto response = ReadResponse(session.StageFile("response"));
  if (!response) return Forward(response);
  if (response->use == ResponseUse::kPatterns) correction.response = std::move(*response);
  return correction;
}

Status WriteRamp(const PatternsOptions& options, const PatternSequence& size, Session& session) {
  const auto folder = NeededFolder::Create(options.out);
  if (!folder) return Forward(folder);
  for (int i = 0; i < options.ramp; ++i) {
    const auto value = static_cast<std::uint8_t>(std::lround(255.0 * i / (options.ramp - 1)));
    const Image<std::uint8_t> picture(size.width, size.height, value);
    const fs::path file = fs::path(options.out) / fmt::format("ramp_{:03d}.png", value);
    if (Status status = WriteImage(picture, file.string()); !status) return status;
  }
  session.figures.Set("num_frames", options.ramp)
      .Set("width", size.width)
      .Set("height", size.height);
  return {};
}

Status Patterns(const PatternsOptions& options, Session& session) {
  const auto config = session.LoadStage<PatternConfig>("pattern");
  if (!config) return Forward(config);
  const Result<PatternSequence> sequence = ChooseSequence(options, *config);
  if (!sequence) return Forward(sequence);
  if (options.ramp > 0) return WriteRamp(options, *sequence, session);
  const auto correction = LoadCorrection(*config, session);
  if (!correction) return Forward(correction);
  const auto folder = NeededFolder::Create(options.out);
  if (!folder) return Forward(folder);
  session.console.Begin("patterns", 1);
  const Progress progress = session.console.Part(0);
  for (std::size_t i = 0; i < sequence->frames.size(); ++i) {
    const Pattern& pattern = sequence->frames[i];
    const double done = static_cast<double>(i) / static_cast<double>(sequence->frames.size());
    if (!progress("patterns", done)) return Fail("{}", kCancelled);
    const Image<std::uint8_t> picture =
        RenderCorrectedPattern(pattern, sequence->width, sequence->height, *correction);
    const fs::path file =
        fs::path(options.out) / fmt::format("{:03d}_{}.png", i, PatternName(pattern));
    if (Status status = WriteImage(picture, file.string()); !status) return status;
  }
  const fs::path list = fs::path(options.out) / "patterns.yaml";
  if (Status status = WritePatterns(*sequence, list.string()); !status) return status;
  session.console.End();
  session.figures.Set("num_frames", sequence->frames.size())
      .Set("width", sequence->width)
      .Set("height", sequence->height);
  return {};
}

}  // namespace

void AddPatterns(Tool& tool) {
  AddCommand<PatternsOptions>(
      tool, "patterns", "Settings -> patterns.yaml and the pictures that the projector has to show",
      Declare, Patterns, CheckCommandLine);
}

}  // namespace fringe_fusion::cli
