#include "assign_lattice.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "common/constants.hpp"
#include "common/dense.hpp"
#include "fringe_fusion/calibration/target_print.hpp"

namespace fringe_fusion::internal {
namespace {

/// One way to lay the target over the lattice: place in the target = turn * place + shift.
struct Laying {
  Eigen::Matrix2i turn = Eigen::Matrix2i::Identity();
  Eigen::Vector2i shift = Eigen::Vector2i::Zero();
  int num_hits = 0;
  int num_strays = 0;
  double score = -std::numeric_limits<double>::infinity();
};

/// The points of a target as places of one lattice with integer base.
class NominalLattice {
 public:
  explicit NominalLattice(const CalibrationTarget& target) {
    for (int row = 0; row < target.num_rows; ++row) {
      for (int column = 0; column < target.num_columns; ++column) {
        places_.push_back(Place(target, column, row));
      }
    }
    min_ = max_ = places_.front();
    for (const Eigen::Vector2i& place : places_) {
      min_ = min_.cwiseMin(place);
      max_ = max_.cwiseMax(place);
    }
    width_ = max_.x() - min_.x() + 1;
    points_.assign(static_cast<std::size_t>(width_ * (max_.y() - min_.y() + 1)), -1);
    for (std::size_t i = 0; i < places_.size(); ++i) {
      points_[Index(places_[i])] = static_cast<int>(i);
    }
  }

  /// Point at a place, -1: none.
  [[nodiscard]] int At(const Eigen::Vector2i& place) const {
    if ((place.array() < min_.array()).any() || (place.array() > max_.array()).any()) return -1;
    return points_[Index(place)];
  }
  [[nodiscard]] const Eigen::Vector2i& min() const { return min_; }
  [[nodiscard]] const Eigen::Vector2i& max() const { return max_; }
  [[nodiscard]] int size() const { return static_cast<int>(places_.size()); }

 private:
  static Eigen::Vector2i Place(const CalibrationTarget& target, int column, int row) {
    switch (target.kind) {
      case TargetKind::kAsymmetricCircles: {
        // Diagonal base (1, 1) / 2 and (-1, 1) / 2 of the pitch; twice x is 2 column + row % 2.
        const int twice_x = 2 * column + row % 2;
        return {(twice_x + row) / 2, (row - twice_x) / 2};
      }
      case TargetKind::kShiftedDots:
        // Base (1, 1/m) and (0, 1): where the shift starts anew the lattice is the same.
        return {column, row - column / target.num_shifts};
      default:
        return {column, row};
    }
  }
  [[nodiscard]] std::size_t Index(const Eigen::Vector2i& place) const {
    return static_cast<std::size_t>((place.y() - min_.y()) * width_ + place.x() - min_.x());
  }

  std::vector<Eigen::Vector2i> places_;
  std::vector<int> points_;
  Eigen::Vector2i min_;
  Eigen::Vector2i max_;
  int width_ = 0;
};

/// Every base change with small whole entries.
std::vector<Eigen::Matrix2i> BaseChanges(int determinant) {
  std::vector<Eigen::Matrix2i> changes;
  for (int code = 0; code < 81; ++code) {
    Eigen::Matrix2i m;
    m << code % 3 - 1, code / 3 % 3 - 1, code / 9 % 3 - 1, code / 27 - 1;
    if (m(0, 0) * m(1, 1) - m(0, 1) * m(1, 0) == determinant) changes.push_back(m);
  }
  return changes;
}

class Assigner {
 public:
  Assigner(const Lattice& lattice, const std::vector<Feature>& features,
           const CalibrationTarget& target, const std::vector<FoundMarker>& markers)
      : lattice_(lattice), features_(features), target_(target), nominal_(target) {
    for (std::size_t i = 0; i < lattice.nodes.size(); ++i) {
      const Eigen::Vector2i& place = lattice.nodes[i].place;
      node_at_[{place.x(), place.y()}] = static_cast<int>(i);
    }
    if (!target.marked_points.empty()) FindLarge();
    if (target.kind == TargetKind::kChessboard) FindDarkSectors();
    PlaceMarkers(markers);
  }

  /// All layings of equal, best score.
  [[nodiscard]] std::vector<Laying> Best(int determinant) const {
    std::vector<Laying> best;
    double score = -std::numeric_limits<double>::infinity();
    for (const Eigen::Matrix2i& turn : BaseChanges(determinant)) {
      Eigen::Vector2i low = turn * lattice_.nodes.front().place;
      Eigen::Vector2i high = low;
      for (const LatticeNode& node : lattice_.nodes) {
        low = low.cwiseMin(turn * node.place);
        high = high.cwiseMax(turn * node.place);
      }
      for (int y = nominal_.min().y() - high.y(); y <= nominal_.max().y() - low.y(); ++y) {
        for (int x = nominal_.min().x() - high.x(); x <= nominal_.max().x() - low.x(); ++x) {
          Laying laying{turn, Eigen::Vector2i(x, y)};
          Judge(score, laying);
          if (laying.score < score || laying.num_hits == 0) continue;
          if (laying.score > score) best.clear();
          score = laying.score;
          best.push_back(laying);
        }
      }
    }
    return best;
  }

