#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "common/constants.hpp"
#include "feature.hpp"

namespace fringe_fusion::internal {
namespace {

/// Sums over the pixels of one connected dark region.
struct Region {
  double count = 0.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  bool touches_border = false;
};

std::vector<Region> SumRegions(const cv::Mat& labels, int num_labels) {
  std::vector<Region> regions(static_cast<std::size_t>(num_labels));
  for (int y = 0; y < labels.rows; ++y) {
    const int* row = labels.ptr<int>(y);
    for (int x = 0; x < labels.cols; ++x) {
      if (row[x] == 0) continue;
      Region& region = regions[static_cast<std::size_t>(row[x])];
      const Eigen::Vector2d p(x, y);
      region.count += 1.0;
      region.sum += p;
      region.squares += p * p.transpose();
      if (x == 0 || y == 0 || x == labels.cols - 1 || y == labels.rows - 1) {
        region.touches_border = true;
      }
    }
  }
  return regions;
}

/// Grey values just outside the rim against the middle.
double ContrastRatio(const Image<float>& picture, const Feature& dot) {
  const Eigen::Matrix2d axes = dot.shape.inverse().llt().matrixL();
  const double reach = 1.0 + std::max(0.25, 2.0 / dot.radius_px);
  constexpr int kNumSamples = 16;
  double outside = 0.0;
  for (int k = 0; k < kNumSamples; ++k) {
    const double angle = 2.0 * kPi * k / kNumSamples;
    const Eigen::Vector2d p =
        dot.pixel + reach * (axes * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    if (!(p.x() >= 1.0 && p.y() >= 1.0 && p.x() < picture.width() - 2.0 &&
          p.y() < picture.height() - 2.0)) {
      return 0.0;
    }
    outside += SampleGrey(picture, p.x(), p.y()) / kNumSamples;
  }
  const double inside = SampleGrey(picture, dot.pixel.x(), dot.pixel.y());
  return (outside - inside) / std::max(std::abs(outside), 1.0);
}

/// Whether a region is a filled ellipse of allowed size; fills the feature.
bool MakeDot(const Region& region, const DetectConfig& config, Feature& dot) {
  const double least_area = 0.5 * kPi * config.min_dot_radius_px * config.min_dot_radius_px;
  if (region.touches_border || !(region.count >= least_area)) return false;
  dot.pixel = region.sum / region.count;
  // A pixel is a square, not a point: its own second moment is 1/12.
  const Eigen::Matrix2d covariance = region.squares / region.count -
                                     dot.pixel * dot.pixel.transpose() +
                                     Eigen::Matrix2d::Identity() / 12.0;
  const double half_trace = 0.5 * covariance.trace();
  const double spread =
      std::sqrt(std::max(0.0, half_trace * half_trace - covariance.determinant()));
  const double major_px = 2.0 * std::sqrt(half_trace + spread);
  const double minor_px = 2.0 * std::sqrt(std::max(1e-9, half_trace - spread));
  if (!(major_px >= config.min_dot_radius_px && major_px <= config.max_dot_radius_px)) return false;
  if (!(major_px <= config.max_aspect_ratio * minor_px)) return false;
  const double filled = region.count / (kPi * major_px * minor_px);
  if (!(filled > 0.85 && filled < 1.15)) return false;
  dot.shape = (4.0 * covariance).inverse();
  dot.radius_px = std::sqrt(region.count / kPi);
  return true;
}

/// Dots that are darker than the mean over a window.
void FindAtScale(const Image<float>& picture, const cv::Mat& grey, int window,
                 const DetectConfig& config, std::vector<Feature>& dots) {
  cv::Mat mean;
  cv::boxFilter(grey, mean, CV_32F, cv::Size(window, window));
  const cv::Mat dark = grey < (1.0 - 0.3 * config.min_contrast_ratio) * mean;
  cv::Mat labels;
  const int num_labels = cv::connectedComponents(dark, labels, 4, CV_32S);
  for (const Region& region : SumRegions(labels, num_labels)) {
    Feature dot;
    if (!MakeDot(region, config, dot)) continue;
    if (ContrastRatio(picture, dot) >= config.min_contrast_ratio) dots.push_back(dot);
  }
}

}  // namespace

std::vector<Feature> FindDots(const Image<float>& picture, const DetectConfig& config) {
  // OpenCV takes non-const pixels but only reads them.
  const cv::Mat grey(picture.height(), picture.width(), CV_32F, const_cast<float*>(picture.data()));
  std::vector<Feature> dots;
  const int size = std::max(picture.width(), picture.height());
  // A window of a few dots: neither drowned in one dot nor in the light of the whole picture.
  for (const int parts : {80, 40, 20, 10}) {
    const int window = 2 * (size / parts / 2) + 1;
    if (window < 7) continue;
    std::vector<Feature> found;
    FindAtScale(picture, grey, window, config, found);
    for (const Feature& dot : found) {
      const auto same = std::find_if(dots.begin(), dots.end(), [&](const Feature& other) {
        return (other.pixel - dot.pixel).norm() < std::max(other.radius_px, dot.radius_px);
      });
      if (same == dots.end()) {
        dots.push_back(dot);
      } else {
        *same = dot;  // The wider window sees more of the ground and puts the rim better.
      }
    }
  }
  return dots;
}

}  // namespace fringe_fusion::internal
