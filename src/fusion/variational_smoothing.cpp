#include "variational_smoothing.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "fringe_fusion/common/parallel.hpp"
#include "variational_points.hpp"

namespace fringe_fusion::internal {
namespace {

// A place of the surface: what is left out of the fit there, and how far the fit must reach.
struct SmoothedPlace {
  Eigen::Vector3f middle;
  std::vector<std::uint32_t> left_out;
};

struct Score {
  double sum = 0.0;
  int count = 0;
};

constexpr double kTestHalfInSpacings = 4.5;
constexpr double kReachInWidths = 4.0;
constexpr double kMinReachInSpacings = 6.5;
constexpr double kMaxSquare = 16.0;  // an outlier must not choose the width

std::vector<SmoothedPlace> MakePlaces(const std::vector<MeasuredPoint>& points,
                                      const PointGrid& grid, double spacing_m,
                                      const VariationalConfig& config) {
  std::vector<SmoothedPlace> places;
  const auto count = static_cast<std::size_t>(config.cross_validation_cells);
  for (std::size_t k = 0; k < count; ++k) {
    // Evenly over the points in the order of the grid, hence over the surface.
    const std::uint32_t at = grid.order()[(2 * k + 1) * points.size() / (2 * count)];
    SmoothedPlace place;
    place.middle = points[at].position;
    const auto half = static_cast<float>(kTestHalfInSpacings * spacing_m);
    for (const std::uint32_t i : grid.Within(place.middle, half)) {
      const auto fold =
          static_cast<std::size_t>(i) % static_cast<std::size_t>(config.cross_validation_folds);
      if (fold == k % static_cast<std::size_t>(config.cross_validation_folds)) {
        place.left_out.push_back(i);
      }
    }
    places.push_back(std::move(place));
  }
  return places;
}

Score ScoreAt(const std::vector<MeasuredPoint>& points, const PointGrid& grid,
              const SmoothedPlace& place, double spacing_m, const VariationalConfig& config,
              const FitSettings& settings) {
  const double width = settings.smoothing.width;
  const double reach = std::max(kReachInWidths * width, kMinReachInSpacings * spacing_m);
  std::vector<MeasuredPoint> used;
  std::vector<std::uint32_t> within = grid.Within(place.middle, static_cast<float>(reach));
  std::vector<std::uint32_t> left_out = place.left_out;
  std::sort(within.begin(), within.end());
  std::sort(left_out.begin(), left_out.end());
  for (const std::uint32_t i : within) {
    if (!std::binary_search(left_out.begin(), left_out.end(), i)) used.push_back(points[i]);
  }
  const MergedPoints merged = MergePoints(
      used, PointGrid(used, std::max(config.reduction_ratio * width, 0.05 * spacing_m)));
  constexpr std::size_t kMaxCenters = 600;
  if (merged.centers.size() > kMaxCenters) return {};
  std::vector<int> all(merged.centers.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  const std::optional<LocalFit> fit = LocalFit::Solve(merged.centers, all, settings);
  if (!fit) return {};
  Score score;
  for (const std::uint32_t i : place.left_out) {
    const FitValue value = fit->At(points[i].position);
    const auto distance = static_cast<double>(value.value / value.gradient.norm());
    const double square = std::pow(distance / static_cast<double>(points[i].sigma), 2);
    score.sum += square < kMaxSquare ? square : kMaxSquare;
    ++score.count;
  }
  return score;
}

Score ScoreOf(const std::vector<MeasuredPoint>& points, const PointGrid& grid,
              const std::vector<SmoothedPlace>& places, double spacing_m,
              const VariationalConfig& config, const FitSettings& settings) {
  std::vector<Score> scores(places.size());
  ParallelFor(static_cast<int>(places.size()), 1, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      scores[i] = ScoreAt(points, grid, places[i], spacing_m, config, settings);
    }
  });
  Score total;
  for (const Score& score : scores) {
    total.sum += score.sum;
    total.count += score.count;
  }
  return total;
}

}  // namespace

ChosenWidth ChooseSmoothing(const std::vector<MeasuredPoint>& points, double spacing_m,
                            const VariationalConfig& config, FitSettings settings) {
  constexpr double kFirst = 0.75;
  constexpr int kSteps = 9;
  const PointGrid grid(points, 3.0 * spacing_m);
  const std::vector<SmoothedPlace> places = MakePlaces(points, grid, spacing_m, config);
  ChosenWidth best{kFirst * spacing_m, 0.0};
  int num_worse = 0;
  for (int step = 0; step < kSteps && num_worse < 2; ++step) {
    settings.smoothing.width = kFirst * spacing_m * std::pow(M_SQRT2, step);
    const Score score = ScoreOf(points, grid, places, spacing_m, config, settings);
    if (score.count == 0) continue;
    const double mean = score.sum / score.count;
    if (best.score == 0.0 || mean < best.score) {
      best = {settings.smoothing.width, mean};
      num_worse = 0;
    } else {
      ++num_worse;
    }
  }
  return best;
}

}  // namespace fringe_fusion::internal
