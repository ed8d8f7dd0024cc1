#include "step_factors.hpp"

#include <algorithm>
#include <cmath>

#include "common/constants.hpp"
#include "common/dense.hpp"

namespace fringe_fusion::diagnosis {
namespace {

// Frame factors are small; this keeps those in check that the pixels' own parameters can feign.
constexpr double kRidge = 0.05;

// Whether a sample and all its neighbours are lit, or all are not; saturated ones are neither.
bool IsAlike(const LightRange& range, const SampledStack& stack, int x, int y, bool lit) {
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if (!range.lit.Contains(x + dx, y + dy)) return false;
      if ((range.lit(x + dx, y + dy) != 0) != lit) return false;
    }
  }
  return range.bright(x, y) < kSaturationRatio * stack.full_scale_dn;
}

// Columns of some sets.
std::vector<Eigen::Index> ColumnsOf(const StepSamples& samples,
                                    const std::vector<std::size_t>& sets) {
  std::vector<Eigen::Index> columns;
  for (std::size_t c = 0; c < samples.set_of.size(); ++c) {
    if (std::find(sets.begin(), sets.end(), samples.set_of[c]) != sets.end()) {
      columns.push_back(static_cast<Eigen::Index>(c));
    }
  }
  return columns;
}

// What a pixel chooses itself: one mean level for all frames, then cosine and sine of each set.
Eigen::MatrixXd PixelDesign(const StepSamples& samples, const std::vector<std::size_t>& sets,
                            const std::vector<Eigen::Index>& columns) {
  const auto rows = static_cast<Eigen::Index>(columns.size());
  Eigen::MatrixXd design =
      Eigen::MatrixXd::Zero(rows, 1 + 2 * static_cast<Eigen::Index>(sets.size()));
  for (Eigen::Index r = 0; r < rows; ++r) {
    const auto column = static_cast<std::size_t>(columns[static_cast<std::size_t>(r)]);
    const auto place = std::find(sets.begin(), sets.end(), samples.set_of[column]) - sets.begin();
    design(r, 0) = 1.0;
    design(r, 1 + 2 * place) = std::cos(samples.shift_rad[column]);
    design(r, 2 + 2 * place) = std::sin(samples.shift_rad[column]);
  }
  return design;
}

// Factors x of the columns that minimise sum |P (I - diag(light) x)|^2, and the share of
// sum |P I|^2 that they explain. `normal` is P * sum(light light^T), element by element.
struct Solution {
  double rms = 0.0;
  double energy = 0.0;
};

Solution Solve(Eigen::MatrixXd normal, const Eigen::VectorXd& right) {
  normal.diagonal().array() += kRidge * normal.diagonal().maxCoeff() + 1e-300;
  const Eigen::VectorXd factors = dense::SolveSymmetric(normal, right);
  return {std::sqrt(factors.squaredNorm() / static_cast<double>(factors.size())),
          right.dot(factors)};
}

// Sums over the pixels that both kinds of factors are solved from.
struct FactorSums {
  explicit FactorSums(Eigen::Index columns)
      : light_products(Eigen::MatrixXd::Zero(columns, columns)),
        light_right(Eigen::VectorXd::Zero(columns)),
        dark_right(Eigen::VectorXd::Zero(columns)) {}

  Eigen::MatrixXd light_products;
  Eigen::VectorXd light_right;
  Eigen::VectorXd dark_right;
  double dark_squares = 0.0;
  double squares = 0.0;
  double light = 0.0;
  double dark = 0.0;
};

