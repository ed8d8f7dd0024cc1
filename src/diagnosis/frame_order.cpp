#include "frame_order.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

namespace fringe_fusion::diagnosis {
namespace {

constexpr std::size_t kMinMatchPixels = 100;
constexpr std::size_t kSearchPixels = 150;  // for which all hypotheses are tried
constexpr std::size_t kMatchPixels = 1500;  // that compare frames with patterns
constexpr double kGridPerFringe = 20.0;
constexpr int kMaxGrid = 2048;
// A frame of another pattern misses by .3 to .5 of the light in the mean.
constexpr float kLossLimit = 0.35F;
// A frame shows another pattern when that one fits so much better.
constexpr double kMaxRatio = 0.6;
constexpr double kMinGain = 0.04;
constexpr std::array<int, 6> kLags{1, -1, 2, -2, 3, -3};
// Power laws of the response that are tried: a wrong one moves light by a third.
constexpr std::array<double, 4> kGammas{1.0, 1.5, 2.2, 0.6};
// Frames that miss their pattern by more, and by so many times the median, are in doubt.
constexpr double kDoubtful = 0.1;
// The hypothesis of a right order and response misses by so much per frame at most.
constexpr double kGoodCost = 0.07;
// Fringes that swing by less than .6 of black to white are lost to defocus: what their frames show
// cannot be told.
constexpr double kMinSwing = 0.19;
constexpr double kDoubtfulRatio = 2.5;

enum class Varies { kNot, kAlongU, kAlongV };

// Light of a pattern along the grid of its axis, 0..1; a single value where it does not vary.
struct Profile {
  Varies varies = Varies::kNot;
  std::vector<float> light;
};

Varies AlongAxis(const Pattern& pattern) {
  if (pattern.kind == PatternKind::kWhite || pattern.kind == PatternKind::kBlack) {
    return Varies::kNot;
  }
  return pattern.axis == Axis::kU ? Varies::kAlongU : Varies::kAlongV;
}

int GridSize(const PatternSequence& sequence, Axis axis) {
  const int size_px = axis == Axis::kU ? sequence.width : sequence.height;
  double grid = 1.0;
  for (const Pattern& pattern : sequence.frames) {
    if (pattern.axis != axis || AlongAxis(pattern) == Varies::kNot) continue;
    const bool gray = pattern.kind == PatternKind::kGray;
    grid = std::max(grid, gray ? size_px / pattern.cell_px : kGridPerFringe * pattern.fringes);
  }
  return std::min({static_cast<int>(std::ceil(grid)), size_px, kMaxGrid});
}

Profile MakeProfile(const Pattern& pattern, const PatternSequence& sequence, int grid) {
  Profile profile;
  profile.varies = AlongAxis(pattern);
  if (profile.varies == Varies::kNot) {
    profile.light.assign(1, pattern.kind == PatternKind::kWhite ? 1.0F : 0.0F);
    return profile;
  }
  const bool along_u = pattern.axis == Axis::kU;
  const int size_px = along_u ? sequence.width : sequence.height;
  const Image<std::uint8_t> line =
      RenderPattern(pattern, along_u ? size_px : 1, along_u ? 1 : size_px, 1.0);
  for (int g = 0; g < grid; ++g) {
    const auto at = static_cast<std::size_t>((g + 0.5) * size_px / grid);
    profile.light.push_back(static_cast<float>(line[at]) / 255.0F);
  }
  return profile;
}

using Lights = std::vector<float>;    // one per sample
using Assignment = std::vector<int>;  // pattern of each frame, -1: none
using GridCosts = std::vector<float>;
using Distances = std::vector<std::vector<double>>;  // of frame and pattern

// costs[g] += loss of a value against the light at g. Most of the time goes here; written for the
// vectoriser.
void AddLoss(float value, const Lights& light, GridCosts& costs) {
  const std::size_t count = costs.size();
  const float* from = light.data();
  float* to = costs.data();
  for (std::size_t g = 0; g < count; ++g) {
    const float apart = std::abs(value - from[g]);
    to[g] += apart < kLossLimit ? apart : kLossLimit;
  }
}

// Frames and patterns on a common scale of 0 (dark) to 1 (bright).
class Matcher {
 public:
  Matcher(const SampledStack& stack, const PatternSequence& sequence, const LightRange& range)
      : num_frames_(static_cast<int>(stack.frames.size())) {
    const int grid_u = GridSize(sequence, Axis::kU);
    const int grid_v = GridSize(sequence, Axis::kV);
    for (const Pattern& pattern : sequence.frames) {
      profiles_.push_back(
          MakeProfile(pattern, sequence, pattern.axis == Axis::kU ? grid_u : grid_v));
    }
    grid_ = {static_cast<std::size_t>(grid_u), static_cast<std::size_t>(grid_v)};
    size_px_ = {sequence.width, sequence.height};
    linear_ = profiles_;
    SelectPixels(stack, range);
    FindVisible(sequence);
  }