  [[nodiscard]] Assignment Points(const Laying& laying) const {
    Assignment assignment;
    for (const LatticeNode& node : lattice_.nodes) {
      assignment.points.push_back(nominal_.At(laying.turn * node.place + laying.shift));
    }
    return assignment;
  }

  /// Cosine of the angle between the target's x axis in the picture and the picture's.
  [[nodiscard]] double XAxisCosine(const Laying& laying) const {
    const std::vector<Eigen::Vector3d> points = TargetPoints(target_);
    const Assignment assignment = Points(laying);
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
    for (std::size_t i = 0; i < lattice_.nodes.size(); ++i) {
      if (assignment.points[i] < 0) continue;
      const auto& point = points[static_cast<std::size_t>(assignment.points[i])];
      const Eigen::Vector3d row(point.x(), point.y(), target_.pitch_m);
      normal += row * row.transpose();
      right += row * Pixel(i).transpose();
    }
    const Eigen::Vector2d x_axis = dense::SolveSymmetric(normal, right).row(0).transpose();
    return x_axis.x() / x_axis.norm();
  }

  /// Columns and rows that the lattice covers under a laying, strays included.
  [[nodiscard]] Eigen::Vector2i Extent(const Laying& laying) const {
    // Single strays beside the target do not count as a column.
    std::map<int, int> columns;
    std::map<int, int> rows;
    for (const LatticeNode& node : lattice_.nodes) {
      const Eigen::Vector2i place = laying.turn * node.place + laying.shift;
      Eigen::Vector2i cell = place;
      if (target_.kind == TargetKind::kAsymmetricCircles) {
        const int row = place.x() + place.y();
        cell = Eigen::Vector2i((place.x() - place.y() - (row % 2 + 2) % 2) / 2, row);
      } else if (target_.kind == TargetKind::kShiftedDots) {
        cell.y() +=
            static_cast<int>(std::floor(static_cast<double>(place.x()) / target_.num_shifts));
      }
      ++columns[cell.x()];
      ++rows[cell.y()];
    }
    const auto count = [](const std::map<int, int>& lines) {
      return static_cast<int>(std::count_if(lines.begin(), lines.end(),
                                            [](const auto& line) { return line.second >= 2; }));
    };
    return {count(columns), count(rows)};
  }

  [[nodiscard]] int num_points() const { return nominal_.size(); }
  [[nodiscard]] int num_markers() const { return static_cast<int>(markers_.size()); }

 private:
  [[nodiscard]] const Eigen::Vector2d& Pixel(std::size_t node) const {
    return features_[static_cast<std::size_t>(lattice_.nodes[node].feature)].pixel;
  }
  [[nodiscard]] std::optional<Eigen::Vector2d> PixelAt(const Eigen::Vector2i& place) const {
    const auto node = node_at_.find({place.x(), place.y()});
    if (node == node_at_.end()) return std::nullopt;
    return Pixel(static_cast<std::size_t>(node->second));
  }

  /// Step of the lattice at a node along one axis, from whichever neighbour there is.
  [[nodiscard]] std::optional<Eigen::Vector2d> StepAt(std::size_t node, int axis) const {
    const Eigen::Vector2i& place = lattice_.nodes[node].place;
    const Eigen::Vector2i unit = Eigen::Vector2i::Unit(axis);
    const auto next = PixelAt(place + unit);
    const auto last = PixelAt(place - unit);
    if (next && last) return 0.5 * (*next - *last);
    if (next) return *next - Pixel(node);
    if (last) return Pixel(node) - *last;
    return std::nullopt;
  }

  /// Dots that are large beside the cell of the lattice.
  void FindLarge() {
    std::vector<double> ratios;
    for (std::size_t i = 0; i < lattice_.nodes.size(); ++i) {
      const auto a = StepAt(i, 0);
      const auto b = StepAt(i, 1);
      const double radius =
          features_[static_cast<std::size_t>(lattice_.nodes[i].feature)].radius_px;
      ratios.push_back(a && b ? radius / std::sqrt(std::abs(a->x() * b->y() - a->y() * b->x()))
                              : 0.0);
    }
    std::vector<double> sorted = ratios;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<long>(sorted.size() / 2),
                     sorted.end());
    const double usual = sorted[sorted.size() / 2];
    const double marked = target_.marked_radius_m / target_.dot_radius_m;
    for (const double ratio : ratios) {
      const bool is_beyond = (ratio / usual > std::sqrt(marked)) == (marked > 1.0);
      is_marked_.push_back(is_beyond);
    }
  }

