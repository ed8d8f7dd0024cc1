#include "harmonic_fill.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr float kNoBound = -std::numeric_limits<float>::infinity();

// Half the nodes along each axis. A coarse node is fixed where some of its eight are, to their
// mean; else it is bounded by the mean bound of its nodes, where all have one.
FillProblem Coarsen(const FillProblem& fine) {
  FillProblem coarse;
  coarse.grid = fine.grid;
  coarse.grid.step *= 2.0;
  for (std::size_t a = 0; a < 3; ++a) coarse.grid.size[a] = (fine.grid.size[a] + 1) / 2;
  const std::size_t count = coarse.grid.count();
  coarse.value.assign(count, 0.0F);
  coarse.fixed.assign(count, 0);
  coarse.lower.assign(count, kNoBound);
  ParallelFor(coarse.grid.size[2], 2, [&](int begin, int end) {
    for (int z = begin; z < end; ++z) {
      for (int y = 0; y < coarse.grid.size[1]; ++y) {
        for (int x = 0; x < coarse.grid.size[0]; ++x) {
          float sum = 0.0F;
          int num_fixed = 0;
          float bound = std::numeric_limits<float>::infinity();
          for (int c = 0; c < 8; ++c) {
            const int fx = std::min(2 * x + (c & 1), fine.grid.size[0] - 1);
            const int fy = std::min(2 * y + ((c >> 1) & 1), fine.grid.size[1] - 1);
            const int fz = std::min(2 * z + (c >> 2), fine.grid.size[2] - 1);
            const std::size_t f = fine.grid.Index(fx, fy, fz);
            if (fine.fixed[f] != 0) {
              sum += fine.value[f];
              ++num_fixed;
            } else {
              bound = std::min(bound, fine.lower[f]);
            }
          }
          const std::size_t i = coarse.grid.Index(x, y, z);
          if (num_fixed > 0) {
            coarse.fixed[i] = 1;
            coarse.value[i] = sum / static_cast<float>(num_fixed);
          } else {
            coarse.lower[i] = bound;
          }
        }
      }
    }
  });
  return coarse;
}

// Mean of the six neighbours, mirrored at the border.
float Neighbors(const SpaceGrid& grid, const std::vector<float>& u, int x, int y, int z) {
  const auto mirrored = [](int i, int size) {
    if (size == 1) return 0;
    return i < 0 ? 1 : (i >= size ? size - 2 : i);
  };
  const auto at = [&](int dx, int dy, int dz) {
    return u[grid.Index(mirrored(x + dx, grid.size[0]), mirrored(y + dy, grid.size[1]),
                        mirrored(z + dz, grid.size[2]))];
  };
  return (at(-1, 0, 0) + at(1, 0, 0) + at(0, -1, 0) + at(0, 1, 0) + at(0, 0, -1) + at(0, 0, 1)) /
         6.0F;
}

void Relax(const FillProblem& problem, int sweeps, std::vector<float>& u) {
  constexpr float kOverRelaxation = 1.7F;
  const SpaceGrid& grid = problem.grid;
  for (int half_sweep = 0; half_sweep < 2 * sweeps; ++half_sweep) {
    const int color = half_sweep & 1;
    // Nodes of one colour read the other one only, so their order does not matter.
    ParallelFor(grid.size[2], 4, [&](int begin, int end) {
      for (int z = begin; z < end; ++z) {
        for (int y = 0; y < grid.size[1]; ++y) {
          for (int x = (y + z + color) & 1; x < grid.size[0]; x += 2) {
            const std::size_t i = grid.Index(x, y, z);
            if (problem.fixed[i] != 0) continue;
            const float mean = Neighbors(grid, u, x, y, z);
            u[i] = std::max(problem.lower[i], u[i] + kOverRelaxation * (mean - u[i]));
          }
        }
      }
    });
  }
}

std::vector<float> Prolong(const FillProblem& fine, const SpaceGrid& from,
                           const std::vector<float>& coarse) {
  std::vector<float> u(fine.grid.count());
  ParallelFor(fine.grid.size[2], 4, [&](int begin, int end) {
    for (int z = begin; z < end; ++z) {
      for (int y = 0; y < fine.grid.size[1]; ++y) {
        for (int x = 0; x < fine.grid.size[0]; ++x) {
          const std::size_t i = fine.grid.Index(x, y, z);
          const float start = coarse[from.Index(x / 2, y / 2, z / 2)];
          u[i] = fine.fixed[i] != 0 ? fine.value[i] : std::max(fine.lower[i], start);
        }
      }
    }
  });
  return u;
}

}  // namespace

std::vector<float> SolveHarmonic(const FillProblem& problem, int sweeps) {
  constexpr int kCoarsest = 8;
  std::vector<FillProblem> levels;
  levels.reserve(32);  // the references below stay valid
  const FillProblem* finest = &problem;
  while (*std::max_element(finest->grid.size.begin(), finest->grid.size.end()) > kCoarsest) {
    levels.push_back(Coarsen(*finest));
    finest = &levels.back();
  }
  const FillProblem& coarsest = levels.empty() ? problem : levels.back();
  std::vector<float> u(coarsest.grid.count());
  for (std::size_t i = 0; i < u.size(); ++i) {
    u[i] = coarsest.fixed[i] != 0 ? coarsest.value[i] : std::max(coarsest.lower[i], 0.0F);
  }
  Relax(coarsest, 4 * sweeps, u);
  for (std::size_t level = levels.size(); level-- > 0;) {
    const FillProblem& fine = level == 0 ? problem : levels[level - 1];
    u = Prolong(fine, levels[level].grid, u);
    Relax(fine, sweeps, u);
  }
  return u;
}

}  // namespace fringe_fusion::internal