  // Patterns send light^gamma from here on.
  void SetGamma(double gamma) {
    for (std::size_t j = 0; j < profiles_.size(); ++j) {
      for (std::size_t g = 0; g < profiles_[j].light.size(); ++g) {
        const auto linear = static_cast<double>(linear_[j].light[g]);
        profiles_[j].light[g] = static_cast<float>(std::pow(linear, gamma));
      }
    }
  }

  // Whether the fringes of a pattern's own set can be seen in the frames planned for it.
  [[nodiscard]] const std::vector<bool>& visible() const { return visible_; }

  [[nodiscard]] std::size_t num_pixels() const { return pixels_.size(); }
  [[nodiscard]] const std::vector<std::size_t>& pixels() const { return pixels_; }
  [[nodiscard]] int num_patterns() const { return static_cast<int>(profiles_.size()); }
  [[nodiscard]] int num_frames() const { return num_frames_; }

  // Hypothesis: frame i shows pattern i - before, from frame `turn` on pattern i - after.
  [[nodiscard]] Assignment Lagged(int before, int after, int turn) const {
    const int count = num_patterns();
    Assignment shown(static_cast<std::size_t>(num_frames_), -1);
    for (int i = 0; i < num_frames_; ++i) {
      const int lag = i < turn ? before : after;
      int pattern = i - lag;
      // Cameras that run free see the sequence go round; one that turns does not.
      if (before == after) pattern = (pattern % count + count) % count;
      if (pattern >= 0 && pattern < count) shown[static_cast<std::size_t>(i)] = pattern;
    }
    return shown;
  }

  // Mean distance per frame when every pixel has its best coordinates.
  [[nodiscard]] double Cost(const Assignment& shown) const {
    double sum = 0.0;
    const std::size_t step = std::max<std::size_t>(1, pixels_.size() / kSearchPixels);
    double count = 0.0;
    for (std::size_t p = 0; p < pixels_.size(); p += step) {
      sum += BestOf(p, shown, Varies::kAlongU).second + BestOf(p, shown, Varies::kAlongV).second +
             Rest(p, shown);
      count += 1.0;
    }
    return sum / (count * num_frames_);
  }

  // Coordinate of every pixel on one axis under an assignment; NaN when no frame codes it [px].
  [[nodiscard]] std::vector<double> Coordinates(const Assignment& shown, Varies axis) const {
    const std::size_t index = axis == Varies::kAlongU ? 0 : 1;
    const bool coded = std::any_of(profiles_.begin(), profiles_.end(),
                                   [&](const Profile& p) { return p.varies == axis; });
    std::vector<double> coordinates(pixels_.size(), std::numeric_limits<double>::quiet_NaN());
    for (std::size_t p = 0; coded && p < pixels_.size(); ++p) {
      const auto at = static_cast<double>(BestOf(p, shown, axis).first);
      coordinates[p] = (at + 0.5) * size_px_[index] / static_cast<double>(grid_[index]) - 0.5;
    }
    return coordinates;
  }

  // Distance of frame i from pattern j at the coordinates of an assignment, mean over the pixels.
  [[nodiscard]] Distances AllDistances(const Assignment& shown) const {
    const auto patterns = static_cast<std::size_t>(num_patterns());
    Distances sum(frames_.size(), std::vector<double>(patterns, 0.0));
    Lights expected(patterns);
    for (std::size_t p = 0; p < pixels_.size(); ++p) {
      const std::size_t u = BestOf(p, shown, Varies::kAlongU).first;
      const std::size_t v = BestOf(p, shown, Varies::kAlongV).first;
      for (std::size_t j = 0; j < patterns; ++j) {
        const Profile& profile = profiles_[j];
        expected[j] = profile.light[profile.varies == Varies::kNot      ? 0
                                    : profile.varies == Varies::kAlongU ? u
                                                                        : v];
      }
      for (std::size_t i = 0; i < frames_.size(); ++i) {
        for (std::size_t j = 0; j < patterns; ++j) {
          const float apart = std::abs(frames_[i][p] - expected[j]);
          sum[i][j] += static_cast<double>(std::min(apart, 1.0F));
        }
      }
    }
    for (auto& row : sum) {
      for (double& value : row) value /= static_cast<double>(pixels_.size());
    }
    return sum;
  }

