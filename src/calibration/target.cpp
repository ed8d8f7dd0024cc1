#include "fringe_fusion/calibration/target.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "charuco_marker.hpp"
#include "fringe_fusion/calibration/target_print.hpp"

namespace fringe_fusion {
namespace {

constexpr std::array<std::pair<TargetKind, const char*>, 6> kNames = {{
    {TargetKind::kChessboard, "chessboard"},
    {TargetKind::kCharuco, "charuco"},
    {TargetKind::kCircles, "circles"},
    {TargetKind::kAsymmetricCircles, "asymmetric_circles"},
    {TargetKind::kRingDots, "ring_dots"},
    {TargetKind::kShiftedDots, "shifted_dots"},
}};

/// Collects the first value that is out of its bounds.
class Check {
 public:
  explicit Check(const std::string& owner) : owner_(owner) {}

  void Within(const char* name, double value, double low, double high) {
    // Negated so that NaN fails.
    if (status_ && !(value >= low && value <= high)) {
      status_ = Fail("{}: {} = {} is outside [{}, {}]", owner_, name, value, low, high);
    }
  }
  /// Larger than `low` and less than `high`.
  void Between(const char* name, double value, double low, double high) {
    if (status_ && !(value > low && value < high)) {
      status_ = Fail("{}: {} = {} must lie between {} and {}", owner_, name, value, low, high);
    }
  }
  /// A value that the kind has no use for.
  void Unused(const char* name, double value, double neutral, TargetKind kind) {
    if (status_ && !(value == neutral)) {
      status_ = Fail("{}: {} = {} means nothing for a target of kind {}, leave it out", owner_,
                     name, value, TargetKindName(kind));
    }
  }
  template <typename... Args>
  void Require(bool holds, fmt::format_string<Args...> format, Args&&... args) {
    if (status_ && !holds) {
      status_ = Fail("{}: {}", owner_, fmt::format(format, std::forward<Args>(args)...));
    }
  }
  [[nodiscard]] const Status& status() const { return status_; }

 private:
  std::string owner_;
  Status status_;
};

/// Least distance of two points [m].
double LeastDistance(const CalibrationTarget& target) {
  return target.kind == TargetKind::kAsymmetricCircles ? target.pitch_m / std::sqrt(2.0)
                                                       : target.pitch_m;
}

void CheckMarks(const CalibrationTarget& t, Check& check) {
  if (t.marked_points.empty()) {
    check.Unused("marked_radius_m", t.marked_radius_m, 0.0, t.kind);
    return;
  }
  check.Between("marked_radius_m", t.marked_radius_m, 0.0, 0.7 * LeastDistance(t));
  // Blur and perspective change the size of a dot by less.
  check.Require(std::abs(std::log(t.marked_radius_m / t.dot_radius_m)) >= std::log(1.15),
                "marked_radius_m = {} must differ from dot_radius_m = {} by 15 %",
                t.marked_radius_m, t.dot_radius_m);
  std::set<int> seen;
  for (const int point : t.marked_points) {
    check.Require(point >= 0 && point < t.num_columns * t.num_rows,
                  "marked_points has {}, the points are 0 to {}", point,
                  t.num_columns * t.num_rows - 1);
    check.Require(seen.insert(point).second, "marked_points has {} twice", point);
  }
}

void CheckDots(const CalibrationTarget& t, Check& check) {
  check.Between("dot_radius_m", t.dot_radius_m, 0.0, 0.5 * LeastDistance(t));
  if (t.kind == TargetKind::kRingDots) {
    check.Between("ring_radius_m", t.ring_radius_m, t.dot_radius_m, 0.5 * t.pitch_m);
    check.Require(!t.light_on_dark, "light_on_dark: ring dots are dark in a white ring");
  } else {
    check.Unused("ring_radius_m", t.ring_radius_m, 0.0, t.kind);
  }
  CheckMarks(t, check);
}

void CheckCorners(const CalibrationTarget& t, Check& check) {
  check.Unused("dot_radius_m", t.dot_radius_m, 0.0, t.kind);
  check.Unused("ring_radius_m", t.ring_radius_m, 0.0, t.kind);
  check.Unused("light_on_dark", t.light_on_dark ? 1.0 : 0.0, 0.0, t.kind);
  check.Require(t.marked_points.empty(), "marked_points: a target of kind {} has no dots to mark",
                TargetKindName(t.kind));
}

void CheckMarkers(const CalibrationTarget& t, Check& check) {
  if (!check.status()) return;
  const auto needed = static_cast<int>(CharucoMarkerCentres(t).size());
  const int available = internal::NumMarkers(t.dictionary);
  check.Require(needed <= available, "dictionary = {} has {} markers, {} x {} corners need {}",
                t.dictionary, available, t.num_columns, t.num_rows, needed);
}

}  // namespace

const char* TargetKindName(TargetKind kind) {
  for (const auto& [known, name] : kNames) {
    if (known == kind) return name;
  }
  return "unknown";
}

Result<TargetKind> TargetKindFromName(const std::string& name) {
  std::vector<std::string> names;
  for (const auto& [kind, known] : kNames) {
    if (name == known) return kind;
    names.emplace_back(known);
  }
  return Fail("kind '{}' must be one of {}", name, fmt::join(names, ", "));
}

bool HasDots(TargetKind kind) {
  return kind != TargetKind::kChessboard && kind != TargetKind::kCharuco;
}

double DotRadius(const CalibrationTarget& target, int point) {
  const auto& marks = target.marked_points;
  const bool is_marked = std::find(marks.begin(), marks.end(), point) != marks.end();
  return is_marked ? target.marked_radius_m : target.dot_radius_m;
}

std::vector<Eigen::Vector3d> TargetPoints(const CalibrationTarget& target) {
  std::vector<Eigen::Vector3d> points;
  for (int row = 0; row < target.num_rows; ++row) {
    for (int column = 0; column < target.num_columns; ++column) {
      Eigen::Vector3d point(column, row, 0.0);
      if (target.kind == TargetKind::kAsymmetricCircles) {
        point = Eigen::Vector3d(column + 0.5 * (row % 2), 0.5 * row, 0.0);
      } else if (target.kind == TargetKind::kShiftedDots) {
        point.y() += static_cast<double>(column % target.num_shifts) / target.num_shifts;
      }
      points.emplace_back(target.pitch_m * point);
    }
  }
  return points;
}

Status Validate(const CalibrationTarget& target, const std::string& owner) {
  Check check(owner);
  check.Within("columns", target.num_columns, 2, 1000);
  check.Within("rows", target.num_rows, 2, 1000);
  check.Within("pitch_m", target.pitch_m, 1e-6, 10.0);
  check.Within("sigma_print_m", target.sigma_print_m, 0.0, 0.1 * target.pitch_m);
  check.Within("print_ratio", target.print_ratio, 0.0, 0.9);
  if (HasDots(target.kind)) {
    CheckDots(target, check);
  } else {
    CheckCorners(target, check);
  }
  if (target.kind == TargetKind::kCharuco) {
    check.Between("marker_m", target.marker_m, 0.0, target.pitch_m);
    check.Within("dictionary", target.dictionary, 0, 20);
    CheckMarkers(target, check);
  } else {
    check.Unused("marker_m", target.marker_m, 0.0, target.kind);
    check.Unused("dictionary", target.dictionary, 0, target.kind);
  }
  if (target.kind == TargetKind::kShiftedDots) {
    check.Within("num_shifts", target.num_shifts, 2, target.num_columns);
  } else {
    check.Unused("num_shifts", target.num_shifts, 1, target.kind);
  }
  return check.status();
}

}  // namespace fringe_fusion
