#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/pose/view.hpp"
#include "fringe_fusion/registration/grid_projection.hpp"

namespace fringe_fusion {

/// All pixels, or one of the two colours of a chess board over them: a registration that sees only
/// one of them can be judged on points that had no part in it.
enum class PixelSet { kAll, kRegistration, kHeldOut };

/// A point of a view that registration can use.
struct SurfacePoint {
  Eigen::Vector3f point;       ///< camera frame [m]
  Eigen::Vector3f normal;      ///< unit, towards the camera
  double variance = 0.0;       ///< along the normal [m^2]; NaN where the view states no sigma
  bool border = false;         ///< next to an invalid pixel or a depth step
  std::uint8_t border_px = 0;  ///< distance from the nearest border point [px], at most 255
};

/// The pixels of a view, or half of them, prepared for neighbour search and even sampling.
class ViewSurface {
 public:
  /// Numbers of samples from coarse to fine: 1/16, 1/4 and all of max_samples.
  static constexpr int kNumLevels = 3;

  /// @param max_samples of the finest level, spread evenly over the image.
  /// @return error when no pixel of the set has a point with a normal and valid neighbours.
  [[nodiscard]] static Result<ViewSurface> Make(const View& view, PixelSet set, int max_samples);

  ViewSurface(ViewSurface&&) noexcept;
  ViewSurface& operator=(ViewSurface&&) noexcept;
  ViewSurface(const ViewSurface&) = delete;
  ViewSurface& operator=(const ViewSurface&) = delete;
  ~ViewSurface();

  [[nodiscard]] const std::vector<SurfacePoint>& points() const { return points_; }
  /// Indices into points() of the samples of a level; never a border point.
  [[nodiscard]] const std::vector<int>& samples(int level) const {
    return samples_[static_cast<std::size_t>(level)];
  }
  /// Number of points that are not on a border.
  [[nodiscard]] int num_inner() const { return num_inner_; }
  /// Median distance between neighbouring points of the set [m].
  [[nodiscard]] double spacing_m() const { return spacing_m_; }
  /// As spacing_m, of the points that Nearest sees at a level [m].
  [[nodiscard]] double target_spacing_m(int level) const {
    return spacing_m_ * 2.0 * margins_[static_cast<std::size_t>(level)] /
           (level + 1 == kNumLevels ? 2.0 : 1.0);
  }
  [[nodiscard]] const Eigen::Vector3d& centroid() const { return centroid_; }
  /// Root mean square distance of the samples from the centroid [m].
  [[nodiscard]] double radius_m() const { return radius_m_; }

  /// Index of the point nearest to a point of the camera frame, or -1 beyond radius_m.
  /// The finest level of an organised view starts at the pixel that the point falls on and climbs
  /// to the nearest of its neighbours: constant time, and exact where the surface is smooth. All
  /// others search a k-d tree; coarser levels see an even part of the points.
  [[nodiscard]] int Nearest(const Eigen::Vector3f& point_camera, float radius_m,
                            int level = kNumLevels - 1) const;
  /// Partners nearer to a border than this are not trusted at a level [px].
  [[nodiscard]] int margin_px(int level) const { return margins_[static_cast<std::size_t>(level)]; }
  /// How far a point lies in front of all that this view measured in its direction, within a pixel
  /// [m]; negative: behind some of it. Nothing where it measured nothing, or is not organised.
  [[nodiscard]] std::optional<float> InFront(const Eigen::Vector3f& point_camera) const;
  [[nodiscard]] bool organised() const { return projection_.has_value(); }
  /// Whether the sensor of this view could see a surface with this normal there.
  [[nodiscard]] bool FacesSensor(const Eigen::Vector3f& point_camera,
                                 const Eigen::Vector3f& normal_camera) const;

  /// Whether any sample came with a stated sigma.
  [[nodiscard]] bool states_sigma() const { return states_sigma_; }
  /// Gives points without a stated sigma this variance.
  void FillUnknownVariance(double variance);

 private:
  struct Index;
  ViewSurface();
  void AddPoints(const View& view, PixelSet set);
  void AddLevels(int width, int max_samples);
  void Measure();
  [[nodiscard]] float StepAt(int i) const;
  [[nodiscard]] int NearestOnGrid(const Eigen::Vector3f& point_camera, float radius_m) const;
  [[nodiscard]] int BestOf(int x, int y, int half, const Eigen::Vector3f& point_camera) const;

  std::vector<SurfacePoint> points_;
  std::array<std::vector<int>, kNumLevels> samples_;
  LineOfSight line_of_sight_;
  Eigen::Vector3f lower_ = Eigen::Vector3f::Zero();
  Eigen::Vector3f upper_ = Eigen::Vector3f::Zero();
  Eigen::Vector3d centroid_ = Eigen::Vector3d::Zero();
  double spacing_m_ = 0.0;
  double radius_m_ = 0.0;
  int num_inner_ = 0;
  bool states_sigma_ = false;
  std::array<int, kNumLevels> margins_ = {1, 1, 1};
  std::optional<GridProjection> projection_;
  Image<int> grid_;          ///< index of the point of a pixel, -1: none
  std::vector<int> pixels_;  ///< y * width + x of every point
  std::array<std::unique_ptr<Index>, kNumLevels> indices_;
};

/// The surfaces of all views, with one common sigma for the points that state none.
struct SurfaceSet {
  std::vector<ViewSurface> surfaces;
  /// False: no view states any sigma. Variances are then 1 and only their ratios mean something.
  bool sigma_known = false;
  double max_spacing_m = 0.0;
};

/// Takes over sigma and spacing from the surfaces and gives points without sigma the common one.
void FinishSurfaces(SurfaceSet& set);

/// Prepares every view. @return error naming the view that has no usable point.
[[nodiscard]] Result<SurfaceSet> MakeSurfaces(const std::vector<View>& views, PixelSet set,
                                              int max_samples);

}  // namespace fringe_fusion
