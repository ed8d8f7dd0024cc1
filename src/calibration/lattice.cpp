#include "lattice.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "common/constants.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr int kMaxSeeds = 300;

/// Features in square buckets, for neighbours.
class Buckets {
 public:
  explicit Buckets(const std::vector<Feature>& features) : features_(features) {
    if (features.empty()) return;
    Eigen::Vector2d low = features.front().pixel;
    Eigen::Vector2d high = low;
    for (const Feature& feature : features) {
      low = low.cwiseMin(feature.pixel);
      high = high.cwiseMax(feature.pixel);
    }
    const double area = std::max(1.0, (high - low).prod());
    size_ = std::max(1.0, 2.0 * std::sqrt(area / static_cast<double>(features.size())));
    for (std::size_t i = 0; i < features.size(); ++i) {
      buckets_[Key(features[i].pixel)].push_back(static_cast<int>(i));
    }
  }

  /// Calls visit(index, distance) for every feature within a radius.
  template <typename Visit>
  void Within(const Eigen::Vector2d& p, double radius, Visit&& visit) const {
    const auto [x0, y0] = Key(p - Eigen::Vector2d::Constant(radius));
    const auto [x1, y1] = Key(p + Eigen::Vector2d::Constant(radius));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const auto bucket = buckets_.find({x, y});
        if (bucket == buckets_.end()) continue;
        for (const int i : bucket->second) {
          const double distance = (features_[static_cast<std::size_t>(i)].pixel - p).norm();
          if (distance <= radius) visit(i, distance);
        }
      }
    }
  }

  [[nodiscard]] int Nearest(const Eigen::Vector2d& p, double radius) const {
    int nearest = -1;
    double least = radius;
    Within(p, radius, [&](int i, double distance) {
      if (nearest >= 0 && distance >= least) return;
      nearest = i;
      least = distance;
    });
    return nearest;
  }
  [[nodiscard]] double size() const { return size_; }

 private:
  [[nodiscard]] std::pair<int, int> Key(const Eigen::Vector2d& p) const {
    return {static_cast<int>(std::floor(p.x() / size_)),
            static_cast<int>(std::floor(p.y() / size_))};
  }

  const std::vector<Feature>& features_;
  std::map<std::pair<int, int>, std::vector<int>> buckets_;
  double size_ = 1.0;
};

/// Where a lattice starts: a feature and the steps to its neighbours.
struct Seed {
  int feature = 0;
  Eigen::Vector2d a = Eigen::Vector2d::Zero();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();
};

/// Whether a feature fits at a place whose neighbour is known; `step` is the sum of the place.
using Fits = std::function<bool(const Feature& seed, const Feature& feature, int parity)>;

class Grower {
 public:
  Grower(const std::vector<Feature>& features, const Buckets& buckets, Fits fits)
      : features_(features), buckets_(buckets), fits_(std::move(fits)) {}

  [[nodiscard]] Lattice Grow(const Seed& seed) {
    places_.clear();
    used_.assign(features_.size(), false);
    seed_ = seed.feature;
    Put({0, 0}, seed.feature, seed.a, seed.b);
    while (!open_.empty()) {
      const std::pair<int, int> place = open_.front();
      open_.pop_front();
      for (const auto& [dx, dy] :
           {std::pair(1, 0), std::pair(-1, 0), std::pair(0, 1), std::pair(0, -1)}) {
        Step(place, dx, dy);
      }
    }
    Lattice lattice;
    for (const auto& [place, node] : places_) {
      lattice.nodes.push_back({Eigen::Vector2i(place.first, place.second), node.feature});
    }
    return lattice;
  }

 private:
  struct Node {
    int feature = 0;
    Eigen::Vector2d a = Eigen::Vector2d::Zero();  ///< step to the next node along x, as known here
    Eigen::Vector2d b = Eigen::Vector2d::Zero();
  };

  void Put(const std::pair<int, int>& place, int feature, const Eigen::Vector2d& a,
           const Eigen::Vector2d& b) {
    places_[place] = {feature, a, b};
    used_[static_cast<std::size_t>(feature)] = true;
    open_.push_back(place);
  }

