#include "order_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <type_traits>
#include <utility>
#include <variant>

namespace fringe_fusion::diagnosis {
namespace {

constexpr const char* kRetake =
    "take the scan again; if it recurs, trigger the camera from the projector, or wait longer "
    "between showing a pattern and exposing";
constexpr const char* kBandwidth =
    "take the scan again; if it recurs, lower the frame rate or give the camera's link more "
    "bandwidth (packet size, receive buffers)";
constexpr const char* kStaleFrame =
    "take the scan again; if it recurs, make the camera driver wait for a fresh frame, and the "
    "projector for its next picture";

constexpr std::size_t kMinFrames = 3;  // white and black alone say nothing about an order

// What is wrong with the order, and the frames that tell.
struct Verdict {
  FindingKind kind = FindingKind::kFramesSwapped;
  int num_frames = 0;
  std::string evidence;
};

// Frames whose pixels are all those of the frame before: no sensor with noise does that.
std::vector<std::size_t> RepeatedFrames(const ImageStack& stack) {
  std::vector<std::size_t> repeated;
  for (std::size_t i = 1; i < stack.frames.size(); ++i) {
    const auto same = [&](const auto& pixels) {
      const auto& before = std::get<std::decay_t<decltype(pixels)>>(stack.frames[i - 1].pixels);
      const auto [low, high] = std::minmax_element(pixels.begin(), pixels.end());
      return *low != *high && std::equal(pixels.begin(), pixels.end(), before.begin());
    };
    if (std::visit(same, stack.frames[i].pixels)) repeated.push_back(i);
  }
  return repeated;
}

std::string NameOf(const PatternSequence& sequence, int pattern) {
  return PatternName(sequence.frames[static_cast<std::size_t>(pattern)]);
}

// Most frames, from the first ones on, show the pattern a fixed number of places before or after
// their own.
std::optional<Verdict> FindShift(const FrameOrder& order, int num_patterns) {
  if (order.shown[0] == 0 && order.shown[1] == 1) return std::nullopt;
  for (const int lag : {1, -1, 2, -2, 3, -3}) {
    int count = 0;
    for (std::size_t i = 0; i < order.shown.size(); ++i) {
      const int expected = (static_cast<int>(i) - lag + num_patterns) % num_patterns;
      if (order.shown[i] == expected) ++count;
    }
    if (2 * count > static_cast<int>(order.shown.size())) {
      return Verdict{FindingKind::kFramesShifted, count,
                     fmt::format("{} of {} frames show the pattern {} place{} {} their own", count,
                                 order.shown.size(), std::abs(lag), std::abs(lag) > 1 ? "s" : "",
                                 lag > 0 ? "before" : "after")};
    }
  }
  return std::nullopt;
}

// From some frame on, all that can be told show a later pattern; the last one may show anything.
std::optional<Verdict> FindDrop(const FrameOrder& order, const PatternSequence& sequence) {
  const auto last = static_cast<int>(order.shown.size()) - 1;
  int first = -1;
  int later = 0;
  int other = 0;
  for (int i = 0; i < last; ++i) {
    const int ahead = order.shown[static_cast<std::size_t>(i)] - i;
    if (ahead == 1 || ahead == 2) {
      if (first < 0) first = i;
      ++later;
    } else if (ahead != 0 || first >= 0) {
      ++other;
    }
  }
  if (later < 2 || later <= 2 * other) return std::nullopt;
  return Verdict{FindingKind::kFramesDropped, later,
                 fmt::format("{} frames from frame {} on show a later pattern; lost: {}", later,
                             first, NameOf(sequence, first))};
}

std::optional<Verdict> FindRepeat(const FrameOrder& order, const PatternSequence& sequence) {
  int later = 0;
  int first = -1;
  for (std::size_t i = 1; i < order.shown.size(); ++i) {
    if (order.shown[i] != static_cast<int>(i) - 1) continue;
    if (first < 0) first = static_cast<int>(i);
    ++later;
  }
  const auto before = static_cast<std::size_t>(std::max(first - 1, 0));
  // In a swap of neighbours the frame before shows another pattern too.
  if (first < 0 || order.shown[before] != first - 1) return std::nullopt;
  return Verdict{FindingKind::kFramesDuplicated, later,
                 fmt::format("frame {} shows {} again, like the frame before; {} frame{} late",
                             first, NameOf(sequence, first - 1), later, later > 1 ? "s" : "")};
}

std::optional<Verdict> FindOther(const FrameOrder& order, const PatternSequence& sequence) {
  std::string list;
  int count = 0;
  for (std::size_t i = 0; i < order.shown.size(); ++i) {
    if (order.shown[i] == static_cast<int>(i)) continue;
    if (++count <= 4) {
      list += fmt::format("{}frame {} shows {}", count > 1 ? ", " : "", i,
                          NameOf(sequence, order.shown[i]));
    }
  }
  if (count == 0) return std::nullopt;
  return Verdict{
      FindingKind::kFramesSwapped, count,
      fmt::format("{} frames show another pattern: {}{}", count, list, count > 4 ? ", ..." : "")};
}

std::optional<Verdict> Judge(const FrameOrder& order, const PatternSequence& sequence) {
  const auto num_patterns = static_cast<int>(sequence.frames.size());
  if (auto verdict = FindShift(order, num_patterns)) return verdict;
  if (auto verdict = FindDrop(order, sequence)) return verdict;
  if (auto verdict = FindRepeat(order, sequence)) return verdict;
  return FindOther(order, sequence);
}

const char* AdviceFor(FindingKind kind) {
  if (kind == FindingKind::kFramesDropped) return kBandwidth;
  return kind == FindingKind::kFramesDuplicated ? kStaleFrame : kRetake;
}

const char* QuantityOf(FindingKind kind) {
  if (kind == FindingKind::kFramesDropped) return "frames after a lost one, or missing";
  if (kind == FindingKind::kFramesDuplicated) return "frames that repeat the one before";
  if (kind == FindingKind::kFramesShifted) return "frames late or early by a fixed number";
  return "frames that show another pattern";
}

// Puts down one kind; `verdict` is the only one that the stack got, if any.
void PutDown(FindingKind kind, const std::optional<Verdict>& verdict, const std::string& skipped,
             Findings& findings) {
  const bool mine = verdict && verdict->kind == kind;
  if (!mine && !skipped.empty()) {
    findings.Skip(kind, QuantityOf(kind), skipped);
    return;
  }
  if (findings.Measure(kind, QuantityOf(kind), mine ? verdict->num_frames : 0, 0.0, "frames")) {
    return;
  }
  findings.Explain(fmt::format("{}, limit 0", verdict->evidence), AdviceFor(kind));
}

std::optional<Verdict> CountVerdict(const ImageStack& stack) {
  const std::size_t patterns = stack.sequence.frames.size();
  const std::size_t frames = stack.frames.size();
  if (frames == patterns) return std::nullopt;
  return Verdict{FindingKind::kFramesDropped, static_cast<int>(patterns - frames),
                 fmt::format("{} frames came for {} patterns", frames, patterns)};
}

std::optional<Verdict> RepeatVerdict(const ImageStack& stack) {
  const std::vector<std::size_t> repeated = RepeatedFrames(stack);
  if (repeated.empty()) return std::nullopt;
  return Verdict{
      FindingKind::kFramesDuplicated, static_cast<int>(repeated.size()),
      fmt::format("{} frame{} very pixels of the frame before, first frame {}", repeated.size(),
                  repeated.size() > 1 ? "s have the" : " has the", repeated.front())};
}

}  // namespace

FrameOrder CheckFrames(const ImageStack& whole, const ImageStack& stack,
                       const SampledStack& sampled, const PhaseConfig& phase, bool is_dark,
                       Findings& findings) {
  std::optional<Verdict> verdict = CountVerdict(whole);
  if (!verdict) verdict = RepeatVerdict(whole);
  FrameOrder order;
  if (verdict) {
    order.skipped = "the frames are incomplete";
  } else if (is_dark) {
    order.skipped = "too little light to compare the frames";
  } else if (stack.frames.size() < kMinFrames) {
    order.skipped = "frames with a carrier depend on both coordinates";
  } else {
    order = FindFrameOrder(sampled, stack.sequence, FindLightRange(sampled, phase));
    if (order.skipped.empty()) verdict = Judge(order, stack.sequence);
  }
  for (const FindingKind kind : {FindingKind::kFramesDropped, FindingKind::kFramesDuplicated,
                                 FindingKind::kFramesShifted, FindingKind::kFramesSwapped}) {
    PutDown(kind, verdict, order.skipped, findings);
  }
  return order;
}

}  // namespace fringe_fusion::diagnosis
