// Decoding one view beside copying its frames, a straight implementation and OpenCV's own codes,
// all in turn, so that every row of the table saw the same machine.
//   decode_compare [repetitions] [threads] [width height]
#include <fmt/core.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/phase_unwrapping.hpp>
#include <opencv2/structured_light.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "bench/bench_scene.hpp"
#include "bench/straight_decode.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "src/phase/decode_with.hpp"

namespace fringe_fusion::bench {
namespace {

constexpr double kMillion = 1e6;

struct Options {
  int repetitions = 30;
  int num_threads = 2;
  int width = 2448;
  int height = 2048;
};

/// One row of the table.
struct Entry {
  std::string name;
  std::function<void()> run;
  double wall_ms = std::numeric_limits<double>::infinity();
  double cpu_ms = std::numeric_limits<double>::infinity();
};

double CpuMilliseconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto ms = [](const timeval& time) {
    return 1e3 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_usec);
  };
  return ms(usage.ru_utime) + ms(usage.ru_stime);
}

void Measure(Entry& entry) {
  const double cpu_ms = CpuMilliseconds();
  const auto start = std::chrono::steady_clock::now();
  entry.run();
  const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - start;
  entry.wall_ms = std::min(entry.wall_ms, wall.count());
  entry.cpu_ms = std::min(entry.cpu_ms, CpuMilliseconds() - cpu_ms);
}

/// A field of /proc/self/status [bytes], e.g. "VmRSS:".
double StatusBytes(const std::string& field) {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    double kilobytes = 0.0;
    if (word == field && status >> kilobytes) return 1024.0 * kilobytes;
  }
  throw std::runtime_error("/proc/self/status has no " + field);
}

/// Largest memory during `run` beyond what was held before it [bytes].
double PeakBytes(const std::function<void()>& run) {
  std::ofstream("/proc/self/clear_refs") << 5;  // resets the peak
  const double before = StatusBytes("VmRSS:");
  run();
  return StatusBytes("VmHWM:") - before;
}

ImageStack MakeStack(sim::SimCell& cell) {
  PatternConfig pattern;
  const CameraModel& projector = cell.calibration().projector;
  PatternSequence sequence = MakeSequence(pattern, projector.width, projector.height).value();
  const auto is_plain = [](const Pattern& frame) { return frame.kind != PatternKind::kPhase; };
  sequence.frames.erase(std::remove_if(sequence.frames.begin(), sequence.frames.end(), is_plain),
                        sequence.frames.end());
  return CaptureStack(cell, sequence, 1.0, cell.config().exposure_reference_s, 0).value();
}

/// Pictures of OpenCV's patterns as the camera sees them.
std::vector<cv::Mat> Photograph(sim::SimCell& cell, const std::vector<cv::Mat>& patterns) {
  std::vector<cv::Mat> pictures;
  for (const cv::Mat& pattern : patterns) {
    Image<std::uint8_t> projected(pattern.cols, pattern.rows);
    for (int y = 0; y < pattern.rows; ++y) {
      std::copy_n(pattern.ptr<std::uint8_t>(y), pattern.cols, projected.row(y));
    }
    const CapturedFrame frame = cell.Expose(projected, cell.config().exposure_reference_s,
                                            static_cast<int>(pictures.size()))
                                    .value();
    const auto& image = std::get<Image<std::uint8_t>>(frame.pixels);
    cv::Mat picture(image.height(), image.width(), CV_8UC1);
    for (int y = 0; y < picture.rows; ++y) {
      std::copy_n(image.row(y), picture.cols, picture.ptr<std::uint8_t>(y));
    }
    pictures.push_back(picture);
  }
  return pictures;
}

/// OpenCV's Gray code with inverses: projector pixel of every camera pixel that is lit.
class OpenCvGray {
 public:
  explicit OpenCvGray(sim::SimCell& cell) {
    const CameraModel& projector = cell.calibration().projector;
    code_ = cv::structured_light::GrayCodePattern::create(projector.width, projector.height);
    std::vector<cv::Mat> patterns;
    code_->generate(patterns);
    cv::Mat black, white;
    code_->getImagesForShadowMasks(black, white);
    patterns.push_back(black);
    patterns.push_back(white);
    pictures_ = Photograph(cell, patterns);
    white_ = pictures_.back();
    black_ = pictures_[pictures_.size() - 2];
    pictures_.resize(pictures_.size() - 2);
    out_ = cv::Mat(white_.size(), CV_32SC2);
  }

