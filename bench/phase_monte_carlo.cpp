// Long Monte Carlo of the decoder on synthetic stacks with known noise: accuracy against the
// Cramer-Rao bound, truth of the stated sigma, fringe orders with and without the doubt mask.
//   phase_monte_carlo [accuracy|orders|doubt]
#include <fmt/format.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "fringe_fusion/phase/phase_map.hpp"
#include "test/phase/synthetic_stack.hpp"

namespace fringe_fusion::bench {
namespace {

using test::SyntheticScene;

constexpr int kProjectorWidth = 1280;
constexpr int kRenders = 200;
constexpr double kTwoPi = 2.0 * M_PI;

struct Noise {
  double read_dn = 0.0;
  double gain_dn = 0.0;
};

struct Case {
  PatternConfig pattern;
  Noise noise;
  PhaseConfig decoder;
  int width = 120;
  int height = 40;
};

struct Tally {
  long num_pixels = 0;
  long num_valid = 0;
  long num_wrong = 0;  // of the valid: farther than half the finest period
  double squares = 0.0;
  double bound = 0.0;       // sum of the bounds of the variance
  double normalized = 0.0;  // sum of (error / sigma)^2
};

Case MakeCase(const std::string& fringes, int steps, const Noise& noise) {
  Case out;
  out.pattern.fringes = fringes;
  out.pattern.steps = steps;
  out.pattern.axis_v = false;
  out.noise = noise;
  out.decoder.read_noise_dn = noise.read_dn;
  out.decoder.gain_dn = noise.gain_dn;
  // The simulated response is exact.
  out.decoder.phase_error_rad = 0.0;
  return out;
}

SyntheticScene SceneOf(const Case& setup, int render) {
  SyntheticScene scene;
  scene.width = setup.width;
  scene.height = setup.height;
  scene.read_noise_dn = setup.noise.read_dn;
  scene.gain_dn = setup.noise.gain_dn;
  scene.seed = 7001U + 13U * static_cast<unsigned>(render);
  const double step = 1160.0 / setup.width;
  scene.u = [step, render](int x, int y) { return 50.0 + step * x + 0.31 * y + 0.013 * render; };
  return scene;
}

// Information on the phase in one N-step set: the inverse of the (phi, phi) element of the
// covariance of (A, B, phi) with the noise of every sample.
double PhaseInformation(int steps, double phase, double offset, double amplitude,
                        const Noise& noise) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  for (int n = 0; n < steps; ++n) {
    const double angle = phase - kTwoPi * n / steps;
    const double grey = offset + amplitude * std::cos(angle);
    const double variance = noise.read_dn * noise.read_dn + noise.gain_dn * grey + 1.0 / 12.0;
    const Eigen::Vector3d row(1.0, std::cos(angle), -amplitude * std::sin(angle));
    normal += row * row.transpose() / variance;
  }
  return 1.0 / normal.inverse()(2, 2);
}

// Science section 2.4: all sets together. The bound depends on the phase where shot noise does.
double BoundPx2(const PatternSequence& sequence, double u, const SyntheticScene& scene,
                const Noise& noise) {
  const double offset = 0.5 * (scene.bright_dn + scene.dark_dn);
  const double amplitude = 0.5 * (scene.bright_dn - scene.dark_dn);
  double information = 0.0;
  for (const Pattern& pattern : sequence.frames) {
    if (pattern.kind != PatternKind::kPhase || pattern.step != 0) continue;
    const double rad_per_px = kTwoPi * pattern.fringes / sequence.width;
    information +=
        rad_per_px * rad_per_px *
        PhaseInformation(pattern.steps, rad_per_px * (u + 0.5), offset, amplitude, noise);
  }
  return 1.0 / information;
}

void AddRender(const Case& setup, const PatternSequence& sequence, int render, bool with_bound,
               Tally& tally) {
  const SyntheticScene scene = SceneOf(setup, render);
  const Result<PhaseMap> map = DecodePhase(test::Synthesize(sequence, scene), setup.decoder);
  if (!map) throw std::runtime_error(map.error().message);
  const double half_px = 0.5 * kProjectorWidth / sequence.frames.back().fringes;
  for (int y = 0; y < map->height; ++y) {
    for (int x = 0; x < map->width; ++x) {
      ++tally.num_pixels;
      if (map->mask(x, y) != 0) continue;
      ++tally.num_valid;
      const double error = static_cast<double>(map->u(x, y)) - scene.u(x, y);
      if (std::abs(error) > half_px) {
        ++tally.num_wrong;
        continue;
      }
      const auto sigma = static_cast<double>(map->sigma_u(x, y));
      tally.squares += error * error;
      tally.normalized += error * error / (sigma * sigma);
      if (with_bound) tally.bound += BoundPx2(sequence, scene.u(x, y), scene, setup.noise);
    }
  }
}

Tally Run(const Case& setup, int num_renders, bool with_bound) {
  const PatternSequence sequence = MakeSequence(setup.pattern, kProjectorWidth, 800).value();
  Tally tally;
  for (int render = 0; render < num_renders; ++render) {
    AddRender(setup, sequence, render, with_bound, tally);
  }
  return tally;
}

int RunAccuracy() {
  fmt::print("| fringes | N | noise | values | error / bound | error / sigma | NEES | wrong |\n");
  int num_beyond = 0;
  for (const char* fringes : {"1,8,64", "1,4,16,64", "59,63,64", "1,16"}) {
    for (int steps = 3; steps <= 16; ++steps) {
      for (const Noise& noise : {Noise{0.9, 0.0}, Noise{0.5, 0.05}}) {
        const Tally tally = Run(MakeCase(fringes, steps, noise), kRenders, true);
        const auto count = static_cast<double>(tally.num_valid - tally.num_wrong);
        const double to_bound = std::sqrt(tally.squares / tally.bound);
        const double nees = tally.normalized / count;
        const bool beyond =
            to_bound > 1.05 || std::abs(std::sqrt(nees) - 1.0) > 0.05 || tally.num_wrong > 0;
        if (beyond) ++num_beyond;
        fmt::print("| {} | {} | {} + {} I | {} | {:.3f} | {:.3f} | {:.3f} | {} |{}\n", fringes,
                   steps, noise.read_dn, noise.gain_dn, tally.num_valid, to_bound, std::sqrt(nees),
                   nees, tally.num_wrong, beyond ? " BEYOND" : "");
        std::fflush(stdout);
      }
    }
  }
  fmt::print("{} cases beyond their limits\n", num_beyond);
  return num_beyond == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}

// Science section 2.3. Nested sets are fused before the next: f_i^2 / sum f_k^2 of the variance of
// a phase comes from below. Two near-equal frequencies: sqrt(f1^2 + f2^2) of its deviation.
double FailureProbability(const std::vector<double>& fringes, double sigma_rad) {
  if (fringes.front() > 1.0) {
    const double spread = std::hypot(fringes[0], fringes[1]);
    return std::erfc(M_PI / (std::sqrt(2.0) * sigma_rad * spread));
  }
  double success = 1.0;
  double sum_f2 = fringes.front() * fringes.front();
  for (std::size_t i = 1; i < fringes.size(); ++i) {
    const double f2 = fringes[i] * fringes[i];
    const double spread = std::sqrt(1.0 + f2 / sum_f2);
    success *= 1.0 - std::erfc(M_PI / (std::sqrt(2.0) * sigma_rad * spread));
    sum_f2 += f2;
  }
  return 1.0 - success;
}

// The same with the true density of a measured phase in place of the normal one, which has too
// little in its tails when the noise is a good part of the modulation.
class PhaseErrorDensity {
 public:
  /// Of a phase measured with `sigma_rad`, in rad: the angle of 1 + normal noise in both
  /// components.
  static PhaseErrorDensity OfPhase(double sigma_rad) {
    PhaseErrorDensity out;
    for (int i = 0; i < kCells; ++i) {
      const double x = At(i);
      const double c = std::cos(x) / sigma_rad;
      const double s = std::sin(x) / sigma_rad;
      const double normal_cdf = 0.5 * std::erfc(-c / std::sqrt(2.0));
      out.density_.push_back(std::exp(-0.5 / (sigma_rad * sigma_rad)) / kTwoPi +
                             c / std::sqrt(kTwoPi) * std::exp(-0.5 * s * s) * normal_cdf);
    }
    return out;
  }
  /// Density of scale_a a + scale_b b of independent a and b, cut at +-pi.
  static PhaseErrorDensity Sum(double scale_a, const PhaseErrorDensity& a, double scale_b,
                               const PhaseErrorDensity& b) {
    PhaseErrorDensity out;
    for (int i = 0; i < kCells; ++i) {
      double sum = 0.0;
      for (int k = 0; k < kCells; ++k) {
        sum += a.density_[static_cast<std::size_t>(k)] *
               b.Value((At(i) - scale_a * At(k)) / scale_b) / std::abs(scale_b);
      }
      out.density_.push_back(sum * kCell);
    }
    return out;
  }
  /// P(|scale_a a + scale_b b| > pi); the greater scale, which the cells must resolve, is that of
  /// b.
  static double Beyond(double scale_a, const PhaseErrorDensity& a, double scale_b,
                       const PhaseErrorDensity& b) {
    std::vector<double> above(kCells + 1, 0.0);  // of b, from each cell's lower edge on
    for (int i = kCells - 1; i >= 0; --i) {
      const auto at = static_cast<std::size_t>(i);
      above[at] = above[at + 1] + b.density_[at] * kCell;
    }
    const auto tail = [&](double x) {  // P(b > x)
      const double position = (x + M_PI) / kCell;
      if (position <= 0.0) return above.front();
      if (position >= kCells) return 0.0;
      const auto cell = static_cast<std::size_t>(position);
      const double part = position - static_cast<double>(cell);
      return above[cell] + part * (above[cell + 1] - above[cell]);
    };
    // Both are symmetric, and so is their sum.
    double sum = 0.0;
    for (int i = 0; i < kCells; ++i) {
      sum += a.density_[static_cast<std::size_t>(i)] * kCell *
             tail((M_PI - scale_a * At(i)) / std::abs(scale_b));
    }
    return 2.0 * sum;
  }

