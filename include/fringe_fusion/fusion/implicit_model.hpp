#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/fusion/voxel_field.hpp"
#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion {

struct FusionConfig {
  double voxel_m = 0.001;
  /// 0: generalised implicit equation with the normal foot, biased by about R^2 / 16 times the mean
  /// curvature; 2: the same sums read as an algebraic sphere, without that bias.
  int order = 2;
  /// Support R of a sample's weight; the width of its Gaussian is R / 2.5. Views whose points are
  /// sparse get a wider one: at least 2.5 times the spacing of their points, at most 16 voxels.
  double kernel_radius_voxels = 3.0;
  /// Octaves of the kernel, 1 to 3: each level doubles the width. At every point the widest kernel
  /// counts that the shape allows, judged by the differences between the levels and their noise.
  int num_levels = 3;
  /// Half window of the plane fits that gave the views' normals; their noise is part of sigma.
  /// 0: the normals are exact.
  int normal_radius_px = 2;
  double border_taper_px = 5.0;     ///< weights fade over this distance to a mask border
  double min_sigma_m = 1e-6;        ///< floor under the stated sigma of a sample
  double min_weight_ratio = 0.002;  ///< of the median weight: below it the surface stays open
  /// A voxel whose samples' weighted centroid lies farther away along the surface extrapolates.
  double max_centroid_offset_voxels = 1.5;
  double max_memory_gb = 4.0;  ///< refuse before, not after, the memory is gone

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("voxel_m", voxel_m, 1e-6, 10.0);
    field("order", order, 0, 2);
    field("kernel_radius_voxels", kernel_radius_voxels, 1.0, 16.0);
    field("num_levels", num_levels, 1, 3);
    field("normal_radius_px", normal_radius_px, 0, 20);
    field("border_taper_px", border_taper_px, 0.0, 100.0);
    field("min_sigma_m", min_sigma_m, 1e-9, 1.0);
    field("min_weight_ratio", min_weight_ratio, 0.0, 1.0);
    field("max_centroid_offset_voxels", max_centroid_offset_voxels, 0.1, 16.0);
    field("max_memory_gb", max_memory_gb, 0.01, 1024.0);
  }
};

namespace internal {
struct ViewSamples;
}

/// The signed distance D(x) of one object by the generalised implicit equation
///   D = sum w_i n_i . (x - p_i) / sum w_i,
/// as additive sums on sparse blocks of 8 x 8 x 8 voxels in the object frame.
///
/// The model keeps the oriented samples of every view, thinned to half a voxel, and the finished
/// field of every block. Adding or removing a view sums the blocks that it touches again, always in
/// the order of the view ids: the order of AddView does not matter, a removed view leaves no trace,
/// and the same views give the same bytes on any number of threads.
/// Surfaces that face away from each other are kept apart down to a thickness of about 1.5 voxels.
/// Reading from several threads is safe while no view is added or removed.
/// Order 2 replaces the plane of the mean normal by the sphere that fits the same samples.
/// Ref: Curless and Levoy, A volumetric method for building complex models from range images, 1996
/// (sums of weighted distances); Guennebaud and Gross, Algebraic Point Set Surfaces, 2007 (order
/// 2).
class ImplicitModel : public VoxelField {
 public:
  /// @return error when config is out of bounds or the order is neither 0 nor 2.
  [[nodiscard]] static Result<ImplicitModel> Create(const FusionConfig& config);

  ImplicitModel(ImplicitModel&&) noexcept;
  ImplicitModel& operator=(ImplicitModel&&) noexcept;
  ~ImplicitModel() override;

  /// Adds one view. @return error when the view is invalid, its id is present already, it was
  /// cancelled, or the memory limit would be passed; the model is then as before.
  [[nodiscard]] Status AddView(const View& view, const Progress& progress = NoProgress);

  /// Adds several views and sums each block once: much faster than one by one, same bytes.
  /// @return as AddView; after an error none of the views is in the model.
  [[nodiscard]] Status AddViews(const std::vector<View>& views,
                                const Progress& progress = NoProgress);

  /// Takes a view out again. @return error when no view has this id.
  [[nodiscard]] Status RemoveView(int view_id);

  [[nodiscard]] std::vector<int> ViewIds() const;
  [[nodiscard]] const FusionConfig& config() const;
  [[nodiscard]] std::size_t MemoryBytes() const;

  /// The field at any point of the object frame (trilinear between voxels).
  [[nodiscard]] FieldSample Query(const Eigen::Vector3d& point_object) const override;

  /// Ids of the views that measured the surface at a point, ascending; empty where Query is not
  /// supported.
  [[nodiscard]] std::vector<int> SupportingViews(const Eigen::Vector3d& point_object) const;

  [[nodiscard]] double voxel_m() const override;
  [[nodiscard]] std::size_t NumBlocks() const override;
  [[nodiscard]] std::vector<BlockIndex> Blocks() const override;
  [[nodiscard]] FieldSample AtVoxel(const std::array<int, 3>& voxel) const override;
  [[nodiscard]] PaddedDistances DistancesOf(const BlockIndex& block) const override;

  struct Impl;
  /// For the other files of the fusion stage.
  [[nodiscard]] const Impl& impl() const;
  [[nodiscard]] static Result<ImplicitModel> FromSamples(const FusionConfig& config,
                                                         std::vector<internal::ViewSamples> views,
                                                         const Progress& progress);

 private:
  explicit ImplicitModel(std::unique_ptr<Impl> impl);
  Status AddSpan(const View* views, std::size_t count, const Progress& progress);
  Status AddSamples(std::map<int, internal::ViewSamples> added, const Progress& progress);
  std::unique_ptr<Impl> impl_;
};

/// Points that stay out of the fusion: outside the box, or on the taught turntable plane or
/// fixture.
struct CropConfig {
  bool crop_box = false;
  std::array<double, 3> box_min_m{{-1.0, -1.0, -1.0}};  ///< in `object`
  std::array<double, 3> box_max_m{{1.0, 1.0, 1.0}};
  bool remove_plane = false;  ///< drop points below the taught plane n . x = d + margin
  std::array<double, 3> plane_normal{{0.0, 0.0, 1.0}};
  double plane_offset_m = 0.0;
  double plane_margin_m = 0.001;
  bool remove_fixture = false;  ///< drop points inside the fixture's box
  std::array<double, 3> fixture_min_m{{0.0, 0.0, 0.0}};
  std::array<double, 3> fixture_max_m{{0.0, 0.0, 0.0}};

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("crop_box", crop_box);
    field("box_min_m", box_min_m, -1000.0, 1000.0);
    field("box_max_m", box_max_m, -1000.0, 1000.0);
    field("remove_plane", remove_plane);
    field("plane_normal", plane_normal, -1.0, 1.0);
    field("plane_offset_m", plane_offset_m, -1000.0, 1000.0);
    field("plane_margin_m", plane_margin_m, 0.0, 1.0);
    field("remove_fixture", remove_fixture);
    field("fixture_min_m", fixture_min_m, -1000.0, 1000.0);
    field("fixture_max_m", fixture_max_m, -1000.0, 1000.0);
  }
};

struct CropResult {
  View view;
  int num_kept = 0;
  int num_outside_box = 0;
  int num_on_plane = 0;
  int num_on_fixture = 0;
};

/// Makes the points of a view that do not belong to the part invalid, and counts them.
/// @return error when the box is inverted or the plane normal is not of unit length.
[[nodiscard]] Result<CropResult> CropView(const View& view, const CropConfig& config);

}  // namespace fringe_fusion
