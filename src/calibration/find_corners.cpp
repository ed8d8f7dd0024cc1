#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "common/constants.hpp"
#include "feature.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr int kRing = 32;        // samples on the ring around a corner
constexpr double kRadius = 5.0;  // of the ring [px of the level]
constexpr int kBorder = 8;       // ring and derivatives stay inside
constexpr int kMaxCandidates = 20000;

struct Saddle {
  int x = 0;
  int y = 0;
  float strength = 0.0F;
};

/// Local maxima of the saddle strength -det(Hessian).
std::vector<Saddle> SaddlePoints(const cv::Mat& smooth) {
  cv::Mat xx;
  cv::Mat yy;
  cv::Mat xy;
  cv::Sobel(smooth, xx, CV_32F, 2, 0);
  cv::Sobel(smooth, yy, CV_32F, 0, 2);
  cv::Sobel(smooth, xy, CV_32F, 1, 1);
  const cv::Mat saddle = xy.mul(xy) - xx.mul(yy) / 4.0;  // the kernels of xx and yy weigh double
  cv::Mat highest;
  cv::dilate(saddle, highest, cv::Mat::ones(5, 5, CV_8U));
  std::vector<Saddle> candidates;
  for (int y = kBorder; y < smooth.rows - kBorder; ++y) {
    const float* values = saddle.ptr<float>(y);
    const float* maxima = highest.ptr<float>(y);
    for (int x = kBorder; x < smooth.cols - kBorder; ++x) {
      if (values[x] > 0.0F && values[x] == maxima[x]) candidates.push_back({x, y, values[x]});
    }
  }
  std::sort(candidates.begin(), candidates.end(), [](const Saddle& a, const Saddle& b) {
    return std::tie(b.strength, a.y, a.x) < std::tie(a.strength, b.y, b.x);
  });
  if (candidates.size() > kMaxCandidates) candidates.resize(kMaxCandidates);
  return candidates;
}

/// Grey values on the ring, less their mean.
std::array<double, kRing> RingValues(const Image<float>& smooth, const Eigen::Vector2d& p,
                                     double& mean, double& amplitude) {
  std::array<double, kRing> ring{};
  mean = 0.0;
  for (int k = 0; k < kRing; ++k) {
    const double angle = 2.0 * kPi * k / kRing;
    ring[static_cast<std::size_t>(k)] =
        SampleGrey(smooth, p.x() + kRadius * std::cos(angle), p.y() + kRadius * std::sin(angle));
  }
  const auto [least, most] = std::minmax_element(ring.begin(), ring.end());
  // The middle of the extremes: the sectors need not be equally wide.
  mean = 0.5 * (*least + *most);
  amplitude = 0.5 * (*most - *least);
  for (double& value : ring) value -= mean;
  return ring;
}

/// Whether opposite halves of a ring look alike.
bool IsAntipodal(const std::array<double, kRing>& ring) {
  double products = 0.0;
  double squares = 0.0;
  for (std::size_t k = 0; k < kRing / 2; ++k) {
    products += ring[k] * ring[k + kRing / 2];
    squares += 0.5 * (ring[k] * ring[k] + ring[k + kRing / 2] * ring[k + kRing / 2]);
  }
  return products > 0.6 * squares;
}

/// Where the ring changes its sign, as fractions of a turn.
std::vector<double> Crossings(const std::array<double, kRing>& ring) {
  std::vector<double> crossings;
  for (std::size_t k = 0; k < kRing; ++k) {
    const double here = ring[k];
    const double next = ring[(k + 1) % kRing];
    if ((here > 0.0) == (next > 0.0)) continue;
    crossings.push_back((static_cast<double>(k) + here / (here - next)) / kRing);
  }
  return crossings;
}