  void Step(const std::pair<int, int>& from, int dx, int dy) {
    const std::pair<int, int> to(from.first + dx, from.second + dy);
    if (places_.count(to) > 0) return;
    const Node node = places_.at(from);
    const Eigen::Vector2d& here = features_[static_cast<std::size_t>(node.feature)].pixel;
    const Eigen::Vector2d step = dx * node.a + dy * node.b;
    constexpr double kTolerance = 0.22;  // of a step: perspective and distortion from node to node
    const int next = buckets_.Nearest(here + step, kTolerance * step.norm());
    if (next < 0 || used_[static_cast<std::size_t>(next)]) return;
    const Feature& feature = features_[static_cast<std::size_t>(next)];
    if (!fits_(features_[static_cast<std::size_t>(seed_)], feature, to.first + to.second)) return;
    const Eigen::Vector2d taken = feature.pixel - here;
    Eigen::Vector2d a = node.a;
    Eigen::Vector2d b = node.b;
    (dx != 0 ? a : b) = dx != 0 ? dx * taken : dy * taken;
    // The other step as the neighbour beside has it, where that one is known.
    RefineOther(to, dx, feature.pixel, a, b);
    Put(to, next, a, b);
  }

  void RefineOther(const std::pair<int, int>& to, int dx, const Eigen::Vector2d& pixel,
                   Eigen::Vector2d& a, Eigen::Vector2d& b) const {
    for (const int sign : {1, -1}) {
      const std::pair<int, int> beside =
          dx != 0 ? std::pair(to.first, to.second + sign) : std::pair(to.first + sign, to.second);
      const auto known = places_.find(beside);
      if (known == places_.end()) continue;
      const Eigen::Vector2d other =
          sign * (features_[static_cast<std::size_t>(known->second.feature)].pixel - pixel);
      (dx != 0 ? b : a) = other;
      return;
    }
  }

  const std::vector<Feature>& features_;
  const Buckets& buckets_;
  Fits fits_;
  std::map<std::pair<int, int>, Node> places_;
  std::deque<std::pair<int, int>> open_;
  std::vector<bool> used_;
  int seed_ = 0;
};

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Right-handed base in a picture.
Seed Oriented(Seed seed) {
  if (Cross(seed.a, seed.b) < 0.0) seed.b = -seed.b;
  return seed;
}

bool AreAlike(const Feature& a, const Feature& b) {
  const double ratio = a.radius_px / b.radius_px;
  return ratio > 0.4 && ratio < 2.5;
}

/// A dot with neighbours on both sides along two directions.
std::optional<Seed> DotSeed(const std::vector<Feature>& dots, const Buckets& buckets, int index) {
  const Feature& dot = dots[static_cast<std::size_t>(index)];
  std::vector<std::pair<double, int>> near;
  buckets.Within(dot.pixel, 3.0 * buckets.size(), [&](int i, double distance) {
    if (i != index && AreAlike(dot, dots[static_cast<std::size_t>(i)]))
      near.push_back({distance, i});
  });
  std::sort(near.begin(), near.end());
  if (near.size() > 12) near.resize(12);
  std::vector<Eigen::Vector2d> steps;
  for (const auto& [distance, i] : near) {
    const Eigen::Vector2d step = dots[static_cast<std::size_t>(i)].pixel - dot.pixel;
    const bool is_along = !steps.empty() && std::abs(Cross(steps.front(), step)) <=
                                                0.4 * steps.front().norm() * step.norm();
    if (is_along) continue;
    // At the border of a lattice the shortest steps have nothing opposite, and longer ones would
    // make another base: only dots inside serve.
    const int opposite = buckets.Nearest(dot.pixel - step, 0.2 * distance);
    if (opposite < 0 || opposite == index) return std::nullopt;
    if (!AreAlike(dot, dots[static_cast<std::size_t>(opposite)])) return std::nullopt;
    if (!steps.empty()) return Oriented({index, steps.front(), step});
    steps.push_back(step);
  }
  return std::nullopt;
}

/// Difference of two directions of lines, in [0, pi/2].
double Turn(double a_rad, double b_rad) {
  const double turn = std::fmod(std::abs(a_rad - b_rad), kPi);
  return std::min(turn, kPi - turn);
}

