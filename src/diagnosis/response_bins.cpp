#include "response_bins.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "common/constants.hpp"

namespace fringe_fusion::diagnosis {
namespace {

struct Knot {
  double x = 0.0;
  double y = 0.0;
  double weight = 0.0;
};

// Pool adjacent violators: the rising sequence nearest in weighted least squares.
void MakeRising(std::vector<Knot>& knots) {
  struct Block {
    double mean = 0.0;
    double weight = 0.0;
    std::size_t count = 0;
  };
  std::vector<Block> blocks;
  for (const Knot& knot : knots) {
    blocks.push_back({knot.y, knot.weight, 1});
    while (blocks.size() > 1 && blocks[blocks.size() - 2].mean > blocks.back().mean) {
      const Block last = blocks.back();
      blocks.pop_back();
      Block& into = blocks.back();
      into.mean = (into.mean * into.weight + last.mean * last.weight) / (into.weight + last.weight);
      into.weight += last.weight;
      into.count += last.count;
    }
  }
  std::size_t k = 0;
  for (const Block& block : blocks) {
    for (std::size_t i = 0; i < block.count; ++i) knots[k++].y = block.mean;
  }
}

// Slopes of a cubic through rising knots that stays rising.
std::vector<double> MonotoneSlopes(const std::vector<Knot>& knots) {
  const std::size_t count = knots.size();
  std::vector<double> secant(count - 1);
  for (std::size_t i = 0; i + 1 < count; ++i) {
    secant[i] = (knots[i + 1].y - knots[i].y) / (knots[i + 1].x - knots[i].x);
  }
  std::vector<double> slope(count);
  slope.front() = secant.front();
  slope.back() = secant.back();
  for (std::size_t i = 1; i + 1 < count; ++i) {
    const double left = knots[i].x - knots[i - 1].x;
    const double right = knots[i + 1].x - knots[i].x;
    slope[i] = (right * secant[i - 1] + left * secant[i]) / (left + right);
  }
  for (std::size_t i = 0; i + 1 < count; ++i) {
    const double limit = 3.0 * secant[i];
    slope[i] = std::clamp(slope[i], 0.0, limit);
    slope[i + 1] = std::clamp(slope[i + 1], 0.0, limit);
  }
  return slope;
}

double Interpolate(const std::vector<Knot>& knots, const std::vector<double>& slope, double x) {
  std::size_t i = 0;
  while (i + 2 < knots.size() && knots[i + 1].x < x) ++i;
  const double width = knots[i + 1].x - knots[i].x;
  const double t = std::clamp((x - knots[i].x) / width, 0.0, 1.0);
  const double s = 1.0 - t;
  return s * s * (1.0 + 2.0 * t) * knots[i].y + t * t * (3.0 - 2.0 * t) * knots[i + 1].y +
         s * s * t * width * slope[i] - s * t * t * width * slope[i + 1];
}

// Black and span of each pixel; span 0 where the projector does not reach or the sensor saturates.
struct Span {
  Image<float> black;
  Image<float> span;
};

Span FindSpan(const SampledStack& stack, const SequencePlan& plan) {
  Span found{MeanOfFrames(stack, plan.black_frames), MeanOfFrames(stack, plan.white_frames)};
  const float limit = kSaturationRatio * stack.full_scale_dn;
  float brightest = 0.0F;
  for (std::size_t i = 0; i < stack.size(); ++i) {
    const bool saturated = !(found.span[i] < limit);
    found.span[i] = saturated ? 0.0F : found.span[i] - found.black[i];
    brightest = std::max(brightest, found.span[i]);
  }
  for (float& span : found.span) {
    if (!(span > 0.25F * brightest)) span = 0.0F;
  }
  return found;
}

}  // namespace

void ResponseBins::Add(double light, double signal_dn, double span_dn) {
  if (!(span_dn > 0.0) || !std::isfinite(light)) return;
  const auto bin = static_cast<std::size_t>(std::lround(255.0 * std::clamp(light, 0.0, 1.0)));
  signal_[bin] += span_dn * signal_dn;
  weight_[bin] += span_dn * span_dn;
}

void ResponseBins::Add(const ResponseBins& other) {
  for (std::size_t i = 0; i < weight_.size(); ++i) {
    signal_[i] += other.signal_[i];
    weight_[i] += other.weight_[i];
  }
}

bool ResponseBins::empty() const {
  return std::all_of(weight_.begin(), weight_.end(), [](double weight) { return weight == 0.0; });
}

Result<ResponseCurve> ResponseBins::Curve() const {
  std::vector<Knot> knots;
  for (std::size_t i = 0; i < weight_.size(); ++i) {
    if (weight_[i] > 0.0) {
      knots.push_back({static_cast<double>(i), signal_[i] / weight_[i], weight_[i]});
    }
  }
  if (knots.size() < 3) {
    return Fail("response: {} of 256 values were seen between black and white, needs at least 3",
                knots.size());
  }
  MakeRising(knots);
  const std::vector<double> slope = MonotoneSlopes(knots);
  ResponseCurve response;
  for (std::size_t i = 0; i < 256; ++i) {
    response.light[i] = Interpolate(knots, slope, static_cast<double>(i));
  }
  const double low = response.light.front();
  const double span = response.light.back() - low;
  if (!(span > 0.1)) return Fail("response: white is no brighter than black ({:.3f})", span);
  for (double& light : response.light) light = (light - low) / span;
  return response;
}

std::size_t PartOf(const SampledStack& stack, std::size_t sample) {
  const auto width = static_cast<std::size_t>(stack.width());
  const auto height = static_cast<std::size_t>(stack.height());
  const std::size_t column = sample % width * kPartsPerSide / width;
  const std::size_t row = sample / width * kPartsPerSide / height;
  return row * kPartsPerSide + column;
}

BinsOfParts CollectResponse(const SampledStack& stack, const SequencePlan& plan) {
  BinsOfParts bins{};
  if (plan.black_frames.empty() || plan.white_frames.empty()) return bins;
  const Span span = FindSpan(stack, plan);
  std::vector<StepFit> fits;
  for (const StepSet& set : plan.sets) fits.push_back(FitSteps(stack, set));
  const Image<float> u = FineCoordinate(plan, fits, Axis::kU);
  const Image<float> v = FineCoordinate(plan, fits, Axis::kV);
  for (std::size_t s = 0; s < plan.sets.size(); ++s) {
    const StepSet& set = plan.sets[s];
    if (IsFinest(plan, s) && !IsCoarsest(plan, s)) continue;
    const Image<float>& coordinate = set.axis == Axis::kU ? u : v;
    const bool own = IsFinest(plan, s) || coordinate.empty();
    const Image<float> phase = own ? fits[s].phase_rad : PhaseAt(set, coordinate);
    const auto steps = static_cast<double>(set.frame_of_step.size());
    for (std::size_t n = 0; n < set.frame_of_step.size(); ++n) {
      const Image<float>& frame = stack.frames[static_cast<std::size_t>(set.frame_of_step[n])];
      const double delta = kTwoPi * static_cast<double>(n) / steps;
      for (std::size_t i = 0; i < stack.size(); ++i) {
        bins[PartOf(stack, i)].Add(0.5 + 0.5 * std::cos(static_cast<double>(phase[i]) - delta),
                                   static_cast<double>(frame[i] - span.black[i]),
                                   static_cast<double>(span.span[i]));
      }
    }
  }
  return bins;
}

}  // namespace fringe_fusion::diagnosis
