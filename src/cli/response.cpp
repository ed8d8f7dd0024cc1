// fringe response: the response of projector and camera, from a scan or from a grey ramp.
#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>

#include "command.hpp"
#include "figures.hpp"
#include "fringe_fusion/diagnosis/sensor_noise.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/response_yaml.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "views.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxSteps = 64;  // of pattern.yaml

struct ResponseOptions {
  std::string scan;
  std::string ramp;
  std::string out;
  std::string undo_in = "patterns";
  int view = -1;
  double noise_ratio = 0.0;
};

void Declare(Command& command, ResponseOptions& options) {
  command
      .AddOption("--scan", options.scan,
                 "Scan with white, black and phase sets, taken with patterns in which no gamma was "
                 "undone")
      .TypeName("SCAN/");
  command.AddOption("--view", options.view, "View of the scan (default: the first)")
      .AtLeastZero()
      .TypeName("K");
  command
      .AddOption("--ramp", options.ramp,
                 "Folder with pictures of flat patterns instead, the value sent as the last number "
                 "of each name, e.g. ramp_128.png; `fringe patterns --ramp` makes the patterns")
      .TypeName("DIR");
  command
      .AddOption("--out", options.out,
                 "Write the table; as response.yaml in a folder of settings, every command undoes "
                 "it, as response_file projector_node and phase_node")
      .TypeName("RESPONSE.yaml");
  command
      .AddOption(
          "--undo-in", options.undo_in,
          "Where the table written is to be undone: in the patterns that are sent, or in the "
          "phases when scans of uncorrected patterns are decoded")
      .OneOf({"patterns", "phase"})
      .ShowDefault();
  command
      .AddOption("--noise-ratio", options.noise_ratio,
                 "Noise of a grey value over the fringe amplitude, by which the number of steps is "
                 "chosen (default: that of the scan)")
      .InRange(1e-6, 10.0)
      .TypeName("R");
}

/// The number that ends the stem of a file name; -1 if there is none.
int ValueOfFile(const fs::path& file) {
  const std::string stem = file.stem().string();
  std::size_t begin = stem.size();
  while (begin > 0 && std::isdigit(static_cast<unsigned char>(stem[begin - 1])) != 0) --begin;
  const std::string digits = stem.substr(begin);
  return digits.empty() || digits.size() > 3 ? -1 : std::stoi(digits);
}

Result<ResponseCurve> ResponseOfRamp(const std::string& folder) {
  if (!fs::is_directory(folder)) return Fail("--ramp {}: is not a folder", folder);
  std::map<int, fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension != ".png" && extension != ".tiff" && extension != ".tif") continue;
    const int value = ValueOfFile(entry.path());
    if (value < 0 || value > 255) {
      return Fail("{}: the name must end in the value sent, 0 to 255", entry.path().string());
    }
    if (!files.emplace(value, entry.path()).second) {
      return Fail("--ramp {}: two pictures of the value {}", folder, value);
    }
  }
  std::vector<int> values;
  std::vector<CapturedFrame> frames;
  for (const auto& [value, path] : files) {
    Result<FramePixels> pixels = ReadGrayImage(path.string());
    if (!pixels) return Forward(pixels);
    CapturedFrame frame;
    frame.pixels = std::move(*pixels);
    frame.bit_depth = frame.pixels.index() == 0 ? 8 : 16;
    values.push_back(value);
    frames.push_back(std::move(frame));
  }
  auto response = MeasureResponse(values, frames);
  if (!response) return Fail("--ramp {}: {}", folder, response.error().message);
  return response;
}

/// Noise of one grey value over the amplitude of the finest fringes, median over the valid pixels.
Result<double> NoiseRatio(const ImageStack& stack, const DecodeConfig& config,
                          const std::string& owner, const Progress& progress) {
  DecodeConfig decode = config;
  if (const auto noise = EstimateSensorNoise(stack, config.diagnosis)) {
    decode.phase.read_noise_dn = noise->read_noise_dn;
    decode.phase.gain_dn = noise->gain_dn;
  }
  decode.diagnosis.estimate_noise = false;
  decode.response.reset();  // it is being measured
  const auto phase = DecodeView(stack, decode, owner, progress);
  if (!phase) return Forward(phase);
  Image<float> ratio(phase->width, phase->height, std::nanf(""));
  for (std::size_t i = 0; i < ratio.size(); ++i) {
    if (phase->mask[i] != 0) continue;
    const double variance = decode.phase.read_noise_dn * decode.phase.read_noise_dn + 1.0 / 12.0 +
                            decode.phase.gain_dn * static_cast<double>(phase->offset[i]);
    ratio[i] = static_cast<float>(std::sqrt(variance) / static_cast<double>(phase->modulation[i]));
  }
  const double median = Median(ratio);
  if (!(median > 0.0)) return Fail("{}: no pixel was decoded", owner);
  return median;
}

