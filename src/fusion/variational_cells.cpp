#include "variational_cells.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr int kMaxDepth = 24;
// With fewer a cell takes more of its neighbourhood.
constexpr std::size_t kMinCenters = 24;

bool IsWithin(const Eigen::Vector3f& point, const Eigen::Vector3f& middle, float half) {
  return (point - middle).cwiseAbs().maxCoeff() <= half;
}

std::vector<int> Filter(const std::vector<Center>& centers, const std::vector<int>& from,
                        const Eigen::Vector3f& middle, float half) {
  std::vector<int> within;
  for (const int i : from) {
    if (IsWithin(centers[static_cast<std::size_t>(i)].position, middle, half)) within.push_back(i);
  }
  return within;
}

// Wendland's function of smoothness 2 on a line.
float BlendWeight(float t) {
  const float rest = std::max(0.0F, 1.0F - t);
  return rest * rest * rest * (3.0F * t + 1.0F);
}

}  // namespace

CellTree::CellTree(const std::vector<Center>& centers, const Settings& settings)
    : settings_(settings) {
  if (centers.empty()) return;
  Eigen::AlignedBox3f box;
  std::vector<int> all;
  for (std::size_t i = 0; i < centers.size(); ++i) {
    box.extend(centers[i].position);
    all.push_back(static_cast<int>(i));
  }
  Node root;
  root.middle = box.center();
  root.half = std::max(1e-9F, 0.5001F * box.sizes().maxCoeff());
  nodes_.push_back(root);
  Divide(centers, 0, all, 0);
}

// `within`: the centres that the node hears.
void CellTree::Divide(const std::vector<Center>& centers, std::size_t node,
                      const std::vector<int>& within, int depth) {
  const Node parent = nodes_[node];
  const bool is_small = within.size() <= static_cast<std::size_t>(settings_.max_cell_centers) ||
                        static_cast<double>(Reach(parent.half)) <= settings_.margin;
  if (is_small || depth >= kMaxDepth) {
    MakeCell(centers, node, within, within);
    return;
  }
  std::array<std::vector<int>, 8> inside;
  std::vector<int> children;
  const float half = 0.5F * parent.half;
  const auto middle_of = [&](int child) {
    return Eigen::Vector3f(parent.middle + half * Eigen::Vector3f((child & 1) != 0 ? 1.0F : -1.0F,
                                                                  (child & 2) != 0 ? 1.0F : -1.0F,
                                                                  (child & 4) != 0 ? 1.0F : -1.0F));
  };
  for (int child = 0; child < 8; ++child) {
    // Where no centre lies in the cell itself, its neighbours reach what is left of the surface.
    if (Filter(centers, within, middle_of(child), half).empty()) continue;
    inside[static_cast<std::size_t>(child)] =
        Filter(centers, within, middle_of(child), Hearing(half));
    children.push_back(child);
  }
  nodes_[node].first_child = static_cast<int>(nodes_.size());
  nodes_[node].num_children = static_cast<int>(children.size());
  for (const int child : children) {
    Node added;
    added.middle = middle_of(child);
    added.half = half;
    nodes_.push_back(added);
  }
  for (std::size_t k = 0; k < children.size(); ++k) {
    const std::vector<int>& of_child = inside[static_cast<std::size_t>(children[k])];
    const auto index = static_cast<std::size_t>(nodes_[node].first_child) + k;
    if (of_child.size() < kMinCenters) {
      MakeCell(centers, index, of_child, within);
    } else {
      Divide(centers, index, of_child, depth + 1);
    }
  }
}

void CellTree::MakeCell(const std::vector<Center>& centers, std::size_t node,
                        const std::vector<int>& within, const std::vector<int>& around) {
  Cell cell;
  cell.middle = nodes_[node].middle;
  cell.half = nodes_[node].half;
  cell.centers = within;
  float reach = Hearing(cell.half);
  constexpr float kGrowth = 1.25F;
  const std::size_t wanted = std::min(kMinCenters, around.size());
  while (cell.centers.size() < wanted) {
    reach *= kGrowth;
    cell.centers = Filter(centers, around, cell.middle, reach);
  }
  nodes_[node].cell = static_cast<int>(cells_.size());
  cells_.push_back(std::move(cell));
}

std::vector<float> CellTree::Fit(const std::vector<Center>& centers) {
  std::vector<float> sigma(centers.size(), 0.0F);
  std::vector<double> alphas(cells_.size(), 0.0);
  ParallelFor(static_cast<int>(cells_.size()), 4, [&](int begin, int end) {
    for (auto c = static_cast<std::size_t>(begin); c < static_cast<std::size_t>(end); ++c) {
      Cell& cell = cells_[c];
      cell.fit = LocalFit::Solve(centers, cell.centers, settings_.fit);
      if (cell.fit) {
        alphas[c] = cell.fit->alpha();
        for (std::size_t k = 0; k < cell.centers.size(); ++k) {
          const auto i = static_cast<std::size_t>(cell.centers[k]);
          // The cells tile space, so each centre is written once.
          const bool is_own = IsWithin(centers[i].position, cell.middle, cell.half);
          if (is_own) sigma[i] = cell.fit->sigma()[static_cast<Eigen::Index>(k)];
        }
        cell.fit->ReleaseSigma();
      }
      std::vector<int>().swap(cell.centers);
    }
  });
  for (const double alpha : alphas) max_alpha_ = std::max(max_alpha_, alpha);
  return sigma;
}

std::vector<int> CellTree::Touching(const Eigen::AlignedBox3f& box) const {
  std::vector<int> touching;
  std::vector<int> open;
  if (!nodes_.empty()) open.push_back(0);
  while (!open.empty()) {
    const Node& node = nodes_[static_cast<std::size_t>(open.back())];
    open.pop_back();
    const Eigen::Vector3f reach = Eigen::Vector3f::Constant(Reach(node.half));
    if (!box.intersects(Eigen::AlignedBox3f(node.middle - reach, node.middle + reach))) continue;
    if (node.cell >= 0 && cells_[static_cast<std::size_t>(node.cell)].fit) {
      touching.push_back(node.cell);
    }
    for (int k = 0; k < node.num_children; ++k) open.push_back(node.first_child + k);
  }
  std::sort(touching.begin(), touching.end());
  return touching;
}

std::optional<FitValue> CellTree::At(const Eigen::Vector3f& point,
                                     const std::vector<int>& cells) const {
  float total = 0.0F;
  FitValue mean;
  for (const int c : cells) {
    const Cell& cell = cells_[static_cast<std::size_t>(c)];
    const Eigen::Vector3f t = (point - cell.middle).cwiseAbs() / Reach(cell.half);
    if (!(t.maxCoeff() < 1.0F)) continue;
    const float weight = BlendWeight(t.x()) * BlendWeight(t.y()) * BlendWeight(t.z());
    const FitValue value = cell.fit->At(point);
    total += weight;
    mean.value += weight * value.value;
    // The derivatives of the weights add w' (f_k - f), which vanishes where the cells agree.
    mean.gradient += weight * value.gradient;
  }
  if (!(total > 0.0F)) return std::nullopt;
  mean.value /= total;
  mean.gradient /= total;
  return mean;
}

std::size_t CellTree::MemoryBytes() const {
  std::size_t bytes = nodes_.capacity() * sizeof(Node) + cells_.capacity() * sizeof(Cell);
  for (const Cell& cell : cells_) {
    if (cell.fit) bytes += cell.fit->MemoryBytes();
  }
  return bytes;
}

}  // namespace fringe_fusion::internal
