#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/phase/phase_map.hpp"
#include "test/phase/mat_file.hpp"
#include "test/support/data_path.hpp"

// Captured stacks of other people as the decoder wants them, and their own results.
namespace fringe_fusion::test {

inline Pattern OfKind(PatternKind kind) {
  Pattern pattern;
  pattern.kind = kind;
  return pattern;
}

inline Pattern GrayBit(int bit, bool inverse, double cell_px = 1.0, double offset_px = 0.0) {
  Pattern pattern = OfKind(PatternKind::kGray);
  pattern.bit = bit;
  pattern.inverse = inverse;
  pattern.cell_px = cell_px;
  pattern.offset_px = offset_px;
  return pattern;
}

inline void AddFrame(const std::string& file, const Pattern& pattern, ImageStack& stack) {
  const Result<FramePixels> image = ReadGrayImage(file);
  if (!image) throw std::runtime_error(image.error().message);
  CapturedFrame frame;
  frame.pixels = *image;
  frame.stamp_ns = static_cast<std::int64_t>(stack.frames.size());
  stack.frames.push_back(frame);
  stack.sequence.frames.push_back(pattern);
}

/// gray_00 is white, gray_01 .. gray_11 are the bits, coarsest first.
inline ImageStack NeuvisionStack() {
  const std::string folder = test_support::DataPath("neuvision");
  ImageStack stack;
  stack.sequence.width = 2048;
  stack.sequence.height = 1080;
  AddFrame(folder + "/gray_00.png", OfKind(PatternKind::kWhite), stack);
  AddFrame(folder + "/gray_00_inv.png", OfKind(PatternKind::kBlack), stack);
  for (int i = 1; i <= 11; ++i) {
    AddFrame(fmt::format("{}/gray_{:02d}.png", folder, i), GrayBit(11 - i, false), stack);
    AddFrame(fmt::format("{}/gray_{:02d}_inv.png", folder, i), GrayBit(11 - i, true), stack);
  }
  return stack;
}

inline ImageStack SlstudioStack() {
  ImageStack stack;
  stack.sequence.width = 1824;
  stack.sequence.height = 1140;
  return stack;
}

/// White, black and ten bits without inverses, coarsest first, in cells of two columns.
inline ImageStack SkullGrayStack() {
  const std::string folder = test_support::DataPath("slstudio/skull_gray");
  ImageStack stack = SlstudioStack();
  for (int i = 0; i < 12; ++i) {
    Pattern pattern = OfKind(i == 0 ? PatternKind::kWhite : PatternKind::kBlack);
    // The border below code c is column 2 c - 1/2.
    if (i >= 2) pattern = GrayBit(11 - i, false, 2.0);
    AddFrame(fmt::format("{}/frameSeq_{:02d}.png", folder, i), pattern, stack);
  }
  return stack;
}

/// Six frames for the columns: three steps of 16 fringes, then three of 1 fringe.
inline ImageStack SkullPhaseStack() {
  const std::string folder = test_support::DataPath("slstudio/skull_2x3");
  ImageStack stack = SlstudioStack();
  for (int i = 0; i < 6; ++i) {
    Pattern pattern = OfKind(PatternKind::kPhase);
    pattern.fringes = i < 3 ? 16.0 : 1.0;
    pattern.step = i % 3;
    pattern.steps = 3;
    AddFrame(fmt::format("{}/frameSeq_{:02d}.png", folder, i), pattern, stack);
  }
  return stack;
}

/// 11 bits per axis, each with its inverse.
inline ImageStack SltkStack() {
  const Result<ScanFolder> scan = OpenScan(std::string(SOURCE_DIR) + "/config/datasets/sltk");
  if (!scan) throw std::runtime_error(scan.error().message);
  Result<ImageStack> stack = ReadStack(*scan, scan->view_ids.front());
  if (!stack) throw std::runtime_error(stack.error().message);
  return std::move(*stack);
}

/// A point of the cloud that was published with skull_gray: a place between two camera pixels
/// where the code changes, and the border of the two projector cells.
struct PublishedBorder {
  Eigen::Vector2d pixel_camera;
  double column_px = 0.0;
};

/// The cloud by the calibration that was published with it. It was triangulated in undistorted
/// pictures and without the projector's distortion: without both, the rows of its points are whole
/// pixels to 1e-12 and its columns whole borders 2 c - 1/2.
/// Ref: slstudio calibration.xml: p_projector = Rp p_camera + Tp [mm].
inline std::vector<PublishedBorder> PublishedSkullBorders() {
  const MatMatrix cloud =
      MatReader(test_support::DataPath("slstudio/skull_gray/pointCloud.mat")).Read("xyz");
  const std::size_t plane =
      static_cast<std::size_t>(cloud.size.at(0)) * static_cast<std::size_t>(cloud.size.at(1));
  Eigen::Matrix3d R_projector_camera;
  R_projector_camera << 9.64402318e-01, -1.20346159e-01, 2.35467508e-01, 1.53437316e-01,
      9.79882836e-01, -1.27619177e-01, -2.15372086e-01, 1.59205735e-01, 9.63466883e-01;
  const Eigen::Vector3d projector_camera_mm(-1.45282562e+02, -3.64983406e+01, 6.79231644e+01);
  const CameraModel projector{1824,           1140,           2.60152563e+03,
                              2.60152563e+03, 8.66541504e+02, 1.10911121e+03};
  CameraModel camera{1688, 1352, 2.19512036e+03, 2.19512036e+03, 8.43500000e+02, 6.75500000e+02};
  camera.distortion[0] = -5.80352657e-02;
  std::vector<PublishedBorder> borders;
  for (std::size_t i = 0; i < plane; ++i) {
    const Eigen::Vector3d point_mm(cloud.values[i], cloud.values[plane + i],
                                   cloud.values[2 * plane + i]);
    if (!point_mm.allFinite()) continue;
    const double column_px =
        Project(projector, R_projector_camera * point_mm + projector_camera_mm).x();
    borders.push_back({Project(camera, point_mm), column_px});
  }
  return borders;
}

}  // namespace fringe_fusion::test