  void Decode() {
    constexpr int kLeastContrast = 40;  // OpenCV's default for black
    const cv::Range all(0, out_.rows);
    cv::parallel_for_(all, [&](const cv::Range& rows) {
      for (int y = rows.start; y < rows.end; ++y) {
        for (int x = 0; x < out_.cols; ++x) {
          cv::Point pixel(-1, -1);
          const int contrast = white_.at<std::uint8_t>(y, x) - black_.at<std::uint8_t>(y, x);
          if (contrast > kLeastContrast) code_->getProjPixel(pictures_, x, y, pixel);
          out_.at<cv::Vec2i>(y, x) = {pixel.x, pixel.y};
        }
      }
    });
  }
  [[nodiscard]] std::size_t num_frames() const { return pictures_.size() + 2; }

 private:
  cv::Ptr<cv::structured_light::GrayCodePattern> code_;
  std::vector<cv::Mat> pictures_;
  cv::Mat white_, black_, out_;
};

/// OpenCV's spatial unwrapping of the finest phase of one axis. Its own three-step phase is left
/// out: SinusoidalPattern::computePhaseMap of OpenCV 4.6 fails on pictures of most sizes.
class OpenCvUnwrapping {
 public:
  explicit OpenCvUnwrapping(const ImageStack& stack) {
    const std::array<cv::Mat, 4> grey = FinestSteps(stack);
    const cv::Mat cosine = grey[0] - grey[2];
    const cv::Mat sine = grey[1] - grey[3];
    cv::phase(cosine, sine, wrapped_);
    wrapped_ -= CV_PI;
    constexpr double kLeastAmplitude2 = 4.0 * 25.0;
    lit_ = cosine.mul(cosine) + sine.mul(sine) >= kLeastAmplitude2;
    cv::phase_unwrapping::HistogramPhaseUnwrapping::Params params;
    params.width = wrapped_.cols;
    params.height = wrapped_.rows;
    unwrapper_ = cv::phase_unwrapping::HistogramPhaseUnwrapping::create(params);
  }

  void Unwrap() { unwrapper_->unwrapPhaseMap(wrapped_, unwrapped_, lit_); }

 private:
  cv::Ptr<cv::phase_unwrapping::HistogramPhaseUnwrapping> unwrapper_;
  cv::Mat wrapped_, lit_, unwrapped_;
};

void CopyFrames(const std::vector<CapturedFrame>& from, std::vector<CapturedFrame>& to) {
  constexpr int kRowsPerChunk = 64;
  const int height = Height(from.front());
  const int num_chunks = (height + kRowsPerChunk - 1) / kRowsPerChunk;
  ParallelFor(static_cast<int>(from.size()) * num_chunks, 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const auto frame = static_cast<std::size_t>(i / num_chunks);
      const int first = (i % num_chunks) * kRowsPerChunk;
      const int rows = std::min(kRowsPerChunk, height - first);
      const auto& in = std::get<Image<std::uint8_t>>(from[frame].pixels);
      auto& out = std::get<Image<std::uint8_t>>(to[frame].pixels);
      std::copy_n(in.row(first), static_cast<std::ptrdiff_t>(rows) * in.width(), out.row(first));
    }
  });
}

std::vector<CapturedFrame> FreshFrames(const std::vector<CapturedFrame>& like) {
  std::vector<CapturedFrame> fresh(like.size());
  for (CapturedFrame& frame : fresh) {
    frame.pixels = Image<std::uint8_t>(Width(like[0]), Height(like[0]));
  }
  return fresh;
}

PhaseMap Decode(const decode::Kernels& kernels, const ImageStack& stack, PhaseMap recycled) {
  return decode::DecodeWith(kernels, stack, {}, NoProgress, std::move(recycled)).value();
}

double OutputBytes(const PhaseMap& map) {
  std::size_t num_bytes = map.mask.size() + map.color.size() * sizeof(Rgb8);
  for (const Image<float>* image :
       {&map.u, &map.v, &map.sigma_u, &map.sigma_v, &map.offset, &map.modulation}) {
    num_bytes += image->size() * sizeof(float);
  }
  return static_cast<double>(num_bytes);
}