 private:
  // Mean distance from mid-grey over the frames of a set: .32 for fringes, .5 for Gray code.
  void FindVisible(const PatternSequence& sequence) {
    const auto same_set = [](const Pattern& a, const Pattern& b) {
      return a.kind == b.kind && a.axis == b.axis && a.fringes == b.fringes && a.bit == b.bit;
    };
    visible_.assign(frames_.size(), true);
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      if (profiles_[i].varies == Varies::kNot) continue;
      double sum = 0.0;
      double count = 0.0;
      for (std::size_t k = 0; k < frames_.size(); ++k) {
        if (!same_set(sequence.frames[i], sequence.frames[k])) continue;
        for (const float value : frames_[k]) sum += std::abs(static_cast<double>(value) - 0.5);
        count += static_cast<double>(pixels_.size());
      }
      visible_[i] = sum > kMinSwing * count;
    }
  }

  void SelectPixels(const SampledStack& stack, const LightRange& range) {
    std::vector<std::size_t> lit;
    for (std::size_t i = 0; i < range.lit.size(); ++i) {
      if (range.lit[i] != 0 && range.bright[i] < 0.98F * stack.full_scale_dn) lit.push_back(i);
    }
    const std::size_t step = std::max<std::size_t>(1, lit.size() / kMatchPixels);
    for (std::size_t k = 0; k < lit.size(); k += step) pixels_.push_back(lit[k]);
    for (const Image<float>& frame : stack.frames) {
      Lights values;
      for (const std::size_t i : pixels_) {
        values.push_back((frame[i] - range.dark[i]) / (range.bright[i] - range.dark[i]));
      }
      frames_.push_back(std::move(values));
    }
  }

  // Coordinate on the grid of one axis that agrees best with the frames that code it.
  [[nodiscard]] std::pair<std::size_t, double> BestOf(std::size_t pixel, const Assignment& shown,
                                                      Varies axis) const {
    GridCosts costs(grid_[axis == Varies::kAlongU ? 0 : 1], 0.0F);
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      if (shown[i] < 0) continue;
      const Profile& profile = profiles_[static_cast<std::size_t>(shown[i])];
      if (profile.varies != axis) continue;
      const float value = frames_[i][pixel];
      AddLoss(value, profile.light, costs);
    }
    const auto best = std::min_element(costs.begin(), costs.end());
    return {static_cast<std::size_t>(best - costs.begin()), static_cast<double>(*best)};
  }

  // What white and black frames, and frames of no pattern, add to the distance.
  [[nodiscard]] double Rest(std::size_t pixel, const Assignment& shown) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      if (shown[i] < 0) {
        sum += static_cast<double>(kLossLimit);
        continue;
      }
      const Profile& profile = profiles_[static_cast<std::size_t>(shown[i])];
      if (profile.varies != Varies::kNot) continue;
      sum += static_cast<double>(
          std::min(std::abs(frames_[i][pixel] - profile.light.front()), kLossLimit));
    }
    return sum;
  }

  int num_frames_ = 0;
  std::vector<std::size_t> pixels_;
  std::array<std::size_t, 2> grid_{};
  std::array<int, 2> size_px_{};
  std::vector<Profile> profiles_;  ///< light with the present gamma
  std::vector<Profile> linear_;    ///< with gamma 1
  std::vector<Lights> frames_;
  std::vector<bool> visible_;  ///< per frame
};

struct Hypothesis {
  Assignment shown;
  double cost = std::numeric_limits<double>::infinity();
};

// The lags and turns that explain the frames best at the present gamma.
Hypothesis BestLag(const Matcher& matcher) {
  const int missing = matcher.num_patterns() - matcher.num_frames();
  Hypothesis best;
  const auto consider = [&](Assignment shown) {
    const double cost = matcher.Cost(shown);
    if (cost < best.cost) best = {std::move(shown), cost};
  };
  consider(matcher.Lagged(0, 0, 0));
  for (const int lag : kLags) consider(matcher.Lagged(lag, lag, 0));
  for (int turn = 0; turn < matcher.num_frames(); ++turn) {
    // A frame lost shows later patterns from there on, one shown twice earlier ones.
    for (const int after : {-1, -2, 1}) consider(matcher.Lagged(0, after, turn));
    if (missing > 2) consider(matcher.Lagged(0, -missing, turn));
  }
  return best;
}