  /// Whether the sector towards -a -b is dark, per node.
  void FindDarkSectors() {
    for (std::size_t i = 0; i < lattice_.nodes.size(); ++i) {
      const Feature& corner = features_[static_cast<std::size_t>(lattice_.nodes[i].feature)];
      const auto a = StepAt(i, 0);
      const auto b = StepAt(i, 1);
      const Eigen::Vector2d middle =
          a && b ? Eigen::Vector2d(a->normalized() + b->normalized()) : Eigen::Vector2d(1.0, 0.0);
      const double angle = std::fmod(std::atan2(middle.y(), middle.x()) + 2.0 * kPi, kPi);
      const bool is_between = angle > corner.edges_rad[0] && angle < corner.edges_rad[1];
      is_dark_before_.push_back(is_between != corner.is_bright_between);
    }
  }

  /// Middle of the markers in units of the lattice.
  void PlaceMarkers(const std::vector<FoundMarker>& markers) {
    for (const FoundMarker& marker : markers) {
      std::size_t nearest = 0;
      for (std::size_t i = 1; i < lattice_.nodes.size(); ++i) {
        if ((Pixel(i) - marker.centre).norm() < (Pixel(nearest) - marker.centre).norm()) {
          nearest = i;
        }
      }
      const auto a = StepAt(nearest, 0);
      const auto b = StepAt(nearest, 1);
      if (!a || !b) continue;
      Eigen::Matrix2d base;
      base << *a, *b;
      const Eigen::Vector2d offset = base.inverse() * (marker.centre - Pixel(nearest));
      if (!(offset.cwiseAbs().maxCoeff() < 1.0)) continue;
      markers_.push_back({marker.id, lattice_.nodes[nearest].place.cast<double>() + offset});
    }
    marker_centres_ = CharucoMarkerCentres(target_);
  }

  /// @param least layings that cannot reach this score need not be judged to the end.
  void Judge(double least, Laying& laying) const {
    const double marker_score = JudgeMarkers(laying);
    int num_mismatches = 0;
    int num_dark = 0;
    int num_left = static_cast<int>(lattice_.nodes.size());
    for (std::size_t i = 0; i < lattice_.nodes.size(); ++i, --num_left) {
      const int point = nominal_.At(laying.turn * lattice_.nodes[i].place + laying.shift);
      if (point < 0) {
        ++laying.num_strays;
        if (marker_score + laying.num_hits + num_left - 2.0 * laying.num_strays < least) return;
        continue;
      }
      ++laying.num_hits;
      if (!is_marked_.empty()) {
        const auto& marks = target_.marked_points;
        const bool is_marked = std::find(marks.begin(), marks.end(), point) != marks.end();
        num_mismatches += is_marked != is_marked_[i] ? 1 : 0;
      }
      if (!is_dark_before_.empty()) num_dark += DarkVote(laying.turn, point, i);
    }
    laying.score = laying.num_hits - 2.0 * laying.num_strays - 10.0 * num_mismatches +
                   (num_dark < 0 ? -0.5 : 0.0) + marker_score;
  }

  /// 1 where the squares about a corner are dark as those of the target, else -1; only where the
  /// target turned by 180 degrees shows the other squares.
  [[nodiscard]] int DarkVote(const Eigen::Matrix2i& turn, int point, std::size_t node) const {
    if ((target_.num_columns + target_.num_rows) % 2 == 0) return 0;
    const int column = point % target_.num_columns;
    const int row = point / target_.num_columns;
    // The sector along +-(a + b) is that along +-(x + y), unless the turn swaps the diagonals.
    const Eigen::Vector2i diagonal = turn * Eigen::Vector2i(1, 1);
    const bool is_same_diagonal = diagonal.x() == diagonal.y();
    const bool is_dark = is_dark_before_[node] == is_same_diagonal;
    return is_dark == ((column + row) % 2 == 0) ? 1 : -1;
  }

  [[nodiscard]] double JudgeMarkers(const Laying& laying) const {
    double score = 0.0;
    for (const auto& [id, place] : markers_) {
      const bool is_known = id < static_cast<int>(marker_centres_.size());
      const Eigen::Vector2d expected =
          is_known
              ? Eigen::Vector2d(marker_centres_[static_cast<std::size_t>(id)] / target_.pitch_m)
              : Eigen::Vector2d::Constant(1e9);
      const Eigen::Vector2d there =
          laying.turn.cast<double>() * place + laying.shift.cast<double>();
      score += (there - expected).cwiseAbs().maxCoeff() < 0.3 ? 20.0 : -20.0;
    }
    return score;
  }

