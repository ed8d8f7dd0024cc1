#include "phase_mask.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <vector>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::decode {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr int kRowsPerChunk = 32;

/// Finds the edges of one chunk of rows with their ratios B / A of three rows at a time.
class EdgeFinder {
 public:
  EdgeFinder(const PhaseMap& map, const PhaseConfig& config, const Kernels& kernels)
      : map_(map), kernels_(kernels), width_(static_cast<std::size_t>(map.width) + 2) {
    args_.max_step_px = static_cast<float>(config.max_edge_step_px);
    args_.least_ratio = static_cast<float>(config.min_mixed_ratio);
    for (std::size_t i = 0; i < 3; ++i) {
      u_[i].assign(width_, kNan);
      v_[i].assign(width_, kNan);
      ratio_[i].assign(width_, 0.0F);
    }
    edges_.assign(width_, 0);
    found_.assign(width_, 0);
    args_.edges = edges_.data();
    args_.found = found_.data();
  }

  void Run(int begin, int end, Image<std::uint8_t>& edges) {
    for (int y = begin - 1; y < end + 1; ++y) {
      Load(y);
      if (y - 1 < begin) continue;
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t slot = (static_cast<std::size_t>(y + 1) + i) % 3;  // of row y - 2 + i
        args_.u[i] = map_.u.empty() ? nullptr : u_[slot].data();
        args_.v[i] = map_.v.empty() ? nullptr : v_[slot].data();
        args_.ratio[i] = ratio_[slot].data();
      }
      kernels_.find_edges(args_, static_cast<int>(width_));
      std::copy_n(edges_.begin() + 1, map_.width, edges.row(y - 1));
    }
  }

 private:
  using Rows = std::array<std::vector<float>, 3>;

  // With a missing pixel on either side, so that the border needs no case of its own.
  void Load(int y) {
    const std::size_t slot = static_cast<std::size_t>(y + 3) % 3;
    const bool inside = y >= 0 && y < map_.height;
    const auto copy = [&](const Image<float>& image, std::vector<float>& row) {
      if (image.empty()) return;
      if (inside) std::copy_n(image.row(y), map_.width, row.begin() + 1);
      if (!inside) std::fill(row.begin(), row.end(), kNan);
    };
    copy(map_.u, u_[slot]);
    copy(map_.v, v_[slot]);
    if (inside) {
      kernels_.ratio(map_.modulation.row(y), map_.offset.row(y), map_.mask.row(y),
                     ratio_[slot].data() + 1, map_.width);
    } else {
      std::fill(ratio_[slot].begin(), ratio_[slot].end(), 0.0F);
    }
  }

  const PhaseMap& map_;
  const Kernels& kernels_;
  std::size_t width_ = 0;
  EdgeArgs args_;
  Rows u_;
  Rows v_;
  Rows ratio_;
  std::vector<std::int32_t> found_;
  std::vector<std::uint8_t> edges_;
};

void TakeOut(const Image<std::uint8_t>& edges, int y, PhaseMap& map) {
  const std::uint8_t* row = edges.row(y);
  if (std::memchr(row, 1, static_cast<std::size_t>(map.width)) == nullptr) return;
  for (int x = 0; x < map.width; ++x) {
    if (row[x] == 0) continue;
    map.mask(x, y) = static_cast<std::uint8_t>(MaskReason::kEdge);
    for (Image<float>* image : {&map.u, &map.v, &map.sigma_u, &map.sigma_v}) {
      if (!image->empty()) (*image)(x, y) = kNan;
    }
  }
}

}  // namespace

PhaseMap MaskEdges(PhaseMap map, const PhaseConfig& config, const Kernels& kernels) {
  Image<std::uint8_t> edges(map.width, map.height);
  ParallelFor(map.height, kRowsPerChunk,
              [&](int begin, int end) { EdgeFinder(map, config, kernels).Run(begin, end, edges); });
  ParallelFor(map.height, kRowsPerChunk, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) TakeOut(edges, y, map);
  });
  return map;
}

}  // namespace fringe_fusion::decode
