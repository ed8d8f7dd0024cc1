#include "edge_shift.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "common/constants.hpp"

namespace fringe_fusion::diagnosis {
namespace {

using Complex = std::complex<double>;
using Shift = Eigen::Matrix<Complex, 2, 1>;

constexpr double kMinSlope = 0.03;     // of an edge per pixel, of the brightest level
constexpr std::size_t kMinEdges = 60;  // fewer say little about two numbers

struct EdgePixel {
  std::size_t sample = 0;
  Eigen::Vector2d slope_dn;  ///< per pixel
};

std::vector<EdgePixel> FindEdges(const SampledStack& stack, const LightRange& range,
                                 const Image<float>& mean) {
  std::vector<float> levels(mean.begin(), mean.end());
  const auto top = levels.begin() +
                   static_cast<std::ptrdiff_t>(0.99 * (static_cast<double>(levels.size()) - 1.0));
  std::nth_element(levels.begin(), top, levels.end());
  const double least = kMinSlope * static_cast<double>(*top);
  std::vector<EdgePixel> edges;
  for (int y = 0; y < stack.height(); ++y) {
    for (int x = 0; x < stack.width(); ++x) {
      const int px = x * stack.stride;
      const int py = y * stack.stride;
      if (px < 1 || py < 1 || px + 1 >= mean.width() || py + 1 >= mean.height()) continue;
      if (!(range.bright(x, y) < kSaturationRatio * stack.full_scale_dn)) continue;
      const Eigen::Vector2d slope(0.5 * static_cast<double>(mean(px + 1, py) - mean(px - 1, py)),
                                  0.5 * static_cast<double>(mean(px, py + 1) - mean(px, py - 1)));
      if (!(slope.norm() > least)) continue;
      const std::size_t sample =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(stack.width()) +
          static_cast<std::size_t>(x);
      edges.push_back({sample, slope});
    }
  }
  return edges;
}

// sum over frames of weight * grey value.
std::vector<Complex> Combine(const SampledStack& stack, const std::vector<EdgePixel>& edges,
                             const std::vector<int>& frames, const std::vector<Complex>& weights) {
  std::vector<Complex> sums(edges.size());
  for (std::size_t n = 0; n < frames.size(); ++n) {
    const Image<float>& frame = stack.frames[static_cast<std::size_t>(frames[n])];
    for (std::size_t k = 0; k < edges.size(); ++k) {
      sums[k] += weights[n] * static_cast<double>(frame[edges[k].sample]);
    }
  }
  return sums;
}

// Adds the squared shift, per frame and axis, that the combined values say.
struct ShiftSum {
  double squares = 0.0;
  double variance = 0.0;
  double count = 0.0;

  void Add(const std::vector<EdgePixel>& edges, const std::vector<Complex>& values,
           double frames_per_square) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Shift right = Shift::Zero();
    for (std::size_t k = 0; k < edges.size(); ++k) {
      normal += edges[k].slope_dn * edges[k].slope_dn.transpose();
      right += edges[k].slope_dn.cast<Complex>() * values[k];
    }
    const Eigen::Matrix2d inverse = normal.inverse();
    const Shift shift = inverse.cast<Complex>() * right;
    double rest = 0.0;
    for (std::size_t k = 0; k < edges.size(); ++k) {
      rest += std::norm(values[k] - edges[k].slope_dn.cast<Complex>().dot(shift));
    }
    const double scale = 0.5 * frames_per_square;  // two axes
    squares += scale * shift.squaredNorm();
    variance += scale * inverse.trace() * rest / (static_cast<double>(edges.size()) - 2.0);
    count += 1.0;
  }
};

void AddSteps(const SampledStack& stack, const std::vector<EdgePixel>& edges, const StepSet& set,
              ShiftSum& sum) {
  const auto steps = static_cast<double>(set.frame_of_step.size());
  std::vector<Complex> weights;
  for (double n = 0.0; n < steps; n += 1.0) {
    weights.push_back(std::polar(1.0 / steps, -2.0 * kTwoPi * n / steps));
  }
  // A coefficient of independent shifts has 1 / N of their variance.
  sum.Add(edges, Combine(stack, edges, set.frame_of_step, weights), steps);
}

void AddLevels(const SampledStack& stack, const std::vector<EdgePixel>& edges,
               const std::vector<StepSet>& sets, ShiftSum& sum) {
  for (std::size_t s = 0; s + 1 < sets.size(); ++s) {
    std::vector<int> frames = sets[s].frame_of_step;
    const std::vector<int>& other = sets[s + 1].frame_of_step;
    std::vector<Complex> weights(frames.size(), 1.0 / static_cast<double>(frames.size()));
    weights.resize(frames.size() + other.size(), -1.0 / static_cast<double>(other.size()));
    const double variance =
        1.0 / static_cast<double>(frames.size()) + 1.0 / static_cast<double>(other.size());
    frames.insert(frames.end(), other.begin(), other.end());
    sum.Add(edges, Combine(stack, edges, frames, weights), 1.0 / variance);
  }
}

}  // namespace

Image<float> MeanImage(const ImageStack& stack, const SequencePlan& plan) {
  std::vector<int> frames;
  for (const StepSet& set : plan.sets) {
    frames.insert(frames.end(), set.frame_of_step.begin(), set.frame_of_step.end());
  }
  if (frames.empty()) frames = plan.white_frames;
  if (frames.empty()) return {};
  const CapturedFrame& first = stack.frames.front();
  Image<float> sum(Width(first), Height(first));
  const float share = 1.0F / static_cast<float>(frames.size());
  for (const int frame : frames) {
    std::visit(
        [&](const auto& pixels) {
          for (std::size_t i = 0; i < sum.size(); ++i) {
            sum[i] += share * static_cast<float>(pixels[i]);
          }
        },
        stack.frames[static_cast<std::size_t>(frame)].pixels);
  }
  return sum;
}

EdgeShift MeasureEdgeShift(const SampledStack& stack, const SequencePlan& plan,
                           const LightRange& range, const Image<float>& mean_image) {
  EdgeShift shift;
  if (mean_image.empty() || plan.sets.empty()) return shift;
  const std::vector<EdgePixel> edges = FindEdges(stack, range, mean_image);
  shift.num_edges = static_cast<int>(edges.size());
  if (edges.size() < kMinEdges) return shift;
  ShiftSum sum;
  for (const StepSet& set : plan.sets) {
    if (set.frame_of_step.size() >= 4) AddSteps(stack, edges, set, sum);
  }
  if (sum.count == 0.0) AddLevels(stack, edges, plan.sets, sum);
  if (sum.count == 0.0) return shift;
  shift.sigma_px = std::sqrt(sum.variance / sum.count);
  shift.rms_px = std::sqrt(std::max(0.0, sum.squares - sum.variance) / sum.count);
  return shift;
}

}  // namespace fringe_fusion::diagnosis