/// What a cell answers whose patterns are sent through the inverse table.
ResponseCurve Corrected(const ResponseCurve& response) {
  const auto lut = InverseLut(response);
  ResponseCurve corrected = response;
  for (std::size_t v = 0; v < lut.size(); ++v) corrected.light[v] = response.light[lut[v]];
  return corrected;
}

std::string StepsText(const ResponseCurve& response, double noise_ratio, Json& figures,
                      const std::string& key) {
  const auto steps = ChooseSteps(response, noise_ratio, kMaxSteps);
  if (!steps) return steps.error().message;
  const double ripple = PhaseRipple(response, *steps);
  figures.Set(key, *steps).Set(key + "_ripple_rad", ripple);
  return fmt::format("{} steps: ripple {:.5f} rad, limit {:.5f} rad", *steps, ripple,
                     std::sqrt(2.0 / *steps) * noise_ratio / 3.0);
}

Status CheckCommandLine(const ResponseOptions& options) {
  if (options.scan.empty() != options.ramp.empty()) return {};
  return Fail("exactly one of --scan and --ramp is needed");
}

Status Respond(const ResponseOptions& options, Session& session) {
  if (!options.out.empty()) {
    if (Status status = CheckOutputFile(options.out, {".yaml"}); !status) return status;
  }
  if (!options.scan.empty()) session.AdoptSettings(options.scan);
  const auto config = LoadDecodeConfig(session);
  if (!config) return Forward(config);
  session.console.Begin("response", 1);
  double noise_ratio = options.noise_ratio;
  Result<ResponseCurve> response;
  if (options.scan.empty()) {
    response = ResponseOfRamp(options.ramp);
    if (!response) return Forward(response);
  } else {
    const auto scan = OpenScan(options.scan);
    if (!scan) return Forward(scan);
    const auto ids = SelectViews(*scan, options.view);
    if (!ids) return Forward(ids);
    const std::string owner = ViewFolder(*scan, ids->front());
    const auto stack = ReadStack(*scan, ids->front());
    if (!stack) return Forward(stack);
    response = ResponseFromScan(*stack, config->diagnosis);
    if (!response) return Fail("{}: {}", owner, response.error().message);
    if (noise_ratio == 0.0) {
      const auto ratio = NoiseRatio(*stack, *config, owner, session.console.Part(0));
      if (!ratio) return Forward(ratio);
      noise_ratio = *ratio;
    }
  }
  session.console.End();
  response->use = options.undo_in == "phase" ? ResponseUse::kPhase : ResponseUse::kPatterns;
  Json& figures = session.figures;
  figures.Set("gamma", response->gamma)
      .Set("sigma_gamma", response->sigma_gamma)
      .Set("gamma_residual", response->gamma_residual);
  fmt::print("gamma {:.4f} +- {:.4f}, {:.4f} rms from that power law\n", response->gamma,
             response->sigma_gamma, response->gamma_residual);
  if (noise_ratio > 0.0) {
    figures.Set("noise_ratio", noise_ratio);
    fmt::print("noise over fringe amplitude {:.4f}\n", noise_ratio);
    fmt::print("patterns as they are: {}\n", StepsText(*response, noise_ratio, figures, "steps"));
    fmt::print("patterns through this table: {}\n",
               StepsText(Corrected(*response), noise_ratio, figures, "corrected_steps"));
  }
  return options.out.empty() ? Status() : WriteResponse(*response, options.out);
}

}  // namespace

void AddResponse(Tool& tool) {
  AddCommand<ResponseOptions>(
      tool, "response",
      "Response of projector and camera -> gamma, number of steps, table for the patterns", Declare,
      Respond, CheckCommandLine);
}

}  // namespace fringe_fusion::cli