// Both must decode the same surface, or the comparison means nothing.
void PrintAgreement(const PhaseMap& map, const StraightMap& straight) {
  std::vector<double> differences;
  std::size_t num_valid = 0;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      if (map.mask(x, y) != 0) continue;
      ++num_valid;
      if (straight.mask.at<std::uint8_t>(y, x) == 0) continue;
      differences.push_back(std::abs(static_cast<double>(map.u(x, y)) -
                                     static_cast<double>(straight.u.at<float>(y, x))));
    }
  }
  if (differences.empty()) throw std::runtime_error("no pixel is valid in both decodes");
  const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2);
  std::nth_element(differences.begin(), middle, differences.end());
  fmt::print(
      "valid {:.2f} % of the pixels; of these {:.2f} % in the straight decode too, median "
      "difference of u {:.4f} px\n",
      100.0 * static_cast<double>(num_valid) / static_cast<double>(map.mask.size()),
      100.0 * static_cast<double>(differences.size()) / static_cast<double>(num_valid), *middle);
}

std::string Load() {
  std::ifstream file("/proc/loadavg");
  std::string minute;
  file >> minute;
  return minute;
}

void Print(const std::vector<Entry>& entries, const Options& options) {
  fmt::print("{} threads, {} repetitions, least of each; load {}\n", options.num_threads,
             options.repetitions, Load());
  fmt::print("{:<58} {:>9} {:>9} {:>8} {:>8}\n", "", "wall [ms]", "CPU [ms]", "/ copy", "CPU");
  for (const Entry& entry : entries) {
    fmt::print("{:<58} {:>9.2f} {:>9.2f} {:>8.2f} {:>8.2f}\n", entry.name, entry.wall_ms,
               entry.cpu_ms, entry.wall_ms / entries.front().wall_ms,
               entry.cpu_ms / entries.front().cpu_ms);
  }
}

void Run(const Options& options) {
  const ThreadLimit limit(options.num_threads);
  cv::setNumThreads(options.num_threads);
  sim::SimConfig config;
  config.gain_dn = 0.05;
  config.read_noise_dn = 1.0;
  sim::SimCell cell = MakeBenchCell(config, options.width, options.height, 3);
  const ImageStack stack = MakeStack(cell);
  OpenCvGray gray(cell);
  OpenCvUnwrapping unwrapping(stack);
  std::vector<CapturedFrame> copies = stack.frames;
  const decode::Kernels& best = decode::BestKernels();
  PhaseMap map = Decode(best, stack, {});
  PhaseMap portable = map;
  std::vector<Entry> entries = {
      {"copy the frames into frames used before", [&] { CopyFrames(stack.frames, copies); }},
      {"copy the frames into new frames",
       [&] {
         std::vector<CapturedFrame> fresh = FreshFrames(stack.frames);
         CopyFrames(stack.frames, fresh);
       }},
      {fmt::format("decode ({}) into a map used before", best.name),
       [&] { map = Decode(best, stack, std::move(map)); }},
      {fmt::format("decode ({}) into a new map", best.name),
       [&] { static_cast<void>(Decode(best, stack, {})); }},
      {"decode (portable) into a map used before",
       [&] { portable = Decode(decode::PortableKernels(), stack, std::move(portable)); }},
      {"straight decode with OpenCV", [&] { static_cast<void>(DecodeStraight(stack, {})); }},
      {fmt::format("OpenCV Gray code, getProjPixel, {} frames", gray.num_frames()),
       [&] { gray.Decode(); }},
      {"OpenCV unwrapPhaseMap (spatial), finest phase of one axis", [&] { unwrapping.Unwrap(); }},
  };
  for (int i = 0; i < options.repetitions; ++i) {
    for (Entry& entry : entries) {
      // Those that take seconds are not worth thirty rounds.
      if (i > 2 && entry.wall_ms > 500.0) continue;
      Measure(entry);
    }
  }
  fmt::print("{} x {}, {} frames\n", options.width, options.height, stack.frames.size());
  PrintAgreement(map, DecodeStraight(stack, {}));
  Print(entries, options);
  const double output = OutputBytes(map);
  map = {};
  portable = {};
  const double peak = PeakBytes([&] { map = Decode(best, stack, {}); });
  fmt::print("output {:.1f} MB, peak beyond the input {:.1f} MB ({:.2f} of the output)\n",
             output / kMillion, peak / kMillion, peak / output);
}

}  // namespace
}  // namespace fringe_fusion::bench

int main(int argc, char** argv) {
  fringe_fusion::bench::Options options;
  if (argc > 1) options.repetitions = std::atoi(argv[1]);
  if (argc > 2) options.num_threads = std::atoi(argv[2]);
  if (argc > 4) {
    options.width = std::atoi(argv[3]);
    options.height = std::atoi(argv[4]);
  }
  try {
    fringe_fusion::bench::Run(options);
  } catch (const std::exception& error) {
    fmt::print(stderr, "decode_compare: {}\n", error.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
