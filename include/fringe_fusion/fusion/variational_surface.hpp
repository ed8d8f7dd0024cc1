#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/fusion/voxel_field.hpp"
#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion {

struct VariationalConfig {
  double voxel_m = 0.001;  ///< grid of the extraction
  /// biharmonic (-r), triharmonic (r^3), thin_plate (r^2 log r) or wendland (C2, compact).
  std::string kernel = "triharmonic";
  /// gradient: the slope along the normal is 1 (Hermite; triharmonic and wendland only).
  /// offsets: pairs of points off the surface along the normals.
  std::string constraints = "gradient";
  /// Details narrower than this are damped, where density and noise are at their median; 0: chosen
  /// by cross-validation on the distance f / |grad f| of points left out.
  double smoothing_width_m = 0.0;
  int cross_validation_folds = 5;   ///< of the points of a place, one in so many is left out
  int cross_validation_cells = 60;  ///< places that are tried
  /// Points within this share of the smoothing width become one centre; 0: every point is a centre.
  double reduction_ratio = 1.2;
  int max_cell_centers = 200;  ///< of one dense system
  double overlap = 1.4;        ///< reach of a cell over its edge length
  /// Centres beyond the reach of a cell that take part in its system, in smoothing widths: without
  /// them the ends of a fit, where it is worst, would count.
  double margin_widths = 2.0;
  double slope_sigma = 0.1;   ///< standard deviation of the slope along the normals
  double slope_ratio = 0.34;  ///< share of the centres that carry a slope or a pair
  double border_taper_px = 5.0;
  double min_sigma_m = 1e-6;
  double max_memory_gb = 4.0;

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("voxel_m", voxel_m, 1e-6, 10.0);
    field("kernel", kernel);
    field("constraints", constraints);
    field("smoothing_width_m", smoothing_width_m, 0.0, 100.0);
    field("cross_validation_folds", cross_validation_folds, 2, 20);
    field("cross_validation_cells", cross_validation_cells, 4, 10000);
    field("reduction_ratio", reduction_ratio, 0.0, 2.0);
    field("max_cell_centers", max_cell_centers, 30, 1000);
    field("overlap", overlap, 1.1, 3.0);
    field("margin_widths", margin_widths, 0.0, 10.0);
    field("slope_sigma", slope_sigma, 1e-6, 10.0);
    field("slope_ratio", slope_ratio, 0.05, 1.0);
    field("border_taper_px", border_taper_px, 0.0, 100.0);
    field("min_sigma_m", min_sigma_m, 1e-9, 1.0);
    field("max_memory_gb", max_memory_gb, 0.01, 1024.0);
  }
};

/// A measured point in the object frame.
struct MeasuredPoint {
  Eigen::Vector3f position;  ///< [m]
  Eigen::Vector3f normal;    ///< of a plane fitted to its neighbourhood; any length, outwards
  float sigma = 0.0F;        ///< standard deviation along the normal [m]
  std::uint16_t view = 0;    ///< which view measured it
  Rgb8 color;
};

/// The points of posed views with the noise that range, lateral position, pose and the fade at
/// borders leave along each normal: the weights of the data are anisotropic.
/// @return error naming the view that is invalid.
[[nodiscard]] Result<std::vector<MeasuredPoint>> MeasuredPoints(const std::vector<View>& views,
                                                                const VariationalConfig& config);

/// What a fit did, for reports.
struct VariationalFigures {
  std::size_t num_points = 0;
  std::size_t num_unusable = 0;  ///< not finite, without normal or sigma
  std::size_t num_centers = 0;
  std::size_t num_cells = 0;
  std::size_t memory_bytes = 0;
  double spacing_m = 0.0;          ///< of the points on the surface, median
  double smoothing_width_m = 0.0;  ///< set or chosen
  double alpha = 0.0;              ///< factor of the noise in the systems
  double validation_ratio = 0.0;   ///< mean square of the left-out distances over sigma^2
};

/// An object's surface as the zero set of
///   f(x) = sum lambda_j phi(|x - x_j|) + P(x),
/// smoothed by the points' own noise: [K + alpha diag(sigma^2), P; P^T, 0] [lambda; c] = [d; 0].
/// Small dense systems over the cells of an octree are blended by Wendland weights, so that time
/// and memory grow with the number of points. Cells are independent: the same points give the same
/// bytes on any number of threads.
/// The field is D = f / |grad f|. It is supported near the points alone.
/// Ref: Carr et al., Reconstruction and representation of 3D objects with radial basis functions,
/// 2001; Ohtake et al., Multi-level partition of unity implicits, 2003; Macedo et al., Hermite
/// radial basis functions implicits, 2011.
class VariationalSurface : public VoxelField {
 public:
  /// @return error when config is out of bounds or contradicts itself, fewer than 10 points are
  /// usable, the memory limit would be passed, or on cancel.
  [[nodiscard]] static Result<VariationalSurface> Fit(const std::vector<MeasuredPoint>& points,
                                                      const VariationalConfig& config,
                                                      const Progress& progress = NoProgress);
  VariationalSurface(VariationalSurface&&) noexcept;
  VariationalSurface& operator=(VariationalSurface&&) noexcept;
  ~VariationalSurface() override;

  [[nodiscard]] const VariationalFigures& figures() const;
  [[nodiscard]] double voxel_m() const override;
  [[nodiscard]] std::size_t NumBlocks() const override;
  [[nodiscard]] std::vector<BlockIndex> Blocks() const override;
  [[nodiscard]] FieldSample AtVoxel(const std::array<int, 3>& voxel) const override;
  [[nodiscard]] PaddedDistances DistancesOf(const BlockIndex& block) const override;
  /// The functions themselves, not the voxels. Supported where the nearest voxel is.
  [[nodiscard]] FieldSample Query(const Eigen::Vector3d& point_object) const override;

  struct Impl;

 private:
  explicit VariationalSurface(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// One dense system over all points: the reference that the cells are held against.
class VariationalCloud {
 public:
  /// @param config its smoothing width must be set; the points are not reduced.
  /// @return error as VariationalSurface::Fit, or when there are more than 6000 points.
  [[nodiscard]] static Result<VariationalCloud> Fit(const std::vector<MeasuredPoint>& points,
                                                    const VariationalConfig& config);
  VariationalCloud(VariationalCloud&&) noexcept;
  VariationalCloud& operator=(VariationalCloud&&) noexcept;
  ~VariationalCloud();

  /// D = f / |grad f| at any point [m], NaN where the gradient vanishes.
  [[nodiscard]] double Distance(const Eigen::Vector3d& point) const;
  /// Gradient of f.
  [[nodiscard]] Eigen::Vector3d Gradient(const Eigen::Vector3d& point) const;

 private:
  struct Impl;
  explicit VariationalCloud(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace fringe_fusion