/// Whether a corner may be that of the same board an odd or even number of steps away. Perspective
/// turns the edges slowly; near a turn by 180 degrees their order may flip, and with it the name of
/// the sectors.
bool IsNextCorner(const Feature& corner, const Feature& other, bool is_odd) {
  const double same =
      Turn(corner.edges_rad[0], other.edges_rad[0]) + Turn(corner.edges_rad[1], other.edges_rad[1]);
  const double flipped =
      Turn(corner.edges_rad[0], other.edges_rad[1]) + Turn(corner.edges_rad[1], other.edges_rad[0]);
  if (!(std::min(same, flipped) < 1.2)) return false;
  const bool is_bright = other.is_bright_between != (flipped < same);
  return (is_bright == corner.is_bright_between) != is_odd;
}

/// Neighbour of a corner along one of its edges: the nearest one in a narrow cone whose sectors are
/// the other way round.
std::optional<Eigen::Vector2d> CornerStep(const std::vector<Feature>& corners,
                                          const Buckets& buckets, int index, double edge_rad) {
  const Feature& corner = corners[static_cast<std::size_t>(index)];
  const Eigen::Vector2d direction(std::cos(edge_rad), std::sin(edge_rad));
  std::optional<Eigen::Vector2d> nearest;
  buckets.Within(corner.pixel, 4.0 * buckets.size(), [&](int i, double distance) {
    const Feature& other = corners[static_cast<std::size_t>(i)];
    if (i == index) return;
    const Eigen::Vector2d step = other.pixel - corner.pixel;
    if (step.dot(direction) < 0.985 * distance || !IsNextCorner(corner, other, true)) return;
    if (!nearest || distance < nearest->norm()) nearest = step;
  });
  return nearest;
}

std::optional<Seed> CornerSeed(const std::vector<Feature>& corners, const Buckets& buckets,
                               int index) {
  const Feature& corner = corners[static_cast<std::size_t>(index)];
  std::array<Eigen::Vector2d, 2> steps;
  for (std::size_t k = 0; k < 2; ++k) {
    const auto forth = CornerStep(corners, buckets, index, corner.edges_rad[k]);
    const auto back = CornerStep(corners, buckets, index, corner.edges_rad[k] + kPi);
    if (!forth || !back) return std::nullopt;
    if (!((*forth + *back).norm() < 0.35 * forth->norm())) return std::nullopt;
    steps[k] = 0.5 * (*forth - *back);
  }
  return Oriented({index, steps[0], steps[1]});
}

/// Grows from one feature after another until enough is found or nothing is left to start from.
template <typename MakeSeed>
Lattice GrowLargest(const std::vector<Feature>& features, int enough, MakeSeed&& make_seed,
                    const Fits& fits) {
  const Buckets buckets(features);
  Grower grower(features, buckets, fits);
  std::vector<bool> tried(features.size(), false);
  Lattice best;
  int num_seeds = 0;
  for (std::size_t i = 0; i < features.size() && num_seeds < kMaxSeeds; ++i) {
    if (tried[i]) continue;
    const std::optional<Seed> seed = make_seed(features, buckets, static_cast<int>(i));
    if (!seed) continue;
    ++num_seeds;
    Lattice lattice = grower.Grow(*seed);
    if (lattice.nodes.size() >= 9) {
      for (const LatticeNode& node : lattice.nodes) {
        tried[static_cast<std::size_t>(node.feature)] = true;
      }
    }
    if (lattice.nodes.size() > best.nodes.size()) best = std::move(lattice);
    if (static_cast<int>(best.nodes.size()) >= enough) break;
  }
  return best;
}

}  // namespace

Lattice GrowDotLattice(const std::vector<Feature>& dots, int enough) {
  return GrowLargest(dots, enough, DotSeed,
                     [](const Feature& seed, const Feature& feature, int /*parity*/) {
                       return AreAlike(seed, feature);
                     });
}

Lattice GrowCornerLattice(const std::vector<Feature>& corners, int enough) {
  return GrowLargest(corners, enough, CornerSeed,
                     [](const Feature& seed, const Feature& feature, int parity) {
                       return IsNextCorner(seed, feature, parity % 2 != 0);
                     });
}

}  // namespace fringe_fusion::internal
