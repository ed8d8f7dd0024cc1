#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <vector>

#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion {

/// The two colours of a chess board over the pixels. Registration sees only one of them, so that
/// its result can be judged on points that had no part in it.
enum class PixelSet { kRegistration, kHeldOut };

/// A point of a view that registration can use.
struct SurfacePoint {
  Eigen::Vector3f point;   ///< camera frame [m]
  Eigen::Vector3f normal;  ///< unit, towards the camera
  double variance = 0.0;   ///< along the normal [m^2]; NaN where the view states no sigma
  bool border = false;     ///< next to an invalid pixel or a depth step
};

/// One half of the pixels of a view, prepared for neighbour search and even sampling.
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
  [[nodiscard]] const Eigen::Vector3d& centroid() const { return centroid_; }
  /// Root mean square distance of the samples from the centroid [m].
  [[nodiscard]] double radius_m() const { return radius_m_; }

  /// Index of the point nearest to a point of the camera frame, or -1 beyond radius_m.
  [[nodiscard]] int Nearest(const Eigen::Vector3f& point_camera, float radius_m) const;
  /// Whether the sensor of this view could see a surface with this normal there.
  [[nodiscard]] bool FacesSensor(const Eigen::Vector3f& point_camera,
                                 const Eigen::Vector3f& normal_camera) const;

  /// Gives points without a stated sigma this variance.
  void FillUnknownVariance(double variance);

 private:
  struct Index;
  ViewSurface();
  void Measure();

  std::vector<SurfacePoint> points_;
  std::array<std::vector<int>, kNumLevels> samples_;
  LineOfSight line_of_sight_;
  Eigen::Vector3f lower_ = Eigen::Vector3f::Zero();
  Eigen::Vector3f upper_ = Eigen::Vector3f::Zero();
  Eigen::Vector3d centroid_ = Eigen::Vector3d::Zero();
  double spacing_m_ = 0.0;
  double radius_m_ = 0.0;
  int num_inner_ = 0;
  std::unique_ptr<Index> index_;
};

/// The surfaces of all views, with one common sigma for the points that state none.
struct SurfaceSet {
  std::vector<ViewSurface> surfaces;
  /// False: no view states any sigma. Variances are then 1 and only their ratios mean something.
  bool sigma_known = false;
  double max_spacing_m = 0.0;
};

/// Prepares every view. @return error naming the view that has no usable point.
[[nodiscard]] Result<SurfaceSet> MakeSurfaces(const std::vector<View>& views, PixelSet set,
                                              int max_samples);

}  // namespace fringe_fusion
