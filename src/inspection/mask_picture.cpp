#include "fringe_fusion/inspection/mask_picture.hpp"

#include <fmt/format.h>

#include <array>
#include <opencv2/imgproc.hpp>

namespace fringe_fusion {
namespace {

constexpr std::array<Rgb8, kNumMaskReasons> kColors = {{
    {255, 255, 255},  // valid
    {0, 0, 0},        // too dark
    {70, 70, 130},    // low modulation
    {230, 30, 30},    // saturated
    {255, 160, 0},    // edge
    {170, 70, 200},   // residual
    {250, 230, 40},   // doubtful order
    {120, 80, 40},    // outside the projector
    {60, 60, 60},     // shadow
    {0, 180, 220},    // epipolar
    {30, 90, 230},    // out of range
    {40, 170, 70},    // isolated
    {190, 210, 190},  // merged
}};

}  // namespace

Rgb8 MaskColor(MaskReason reason) {
  const auto index = static_cast<std::size_t>(reason);
  return index < kColors.size() ? kColors[index] : Rgb8{255, 0, 255};
}

Image<Rgb8> RenderMask(const Image<std::uint8_t>& mask) {
  Image<Rgb8> picture(mask.width(), mask.height());
  for (std::size_t i = 0; i < mask.size(); ++i) {
    picture[i] = MaskColor(static_cast<MaskReason>(mask[i]));
  }
  return picture;
}

Image<Rgb8> MaskLegend() {
  constexpr int kRow = 22;
  constexpr int kSwatch = 30;
  constexpr int kWidth = 260;
  Image<Rgb8> legend(kWidth, kRow * kNumMaskReasons, Rgb8{235, 235, 235});
  cv::Mat mat(legend.height(), legend.width(), CV_8UC3, legend.data());
  for (int i = 0; i < kNumMaskReasons; ++i) {
    const auto reason = static_cast<MaskReason>(i);
    const Rgb8 color = MaskColor(reason);
    const cv::Rect swatch(4, i * kRow + 3, kSwatch, kRow - 6);
    cv::rectangle(mat, swatch, cv::Scalar(color.r, color.g, color.b), cv::FILLED);
    cv::rectangle(mat, swatch, cv::Scalar(120, 120, 120));
    cv::putText(mat, fmt::format("{:2d}  {}", i, MaskReasonName(reason)),
                cv::Point(kSwatch + 14, (i + 1) * kRow - 6), cv::FONT_HERSHEY_SIMPLEX, 0.5,
                cv::Scalar(20, 20, 20), 1, cv::LINE_AA);
  }
  return legend;
}

}  // namespace fringe_fusion