/// A corner where exactly four sectors alternate about `p`.
std::optional<Feature> ReadRing(const Image<float>& smooth, const Eigen::Vector2d& p,
                                const DetectConfig& config) {
  double mean = 0.0;
  double amplitude = 0.0;
  const auto ring = RingValues(smooth, p, mean, amplitude);
  if (!(2.0 * amplitude >= config.min_contrast_ratio * (mean + amplitude))) return std::nullopt;
  const double noise = std::sqrt(config.read_noise_dn * config.read_noise_dn +
                                 config.gain_dn * std::max(0.0, mean + amplitude));
  if (!(amplitude >= 2.0 * noise)) return std::nullopt;
  if (!IsAntipodal(ring)) return std::nullopt;
  const std::vector<double> turns = Crossings(ring);
  if (turns.size() != 4) return std::nullopt;
  const double first = 0.5 * (turns[0] + turns[2] - 0.5);
  const double second = 0.5 * (turns[1] + turns[3] - 0.5);
  // Sectors below 20 degrees mean no square.
  if (!(second - first > 0.055 && second - first < 0.445)) return std::nullopt;
  if (!(std::abs(turns[2] - turns[0] - 0.5) < 0.06 && std::abs(turns[3] - turns[1] - 0.5) < 0.06)) {
    return std::nullopt;
  }
  Feature corner;
  corner.pixel = p;
  corner.edges_rad = {2.0 * kPi * first, 2.0 * kPi * second};
  const auto between =
      static_cast<std::size_t>(std::lround(0.5 * (first + second) * kRing)) % kRing;
  corner.is_bright_between = ring[between] > 0.0;
  // Both directions into [0, pi); swapping them swaps the sectors.
  for (double& edge : corner.edges_rad) {
    edge = std::fmod(edge + 2.0 * kPi, kPi);
  }
  if (corner.edges_rad[0] > corner.edges_rad[1]) {
    std::swap(corner.edges_rad[0], corner.edges_rad[1]);
    corner.is_bright_between = !corner.is_bright_between;
  }
  return corner;
}

/// Corners of one level of a pyramid.
/// @param scale pixels of the picture per pixel of the level.
void FindAtScale(const cv::Mat& grey, double scale, const DetectConfig& config,
                 std::vector<Feature>& corners) {
  if (grey.rows < 3 * kBorder || grey.cols < 3 * kBorder) return;
  Image<float> smooth(grey.cols, grey.rows);
  cv::Mat view(grey.rows, grey.cols, CV_32F, smooth.data());
  cv::GaussianBlur(grey, view, cv::Size(), 1.2);
  std::vector<Feature> found;
  for (const Saddle& candidate : SaddlePoints(view)) {
    std::optional<Feature> corner =
        ReadRing(smooth, Eigen::Vector2d(candidate.x, candidate.y), config);
    if (!corner) continue;
    const auto is_near = [&](const Feature& other) {
      return (other.pixel - corner->pixel).norm() < kRadius;
    };
    // The strongest candidate of a place comes first.
    if (std::none_of(found.begin(), found.end(), is_near)) found.push_back(*corner);
  }
  for (Feature& corner : found) {
    corner.pixel =
        scale * (corner.pixel + Eigen::Vector2d::Constant(0.5)) - Eigen::Vector2d::Constant(0.5);
    corners.push_back(corner);
  }
}

}  // namespace

std::vector<Feature> FindCorners(const Image<float>& picture, const DetectConfig& config) {
  // OpenCV takes non-const pixels but only reads them.
  cv::Mat level(picture.height(), picture.width(), CV_32F, const_cast<float*>(picture.data()));
  std::vector<Feature> corners;
  double scale = 1.0;
  for (int k = 0; k < 3; ++k) {
    std::vector<Feature> found;
    FindAtScale(level, scale, config, found);
    for (const Feature& corner : found) {
      const auto is_near = [&](const Feature& other) {
        return (other.pixel - corner.pixel).norm() < 1.5 * kRadius * scale;
      };
      if (std::none_of(corners.begin(), corners.end(), is_near)) corners.push_back(corner);
    }
    cv::Mat half;
    cv::resize(level, half, cv::Size(level.cols / 2, level.rows / 2), 0, 0, cv::INTER_AREA);
    level = half;
    scale *= 2.0;
  }
  return corners;
}

}  // namespace fringe_fusion::internal
