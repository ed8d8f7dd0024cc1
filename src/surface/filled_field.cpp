#include "filled_field.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

namespace fringe_fusion::internal {
namespace {

constexpr Rgb8 kFillColor{150, 150, 150};
// Two neighbours then never differ by more than the extraction takes for one surface, rounding
// included.
constexpr float kLimitVoxels = 0.89F;
// As the extraction has it: a larger change within one voxel lies between two sheets.
constexpr float kMaxJumpVoxels = 1.8F;

int FloorBlock(double voxel) {
  return static_cast<int>(std::floor(voxel / VoxelField::kBlockSize));
}

}  // namespace

FilledField::FilledField(const VoxelField& measured, const Eigen::AlignedBox3d& box, SpaceGrid grid,
                         std::vector<Space> states, std::vector<float> values)
    : measured_(measured),
      box_(box),
      grid_(grid),
      states_(std::move(states)),
      values_(std::move(values)),
      limit_(kLimitVoxels * static_cast<float>(measured.voxel_m())) {
  FindBlocks();
}

// The measured blocks with their neighbours, and those near a change of sign on the grid.
void FilledField::FindBlocks() {
  std::set<BlockIndex> found;
  for (const BlockIndex& block : measured_.Blocks()) {
    for (int k = 0; k < 27; ++k) {
      found.insert({block[0] + k % 3 - 1, block[1] + k / 3 % 3 - 1, block[2] + k / 9 - 1});
    }
  }
  const double reach = grid_.step + voxel_m();
  const auto is_inside = [&](int x, int y, int z) {
    if (x < 0 || y < 0 || z < 0) return false;
    if (x >= grid_.size[0] || y >= grid_.size[1] || z >= grid_.size[2]) return false;
    return values_[grid_.Index(x, y, z)] < 0.0F;
  };
  for (int z = 0; z < grid_.size[2]; ++z) {
    for (int y = 0; y < grid_.size[1]; ++y) {
      for (int x = 0; x < grid_.size[0]; ++x) {
        if (!is_inside(x, y, z)) continue;
        bool crossed = false;
        for (int k = 0; k < 27 && !crossed; ++k) {
          crossed = !is_inside(x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1);
        }
        if (!crossed) continue;
        const Eigen::Vector3d low =
            (grid_.At(x, y, z) - Eigen::Vector3d::Constant(reach)) / voxel_m();
        const Eigen::Vector3d high =
            (grid_.At(x, y, z) + Eigen::Vector3d::Constant(reach)) / voxel_m();
        for (int bx = FloorBlock(low.x()); bx <= FloorBlock(high.x()); ++bx) {
          for (int by = FloorBlock(low.y()); by <= FloorBlock(high.y()); ++by) {
            for (int bz = FloorBlock(low.z()); bz <= FloorBlock(high.z()); ++bz) {
              found.insert({bx, by, bz});
            }
          }
        }
      }
    }
  }
  blocks_.assign(found.begin(), found.end());
}

float FilledField::FillValue(const Eigen::Vector3d& point) const {
  if (!box_.contains(point)) return limit_;
  const Eigen::Vector3d at = (point - grid_.origin) / grid_.step;
  std::array<int, 3> base{};
  std::array<float, 3> t{};
  std::array<int, 3> nearest{};
  for (std::size_t a = 0; a < 3; ++a) {
    const double p =
        std::clamp(at[static_cast<int>(a)], 0.0, static_cast<double>(grid_.size[a] - 1));
    base[a] = std::clamp(static_cast<int>(p), 0, std::max(0, grid_.size[a] - 2));
    t[a] = static_cast<float>(p - base[a]);
    nearest[a] = static_cast<int>(std::lround(p));
  }
  float value = 0.0F;
  for (int c = 0; c < 8; ++c) {
    float share = 1.0F;
    std::array<int, 3> node{};
    for (std::size_t a = 0; a < 3; ++a) {
      const int step = (c >> a) & 1;
      share *= step == 1 ? t[a] : 1.0F - t[a];
      node[a] = std::min(base[a] + step, grid_.size[a] - 1);
    }
    value += share * values_[grid_.Index(node[0], node[1], node[2])];
  }
  // What a line of sight passed is outside, however the neighbours pull.
  if (states_[grid_.Index(nearest[0], nearest[1], nearest[2])] == Space::kEmpty) return limit_;
  return std::clamp(value, -limit_, limit_);
}

FieldSample FilledField::FillSample(const Eigen::Vector3d& point) const {
  FieldSample sample;
  sample.supported = true;
  sample.distance = FillValue(point);
  const double h = grid_.step;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = h * Eigen::Vector3d::Unit(axis);
    sample.gradient[axis] = FillValue(point + step) - FillValue(point - step);
  }
  const float length = sample.gradient.norm();
  if (length > 0.0F) sample.gradient /= length;
  // Not a measurement: as uncertain as the grid is coarse, and seen by nobody.
  sample.sigma = static_cast<float>(grid_.step);
  sample.weight = 0.0F;
  sample.num_views = 0;
  sample.color = kFillColor;
  return sample;
}

FieldSample FilledField::AtVoxel(const std::array<int, 3>& voxel) const {
  const FieldSample measured = measured_.AtVoxel(voxel);
  if (measured.supported) return measured;
  return FillSample(Eigen::Vector3d(voxel[0], voxel[1], voxel[2]) * voxel_m());
}

FieldSample FilledField::Query(const Eigen::Vector3d& point_object) const {
  const FieldSample measured = measured_.Query(point_object);
  return measured.supported ? measured : FillSample(point_object);
}

VoxelField::PaddedDistances FilledField::DistancesOf(const BlockIndex& block) const {
  PaddedDistances distances = measured_.DistancesOf(block);
  for (int i = 0; i < kPaddedSize * kPaddedSize * kPaddedSize; ++i) {
    float& distance = distances[static_cast<std::size_t>(i)];
    if (!std::isfinite(distance)) {
      const Eigen::Vector3i local(i % kPaddedSize, i / kPaddedSize % kPaddedSize,
                                  i / (kPaddedSize * kPaddedSize));
      const Eigen::Vector3i voxel =
          Eigen::Vector3i(block[0], block[1], block[2]) * kBlockSize + local;
      distance = FillValue(voxel.cast<double>() * voxel_m());
    }
    distance = std::clamp(distance, -limit_, limit_);
  }
  return distances;
}

bool FilledField::IsMeasured(const std::array<int, 3>& cell) const {
  std::array<float, 8> distance{};
  for (std::size_t c = 0; c < 8; ++c) {
    const auto bit = [&](unsigned axis) { return static_cast<int>((c >> axis) & 1U); };
    const FieldSample at =
        measured_.AtVoxel({cell[0] + bit(0), cell[1] + bit(1), cell[2] + bit(2)});
    if (!at.supported) return false;
    distance[c] = at.distance;
  }
  const float max_jump = kMaxJumpVoxels * static_cast<float>(voxel_m());
  for (std::size_t c = 0; c < 8; ++c) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t other = c | (std::size_t{1} << axis);
      if ((distance[c] < 0.0F) == (distance[other] < 0.0F)) continue;
      if (std::abs(distance[c] - distance[other]) > max_jump) return false;
    }
  }
  return true;
}

}  // namespace fringe_fusion::internal
