#include "fringe_sets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "fringe_fusion/pattern/pattern_sequence.hpp"

namespace fringe_fusion::diagnosis {
namespace {

constexpr double kRepeatTolerance = 1e-3;  // of patterns.yaml
constexpr int kMaxOthers = 48;             // frequencies tried below the finest
constexpr int kFrontSteps = 8;

using FringeSet = std::vector<double>;

/// A jointly unwrapped set and what it is worth.
struct Rated {
  std::array<int, 2> others{};  ///< the coarser frequencies; others[1] 0: none
  double information = 0.0;
  double margin2 = 0.0;
};

// Least squared distance of a wrong order for a noise of 1 fringe per set, the best common shift
// taken out; science section 2.3. Stops once it is below what matters.
double Margin2(double finest, const std::array<int, 2>& others, double least) {
  const double r0 = others[0] / finest;
  const double r1 = others[1] / finest;
  const double information = 1.0 + r0 * r0 + r1 * r1;
  double margin2 = std::numeric_limits<double>::infinity();
  for (int k = 1; k < finest && margin2 > least; ++k) {
    const double e0 = std::remainder(r0 * k, 1.0);
    const double e1 = std::remainder(r1 * k, 1.0);
    const double sum = r0 * e0 + r1 * e1;
    margin2 = std::min(margin2, e0 * e0 + e1 * e1 - sum * sum / information);
  }
  return margin2;
}

std::vector<Rated> RateJoint(int finest, int count, const TransferOf& transfer) {
  const auto weight = [&](int f) {
    const double value = f * transfer(f);
    return value * value;
  };
  // The last sets of all sizes: f - 1, f - 2 and so on matter most.
  std::vector<int> others;
  const int lowest = std::max(2, finest / 3);
  for (int f = finest - 1; f >= lowest; f -= 1 + std::max(0, finest - f) / kMaxOthers) {
    others.push_back(f);
  }
  std::vector<Rated> rated;
  for (std::size_t i = 0; i < others.size(); ++i) {
    if (count == 2) {
      rated.push_back({{others[i], 0}, weight(finest) + weight(others[i]), 0.0});
      continue;
    }
    for (std::size_t j = i + 1; j < others.size(); ++j) {
      const double information = weight(finest) + weight(others[i]) + weight(others[j]);
      rated.push_back({{others[i], others[j]}, information, 0.0});
    }
  }
  for (Rated& set : rated) set.margin2 = Margin2(finest, set.others, 1e-9);
  return rated;
}

// The sets that no other beats in both, thinned to a few margins.
std::vector<Rated> Front(std::vector<Rated> rated) {
  std::stable_sort(rated.begin(), rated.end(),
                   [](const Rated& a, const Rated& b) { return a.information > b.information; });
  std::vector<Rated> front;
  for (const Rated& set : rated) {
    if (!(set.margin2 > 1e-9)) continue;
    // A margin that is hardly wider is no choice of its own.
    const double wider = front.empty() ? 0.0 : 1.1 * front.back().margin2;
    if (set.margin2 > wider) front.push_back(set);
  }
  if (front.size() <= kFrontSteps) return front;
  std::vector<Rated> thinned;
  for (std::size_t i = 0; i < kFrontSteps; ++i) {
    thinned.push_back(front[i * (front.size() - 1) / (kFrontSteps - 1)]);
  }
  return thinned;
}

void AddNested(int finest, int count, std::vector<FringeSet>& sets) {
  using Exponents = std::vector<double>;
  std::vector<Exponents> exponents = {{}};
  if (count == 3) exponents = {{0.5}, {0.6}, {0.7}, {0.8}, {0.9}};
  if (count == 4) exponents = {{0.33, 0.67}, {0.4, 0.75}, {0.5, 0.85}, {0.6, 0.9}};
  for (const Exponents& choice : exponents) {
    FringeSet set = {1.0};
    for (const double exponent : choice) {
      set.push_back(std::round(std::pow(static_cast<double>(finest), exponent)));
    }
    set.push_back(finest);
    const bool rises =
        std::adjacent_find(set.begin(), set.end(), std::greater_equal<>()) == set.end();
    if (rises && std::find(sets.begin(), sets.end(), set) == sets.end()) sets.push_back(set);
  }
}

}  // namespace

std::vector<std::vector<double>> FringeSets(int finest, int count, const TransferOf& transfer) {
  std::vector<FringeSet> sets;
  AddNested(finest, count, sets);
  if (count > 3) return sets;
  for (const Rated& rated : Front(RateJoint(finest, count, transfer))) {
    FringeSet set = {static_cast<double>(finest), static_cast<double>(rated.others[0])};
    if (count == 3) set.push_back(rated.others[1]);
    std::sort(set.begin(), set.end());
    if (RepeatRatio(set, kRepeatTolerance) >= 1.0) sets.push_back(set);
  }
  return sets;
}

}  // namespace fringe_fusion::diagnosis