// The pattern that fits a frame best, unless its own one does nearly as well.
int ShownIn(const std::vector<double>& distances, int planned) {
  const auto best = std::min_element(distances.begin(), distances.end());
  const double own = distances[static_cast<std::size_t>(planned)];
  const bool other = *best < kMaxRatio * own && own - *best > kMinGain;
  return other ? static_cast<int>(best - distances.begin()) : planned;
}

// Whether every frame that can be judged shows its assumed pattern.
bool IsClear(const Matcher& matcher, const Distances& distances, const Assignment& assumed) {
  for (std::size_t i = 0; i < assumed.size(); ++i) {
    const double own = distances[i][static_cast<std::size_t>(assumed[i])];
    if (matcher.visible()[i] && own > kDoubtful) return false;
  }
  return true;
}

// Frames that fit their assumed pattern badly, of those that can be judged.
std::vector<std::size_t> Doubtful(const Matcher& matcher, const Distances& distances,
                                  const Assignment& assumed) {
  std::vector<double> own;
  for (std::size_t i = 0; i < assumed.size(); ++i) {
    own.push_back(assumed[i] < 0 ? 1.0 : distances[i][static_cast<std::size_t>(assumed[i])]);
  }
  std::vector<double> sorted = own;
  std::sort(sorted.begin(), sorted.end());
  const double limit = std::max(kDoubtful, kDoubtfulRatio * sorted[sorted.size() / 2]);
  std::vector<std::size_t> doubtful;
  for (std::size_t i = 0; i < own.size(); ++i) {
    if (own[i] > limit && matcher.visible()[i]) doubtful.push_back(i);
  }
  return doubtful;
}

// Coordinates without the frames in doubt tell what those show.
void Reassign(const Matcher& matcher, Assignment& assumed, Distances& distances) {
  for (int round = 0; round < 2; ++round) {
    const std::vector<std::size_t> doubtful = Doubtful(matcher, distances, assumed);
    if (doubtful.empty() || 2 * doubtful.size() > assumed.size()) return;
    for (const std::size_t i : doubtful) assumed[i] = -1;
    distances = matcher.AllDistances(assumed);
    for (const std::size_t i : doubtful) {
      const auto best = std::min_element(distances[i].begin(), distances[i].end());
      if (*best < kDoubtful) assumed[i] = static_cast<int>(best - distances[i].begin());
    }
    distances = matcher.AllDistances(assumed);
  }
}

// Sets the gamma and finds the assignment under which the frames agree. Most stacks are in order.
Assignment FindAssignment(Matcher& matcher, Distances& distances) {
  const Assignment planned = matcher.Lagged(0, 0, 0);
  const bool complete = matcher.num_frames() == matcher.num_patterns();
  for (const double gamma : kGammas) {
    if (!complete) break;
    matcher.SetGamma(gamma);
    distances = matcher.AllDistances(planned);
    if (IsClear(matcher, distances, planned)) return planned;
  }
  Hypothesis best;
  double best_gamma = 1.0;
  for (const double gamma : kGammas) {
    matcher.SetGamma(gamma);
    Hypothesis found = BestLag(matcher);
    if (found.cost < best.cost) {
      best = std::move(found);
      best_gamma = gamma;
    }
    if (best.cost < kGoodCost) break;
  }
  matcher.SetGamma(best_gamma);
  distances = matcher.AllDistances(best.shown);
  Reassign(matcher, best.shown, distances);
  return best.shown;
}

}  // namespace

FrameOrder FindFrameOrder(const SampledStack& stack, const PatternSequence& sequence,
                          const LightRange& range) {
  FrameOrder order;
  Matcher matcher(stack, sequence, range);
  if (matcher.num_pixels() < kMinMatchPixels) {
    order.skipped = fmt::format("{} unsaturated lit pixels, needs at least {}",
                                matcher.num_pixels(), kMinMatchPixels);
    return order;
  }
  Distances distances;
  const Assignment assumed = FindAssignment(matcher, distances);
  order.pixels = matcher.pixels();
  order.u_px = matcher.Coordinates(assumed, Varies::kAlongU);
  order.v_px = matcher.Coordinates(assumed, Varies::kAlongV);
  for (std::size_t i = 0; i < distances.size(); ++i) {
    const auto planned = static_cast<int>(i);
    order.shown.push_back(matcher.visible()[i] ? ShownIn(distances[i], planned) : planned);
    order.mismatch.push_back(distances[i][i]);
  }
  return order;
}

}  // namespace fringe_fusion::diagnosis