void AddPixels(const StepSamples& samples, const std::vector<Eigen::Index>& columns,
               const Eigen::MatrixXd& design, const Eigen::MatrixXd& pseudo, FactorSums& sums) {
  const Eigen::MatrixXd project =
      Eigen::MatrixXd::Identity(design.rows(), design.rows()) - design * pseudo;
  Eigen::VectorXd values(design.rows());
  for (Eigen::Index r = 0; r < samples.values_dn.rows(); ++r) {
    for (Eigen::Index k = 0; k < values.size(); ++k) {
      values[k] = samples.values_dn(r, columns[static_cast<std::size_t>(k)]);
    }
    const Eigen::VectorXd own = pseudo * values;
    const double dark = samples.dark_dn[r];
    const Eigen::VectorXd light = (design * own).array() - dark;
    const Eigen::VectorXd residual = project * values;
    // Shot noise: the variance rises with the level.
    const double weight = 1.0 / std::max(own[0], 1.0);
    sums.light_products.noalias() += weight * light * light.transpose();
    sums.light_right += weight * light.cwiseProduct(residual);
    sums.dark_right += weight * dark * residual;
    sums.dark_squares += weight * dark * dark;
    sums.squares += weight * residual.squaredNorm();
    sums.light += own[0] - dark;
    sums.dark += dark;
  }
}

}  // namespace

StepSamples SelectStepSamples(const SampledStack& stack, const SequencePlan& plan,
                              const LightRange& range, bool lit, std::size_t max_pixels) {
  StepSamples samples;
  std::vector<std::size_t> inside;
  for (int y = 0; y < stack.height(); ++y) {
    for (int x = 0; x < stack.width(); ++x) {
      if (IsAlike(range, stack, x, y, lit)) {
        inside.push_back(static_cast<std::size_t>(y) * static_cast<std::size_t>(stack.width()) +
                         static_cast<std::size_t>(x));
      }
    }
  }
  const std::size_t step = std::max<std::size_t>(1, (inside.size() + max_pixels - 1) / max_pixels);
  for (std::size_t k = 0; k < inside.size(); k += step) samples.pixels.push_back(inside[k]);
  for (std::size_t s = 0; s < plan.sets.size(); ++s) {
    const std::vector<int>& frames = plan.sets[s].frame_of_step;
    for (std::size_t n = 0; n < frames.size(); ++n) {
      samples.frames.push_back(frames[n]);
      samples.set_of.push_back(s);
      samples.shift_rad.push_back(kTwoPi * static_cast<double>(n) /
                                  static_cast<double>(frames.size()));
    }
  }
  const auto rows = static_cast<Eigen::Index>(samples.pixels.size());
  samples.values_dn.resize(rows, static_cast<Eigen::Index>(samples.frames.size()));
  samples.dark_dn.resize(rows);
  const Image<float> black =
      plan.black_frames.empty() ? range.dark : MeanOfFrames(stack, plan.black_frames);
  for (Eigen::Index r = 0; r < rows; ++r) {
    const std::size_t pixel = samples.pixels[static_cast<std::size_t>(r)];
    samples.dark_dn[r] = static_cast<double>(black[pixel]);
    for (std::size_t c = 0; c < samples.frames.size(); ++c) {
      samples.values_dn(r, static_cast<Eigen::Index>(c)) =
          static_cast<double>(stack.frames[static_cast<std::size_t>(samples.frames[c])][pixel]);
    }
  }
  return samples;
}

FrameFactors FitFrameFactors(const StepSamples& lit, const StepSamples& unlit,
                             const std::vector<std::size_t>& sets) {
  const std::vector<Eigen::Index> columns = ColumnsOf(lit, sets);
  const Eigen::MatrixXd design = PixelDesign(lit, sets, columns);
  const Eigen::MatrixXd pseudo = dense::PseudoInverse(design);
  const Eigen::MatrixXd project =
      Eigen::MatrixXd::Identity(design.rows(), design.rows()) - design * pseudo;
  FactorSums sums(design.rows());
  AddPixels(lit, columns, design, pseudo, sums);
  const double light_per_dark = sums.light / std::max(sums.dark, 1e-3 * sums.light);
  AddPixels(unlit, columns, design, pseudo, sums);
  FrameFactors factors;
  if (!(sums.squares > 0.0) || !(light_per_dark > 0.0)) return factors;
  const Solution gain = Solve(project.cwiseProduct(sums.light_products), sums.light_right);
  const Solution ambient = Solve(sums.dark_squares * project, sums.dark_right);
  factors.gain_rms = gain.rms;
  factors.gain_energy = gain.energy / sums.squares;
  factors.ambient_rms = ambient.rms / light_per_dark;
  factors.ambient_energy = ambient.energy / sums.squares;
  return factors;
}

}  // namespace fringe_fusion::diagnosis
