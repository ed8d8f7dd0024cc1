#include "spatial_unwrap.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace fringe_fusion::decode {
namespace {

/// Two neighbours: cost is low where both lie on a smooth surface.
struct Pair {
  float cost;
  std::uint32_t first;
  std::uint32_t second;
};

class Unwrapper {
 public:
  Unwrapper(const Image<float>& wrapped, double period_px)
      : wrapped_(wrapped), period_(period_px), group_(wrapped.size()), order_(wrapped.size()) {
    for (std::size_t i = 0; i < group_.size(); ++i) group_[i] = static_cast<std::uint32_t>(i);
  }

  Image<float> Run() {
    for (const Pair& pair : SortedPairs()) Join(pair);
    Image<float> out = wrapped_;
    const std::vector<std::int64_t> base = LeastOrders();
    for (std::size_t i = 0; i < out.size(); ++i) {
      if (!std::isfinite(out[i])) continue;
      const auto root = Find(static_cast<std::uint32_t>(i));
      const auto order = static_cast<double>(OrderOf(static_cast<std::uint32_t>(i)) - base[root]);
      out[i] = static_cast<float>(static_cast<double>(wrapped_[i]) + order * period_);
    }
    return out;
  }

 private:
  [[nodiscard]] double Difference(std::size_t a, std::size_t b) const {
    const double d = static_cast<double>(wrapped_[a]) - static_cast<double>(wrapped_[b]);
    return d - period_ * std::round(d / period_);
  }

  // Sum of squared second differences along both image axes; borders and gaps are unreliable.
  [[nodiscard]] float CostOf(int x, int y) const {
    const int width = wrapped_.width();
    if (x < 1 || y < 1 || x + 1 >= width || y + 1 >= wrapped_.height()) return 1e30F;
    const auto at = [&](int i, int j) {
      return static_cast<std::size_t>(j) * static_cast<std::size_t>(width) +
             static_cast<std::size_t>(i);
    };
    const std::size_t here = at(x, y);
    const double along = Difference(at(x - 1, y), here) - Difference(here, at(x + 1, y));
    const double across = Difference(at(x, y - 1), here) - Difference(here, at(x, y + 1));
    const double cost = along * along + across * across;
    return std::isfinite(cost) ? static_cast<float>(cost) : 1e30F;
  }

  [[nodiscard]] std::vector<Pair> SortedPairs() const {
    Image<float> cost(wrapped_.width(), wrapped_.height());
    for (int y = 0; y < cost.height(); ++y) {
      for (int x = 0; x < cost.width(); ++x) cost(x, y) = CostOf(x, y);
    }
    std::vector<Pair> pairs;
    const auto width = static_cast<std::size_t>(cost.width());
    const auto add = [&](std::size_t a, std::size_t b) {
      if (!std::isfinite(wrapped_[a]) || !std::isfinite(wrapped_[b])) return;
      pairs.push_back(
          {cost[a] + cost[b], static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b)});
    };
    for (int y = 0; y < cost.height(); ++y) {
      for (int x = 0; x < cost.width(); ++x) {
        const std::size_t here = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
        if (x + 1 < cost.width()) add(here, here + 1);
        if (y + 1 < cost.height()) add(here, here + width);
      }
    }
    std::stable_sort(pairs.begin(), pairs.end(),
                     [](const Pair& a, const Pair& b) { return a.cost < b.cost; });
    return pairs;
  }

  // order_ holds the order of a pixel relative to its parent in the forest.
  std::uint32_t Find(std::uint32_t i) {
    std::uint32_t root = i;
    std::int64_t total = 0;
    while (group_[root] != root) {
      total += order_[root];
      root = group_[root];
    }
    while (group_[i] != root && i != root) {
      const std::uint32_t next = group_[i];
      const std::int64_t own = order_[i];
      group_[i] = root;
      order_[i] = static_cast<std::int32_t>(total);
      total -= own;
      i = next;
    }
    return root;
  }

  std::int64_t OrderOf(std::uint32_t i) {
    const std::uint32_t root = Find(i);
    return i == root ? 0 : order_[i];
  }

  void Join(const Pair& pair) {
    const std::uint32_t a = Find(pair.first);
    const std::uint32_t b = Find(pair.second);
    if (a == b) return;
    const double step =
        static_cast<double>(wrapped_[pair.first]) - static_cast<double>(wrapped_[pair.second]);
    // Order of the second pixel relative to the first.
    const auto jump = static_cast<std::int64_t>(std::llround(step / period_));
    const std::int64_t shift = OrderOf(pair.first) + jump - OrderOf(pair.second);
    // The tree of the later pixel hangs below the other: results do not depend on sizes.
    group_[b] = a;
    order_[b] = static_cast<std::int32_t>(shift);
  }

  std::vector<std::int64_t> LeastOrders() {
    std::vector<std::int64_t> least(group_.size(), std::numeric_limits<std::int64_t>::max());
    for (std::size_t i = 0; i < group_.size(); ++i) {
      const auto pixel = static_cast<std::uint32_t>(i);
      const std::uint32_t root = Find(pixel);
      least[root] = std::min(least[root], OrderOf(pixel));
    }
    return least;
  }

  const Image<float>& wrapped_;
  double period_ = 1.0;
  std::vector<std::uint32_t> group_;
  std::vector<std::int32_t> order_;
};

}  // namespace

Image<float> UnwrapOverImage(const Image<float>& wrapped, double period_px) {
  return Unwrapper(wrapped, period_px).Run();
}

}  // namespace fringe_fusion::decode
