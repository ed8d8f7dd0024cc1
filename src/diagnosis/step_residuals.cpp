#include "step_residuals.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace fringe_fusion::diagnosis {
namespace {

using Complex = std::complex<double>;
using Row = Eigen::Matrix<Complex, 1, 6>;

constexpr double kMaxScatter = 3.0;  // residuals beyond, in units of their rms, are edges

// One sample's coefficient and what it is made of, over the noise.
struct Equation {
  Row row;
  Complex value;
};

Equation MakeEquation(const StepSamples& samples, Eigen::Index pixel,
                      const std::vector<Eigen::Index>& columns) {
  const auto steps = static_cast<double>(columns.size());
  Complex first;
  Complex second;
  double mean = 0.0;
  for (const Eigen::Index c : columns) {
    const double value = samples.values_dn(pixel, c) / steps;
    const double shift = samples.shift_rad[static_cast<std::size_t>(c)];
    mean += value;
    first += value * std::polar(1.0, shift);
    second += value * std::polar(1.0, -2.0 * shift);
  }
  // Shot noise: the variance rises with the level.
  const double weight = 1.0 / std::sqrt(std::max(mean, 1.0));
  const double dark = samples.dark_dn[pixel];
  const double modulation = 2.0 * weight * std::abs(first);
  const double phase = std::arg(first);
  Equation equation;
  equation.row << weight * (mean - dark), std::polar(modulation, phase),
      std::polar(modulation, -phase), std::polar(modulation, -2.0 * phase),
      std::polar(modulation, (steps - 2.0) * phase), weight * dark;
  equation.value = weight * second;
  return equation;
}

}  // namespace

ResidualFit FitResidual(const StepSamples& samples, std::size_t set,
                        const std::vector<Eigen::Index>& rows) {
  std::vector<Eigen::Index> columns;
  for (std::size_t c = 0; c < samples.set_of.size(); ++c) {
    if (samples.set_of[c] == set) columns.push_back(static_cast<Eigen::Index>(c));
  }
  std::vector<Equation> equations;
  for (const Eigen::Index pixel : rows) {
    equations.push_back(MakeEquation(samples, pixel, columns));
  }
  using Normal = Eigen::Matrix<Complex, 6, 6>;
  using Vector = Eigen::Matrix<Complex, 6, 1>;
  ResidualFit fit;
  Vector solution = Vector::Zero();
  double limit = std::numeric_limits<double>::infinity();
  for (int round = 0; round < 3; ++round) {
    Normal normal = Normal::Zero();
    Vector right = Vector::Zero();
    double squares = 0.0;
    std::size_t count = 0;
    for (const Equation& e : equations) {
      if (!(std::norm(e.value - (e.row * solution)(0)) <= limit)) continue;
      normal += e.row.adjoint() * e.row;
      right += e.row.adjoint() * e.value;
      ++count;
    }
    // A block that sees part of a fringe leaves some of the terms undetermined.
    normal.diagonal().array() += 1e-6 * normal.diagonal().real().maxCoeff() + 1e-12;
    const Eigen::LDLT<Normal> solver(normal);
    solution = solver.solve(right);
    for (const Equation& e : equations) {
      const double apart = std::norm(e.value - (e.row * solution)(0));
      if (apart <= limit) squares += apart;
    }
    const double variance = squares / std::max<double>(1.0, static_cast<double>(count) - 6.0);
    const Normal inverse = solver.solve(Normal::Identity());
    fit.variance_shift = variance * (inverse(1, 1).real() + inverse(2, 2).real());
    fit.variance_low = variance * inverse(3, 3).real();
    limit = kMaxScatter * kMaxScatter * variance;
  }
  fit.plus = solution[1];
  fit.minus = solution[2];
  fit.low = solution[3];
  return fit;
}

std::vector<std::vector<Eigen::Index>> MakeBlocks(const StepSamples& samples, int width, int height,
                                                  int blocks_across, std::size_t min_rows) {
  const int side = std::max(1, (std::max(width, height) + blocks_across - 1) / blocks_across);
  std::map<std::pair<int, int>, std::vector<Eigen::Index>> groups;
  for (std::size_t r = 0; r < samples.pixels.size(); ++r) {
    const auto x = static_cast<int>(samples.pixels[r] % static_cast<std::size_t>(width));
    const auto y = static_cast<int>(samples.pixels[r] / static_cast<std::size_t>(width));
    groups[{y / side, x / side}].push_back(static_cast<Eigen::Index>(r));
  }
  std::vector<std::vector<Eigen::Index>> blocks;
  for (auto& [place, rows] : groups) {
    if (rows.size() >= min_rows) blocks.push_back(std::move(rows));
  }
  return blocks;
}

}  // namespace fringe_fusion::diagnosis
