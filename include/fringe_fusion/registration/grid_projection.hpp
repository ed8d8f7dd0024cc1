#pragma once

#include <Eigen/Core>
#include <optional>

#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion {

/// On which pixel of an organised view a point falls. Fitted to the points of the view itself, so
/// that no camera model is needed and files of any scanner will do.
class GridProjection {
 public:
  /// Fits column and row as cubic polynomials of the direction of the ray (of the position across
  /// the line of sight, if that is directional).
  /// @return nothing when the points do not lie on the rays of a grid: fewer than 8 rows or
  /// columns, fewer than 200 points, or one point in twenty off by more than a pixel.
  [[nodiscard]] static std::optional<GridProjection> Fit(const RangeImage& range);

  /// @return (column, row) [px]; nothing behind the sensor or far outside of what was fitted.
  [[nodiscard]] std::optional<Eigen::Vector2f> Project(const Eigen::Vector3f& point_camera) const;

 private:
  static constexpr int kNumTerms = 10;
  using Terms = Eigen::Matrix<float, kNumTerms, 1>;
  [[nodiscard]] std::optional<Eigen::Vector2f> Across(const Eigen::Vector3f& point_camera) const;
  [[nodiscard]] static Terms TermsOf(const Eigen::Vector2f& across);
  void SetFrame(const RangeImage& range);

  bool directional_ = false;
  Eigen::Vector3f camera_ = Eigen::Vector3f::Zero();
  Eigen::Matrix3f axes_ = Eigen::Matrix3f::Identity();  ///< rows: two across, one along the rays
  Eigen::Vector2f middle_ = Eigen::Vector2f::Zero();
  float scale_ = 1.0F;
  Eigen::Matrix<float, 2, kNumTerms> coefficients_;
};

}  // namespace fringe_fusion
