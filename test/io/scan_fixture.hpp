#pragma once

#include <fstream>
#include <iterator>
#include <string>

#include "fringe_fusion/io/scan_folder.hpp"

namespace fringe_fusion::test_support {

/// A calibration whose numbers all need their last digit.
inline CellCalibration AwkwardCalibration() {
  CellCalibration calibration;
  calibration.camera = {
      40, 30, 50.0 / 3.0, 17.1, 20.0 / 7.0, 15.0, {-0.1, 0.2 / 3.0, 1e-4, 0, 0.1}};
  calibration.projector = {64, 32, 80.0 / 3.0, 27.7, 31.5, -4.0, {0.0, 0.01, 0.0, 1e-17, 0.3}};
  Vector6d xi;
  xi << 0.1, -0.37, 0.05, -0.2, 0.01 / 3.0, 0.03;
  calibration.T_projector_camera = Exp(xi);
  calibration.camera_serial = "cam: \"7\"";
  calibration.projector_serial = "P-1";
  calibration.date = "2026-01-02T03:04:05Z";
  calibration.rms_px = 0.1 + 0.2;
  return calibration;
}

inline PatternSequence SmallSequence() {
  PatternConfig config;
  config.gray = true;
  config.fringes = "4";
  config.axis_v = false;
  return *MakeSequence(config, 64, 32);
}

/// Frames of distinct noise of the camera's size.
inline ImageStack NoiseStack(const CellCalibration& calibration, const PatternSequence& sequence,
                             int bit_depth, int view_id) {
  ImageStack stack;
  stack.scan_id = "shell 1";
  stack.camera_id = "cam: \"7\"";
  stack.view_id = view_id;
  stack.sequence = sequence;
  unsigned state = 12345;
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    CapturedFrame frame;
    frame.bit_depth = bit_depth;
    frame.stamp_ns = 1700000000123456789LL + static_cast<std::int64_t>(i) * 33333333;
    frame.exposure_s = 0.01 / 3.0;
    const auto fill = [&](auto image) {
      for (auto& pixel : image) {
        state = state * 1664525U + 1013904223U;
        pixel = static_cast<std::decay_t<decltype(pixel)>>((state >> 8U) % (1U << bit_depth));
      }
      frame.pixels = image;
    };
    if (bit_depth <= 8)
      fill(Image<std::uint8_t>(calibration.camera.width, calibration.camera.height));
    if (bit_depth > 8)
      fill(Image<std::uint16_t>(calibration.camera.width, calibration.camera.height));
    stack.frames.push_back(frame);
  }
  return stack;
}

/// Writes a text file.
inline void Spit(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

/// Reads a text file.
inline std::string Slurp(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/// `text` with the first `from` replaced; throws when it is not there.
inline std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

/// Message of a failed Result or Status, "" for success.
template <typename ResultOrStatus>
std::string MessageOf(const ResultOrStatus& result) {
  return result ? std::string() : result.error().message;
}

}  // namespace fringe_fusion::test_support