 private:
  static constexpr int kCells = 16001;
  static constexpr double kCell = kTwoPi / kCells;
  static double At(int cell) { return (cell + 0.5) * kCell - M_PI; }
  [[nodiscard]] double Value(double x) const {
    const double position = (x + M_PI) / kCell - 0.5;
    const double below = std::floor(position);
    const auto cell = static_cast<int>(below);
    if (cell < 0 || cell + 1 >= kCells) return 0.0;
    const double part = position - below;
    return (1.0 - part) * density_[static_cast<std::size_t>(cell)] +
           part * density_[static_cast<std::size_t>(cell) + 1];
  }

  std::vector<double> density_;
};

double ExactFailureProbability(const std::vector<double>& fringes, double sigma_rad) {
  const PhaseErrorDensity phase = PhaseErrorDensity::OfPhase(sigma_rad);
  if (fringes.front() > 1.0) {
    return PhaseErrorDensity::Beyond(fringes[0], phase, -fringes[1], phase);
  }
  double success = 1.0;
  double sum_f2 = fringes.front() * fringes.front();
  PhaseErrorDensity fused = phase;  // error of all levels so far, as a phase of the finest of them
  for (std::size_t i = 1; i < fringes.size(); ++i) {
    const double ratio = fringes[i] / fringes[i - 1];
    success *= 1.0 - PhaseErrorDensity::Beyond(1.0, phase, ratio, fused);
    const double f2 = fringes[i] * fringes[i];
    const double weight = f2 / (sum_f2 + f2);
    if (i + 1 < fringes.size()) {
      fused = PhaseErrorDensity::Sum((1.0 - weight) * ratio, fused, weight, phase);
    }
    sum_f2 += f2;
  }
  return 1.0 - success;
}

struct OrderCase {
  const char* fringes = "";
  std::vector<double> list;
  int steps = 0;
  double read_dn = 0.0;
};

std::vector<OrderCase> OrderCases() {
  return {{"1,16", {1, 16}, 3, 4.0},       {"1,16", {1, 16}, 3, 6.0},
          {"1,32", {1, 32}, 4, 3.0},       {"1,64", {1, 64}, 4, 2.0},
          {"1,8,64", {1, 8, 64}, 3, 8.0},  {"1,8,64", {1, 8, 64}, 4, 10.0},
          {"1,6,36", {1, 6, 36}, 5, 14.0}, {"1,4,16,64", {1, 4, 16, 64}, 3, 14.0},
          {"15,16", {15, 16}, 3, 4.0},     {"15,16", {15, 16}, 8, 8.0},
          {"31,32", {31, 32}, 4, 2.5}};
}

Case OrderSetup(const OrderCase& order) {
  Case setup = MakeCase(order.fringes, order.steps, {order.read_dn, 0.0});
  setup.decoder.min_modulation_sigma = 1.0;
  // The edge mask would find many a wrong order: the doubt mask stands alone here.
  setup.decoder.max_bend_px = 10000.0;
  setup.width = 250;
  setup.height = 200;
  return setup;
}

int RunOrders() {
  fmt::print(
      "| fringes | N | sigma_I / B | pixels | wrong | formula | exact | (wrong - exact) / sigma "
      "|\n");
  int num_beyond = 0;
  for (const OrderCase& order : OrderCases()) {
    Case setup = OrderSetup(order);
    setup.decoder.max_order_error_ratio = 0.5;
    setup.decoder.max_wrong_order_ratio = 1.0;
    setup.decoder.max_level_sigma = 1e6;
    setup.decoder.max_residual_sigma = 1000.0;
    const Tally tally = Run(setup, kRenders, false);
    const double sigma_dn = std::sqrt(order.read_dn * order.read_dn + 1.0 / 12.0);
    const double sigma_rad = std::sqrt(2.0 / order.steps) * sigma_dn / 80.0;
    const double formula = FailureProbability(order.list, sigma_rad);
    const double p = ExactFailureProbability(order.list, sigma_rad);
    const double expected = p * static_cast<double>(tally.num_valid);
    const double spread = std::sqrt(expected * (1.0 - p));
    const double off = (static_cast<double>(tally.num_wrong) - expected) / spread;
    const bool beyond = !(std::abs(off) <= 3.0);
    if (beyond) ++num_beyond;
    fmt::print("| {} | {} | {:.4f} | {} | {} | {:.1f} | {:.1f} | {:+.2f} |{}\n", order.fringes,
               order.steps, sigma_dn / 80.0, tally.num_valid, tally.num_wrong,
               formula * static_cast<double>(tally.num_valid), expected, off,
               beyond ? " BEYOND" : "");
    std::fflush(stdout);
  }
  fmt::print("{} cases beyond three binomial sigma\n", num_beyond);
  return num_beyond == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}

int RunDoubt() {
  fmt::print("| fringes | N | sigma_I / B | pixels | valid | wrong order | share of the valid |\n");
  int num_beyond = 0;
  for (const OrderCase& order : OrderCases()) {
    Case setup = OrderSetup(order);
    const Tally tally = Run(setup, kRenders, false);
    const double share =
        static_cast<double>(tally.num_wrong) / static_cast<double>(tally.num_valid);
    const bool beyond = !(share <= 1e-5);
    if (beyond) ++num_beyond;
    fmt::print("| {} | {} | {:.4f} | {} | {} | {} | {:.1e} |{}\n", order.fringes, order.steps,
               order.read_dn / 80.0, tally.num_pixels, tally.num_valid, tally.num_wrong, share,
               beyond ? " BEYOND" : "");
    std::fflush(stdout);
  }
  fmt::print("{} cases beyond 1e-5\n", num_beyond);
  return num_beyond == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}

int Main(int argc, char** argv) {
  const std::string part = argc > 1 ? argv[1] : "";
  int failed = 0;
  if (part.empty() || part == "accuracy") failed += RunAccuracy();
  if (part.empty() || part == "orders") failed += RunOrders();
  if (part.empty() || part == "doubt") failed += RunDoubt();
  return failed == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace
}  // namespace fringe_fusion::bench

int main(int argc, char** argv) {
  try {
    return fringe_fusion::bench::Main(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "phase_monte_carlo: %s\n", error.what());
    return EXIT_FAILURE;
  }
}