  const Lattice& lattice_;
  const std::vector<Feature>& features_;
  const CalibrationTarget& target_;
  NominalLattice nominal_;
  std::map<std::pair<int, int>, int> node_at_;
  std::vector<bool> is_marked_;
  std::vector<bool> is_dark_before_;
  std::vector<std::pair<int, Eigen::Vector2d>> markers_;
  std::vector<Eigen::Vector2d> marker_centres_;
};

/// Whether the part that is seen may lie anywhere: several layings are as good, and they are not
/// turns of the whole target.
bool IsAfloat(const Assigner& assigner, const std::vector<Laying>& layings,
              const CalibrationTarget& target) {
  if (layings.size() < 2) return false;
  return std::any_of(layings.begin(), layings.end(), [&](const Laying& laying) {
    std::set<int> columns;
    std::set<int> rows;
    for (const int point : assigner.Points(laying).points) {
      if (point < 0) continue;
      columns.insert(point % target.num_columns);
      rows.insert(point / target.num_columns);
    }
    return static_cast<int>(columns.size()) < target.num_columns ||
           static_cast<int>(rows.size()) < target.num_rows;
  });
}

/// Whether the lattice is that of the target with columns and rows swapped.
bool IsSwapped(const Lattice& lattice, const std::vector<Feature>& features,
               const CalibrationTarget& target) {
  CalibrationTarget swapped = target;
  std::swap(swapped.num_columns, swapped.num_rows);
  swapped.num_shifts = std::min(swapped.num_shifts, swapped.num_columns);
  swapped.marked_points.clear();
  const Assigner assigner(lattice, features, swapped, {});
  const std::vector<Laying> best = assigner.Best(1);
  return !best.empty() && best.front().num_strays == 0 &&
         best.front().num_hits == assigner.num_points();
}

bool HasStrays(const Laying& laying) {
  return laying.num_strays > std::max(3, laying.num_hits / 10);
}

Status CheckLaying(const Assigner& assigner, const Laying& best, const CalibrationTarget& target,
                   const DetectConfig& config) {
  if (HasStrays(best)) {
    const Eigen::Vector2i extent = assigner.Extent(best);
    return Fail("the picture shows {} x {} points in columns and rows, the target has {} x {}",
                extent.x(), extent.y(), target.num_columns, target.num_rows);
  }
  if (!(best.num_hits >= config.min_points_ratio * assigner.num_points())) {
    return Fail("only {} of the target's {} points are seen, at least {:.0f} % are needed",
                best.num_hits, assigner.num_points(), 100.0 * config.min_points_ratio);
  }
  return {};
}

}  // namespace

Result<Assignment> AssignLattice(const Lattice& lattice, const std::vector<Feature>& features,
                                 const CalibrationTarget& target,
                                 const std::vector<FoundMarker>& markers,
                                 const DetectConfig& config) {
  const Assigner assigner(lattice, features, target, markers);
  const std::vector<Laying> upright = assigner.Best(1);
  const std::vector<Laying> mirrored = assigner.Best(-1);
  if (upright.empty()) return Fail("the lattice in the picture does not fit the target anywhere");
  if (!mirrored.empty() && mirrored.front().score > upright.front().score + 5.0 &&
      !HasStrays(mirrored.front())) {
    return Fail("the print is mirrored: the points fit the target only seen from behind");
  }
  if (HasStrays(upright.front()) && IsSwapped(lattice, features, target)) {
    return Fail(
        "columns and rows are swapped: the picture shows {} x {} points, the target has {} x {}",
        target.num_rows, target.num_columns, target.num_columns, target.num_rows);
  }
  if (Status status = CheckLaying(assigner, upright.front(), target, config); !status) {
    return tl::unexpected<Error>(status.error());
  }
  if (IsAfloat(assigner, upright, target)) {
    const Eigen::Vector2i extent = assigner.Extent(upright.front());
    return Fail(
        "only {} x {} of {} x {} columns and rows are seen and nothing marks which: show the whole "
        "target, or use ChArUco or marked dots",
        extent.x(), extent.y(), target.num_columns, target.num_rows);
  }
  const auto best =
      std::max_element(upright.begin(), upright.end(), [&](const Laying& a, const Laying& b) {
        return assigner.XAxisCosine(a) < assigner.XAxisCosine(b);
      });
  Assignment assignment = assigner.Points(*best);
  assignment.is_orientation_assumed = upright.size() > 1;
  return assignment;
}

}  // namespace fringe_fusion::internal
