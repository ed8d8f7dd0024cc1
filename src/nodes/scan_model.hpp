#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/fusion/implicit_model.hpp"
#include "fringe_fusion/fusion/model_file.hpp"
#include "fringe_fusion/planning/occupancy_map.hpp"
#include "fringe_fusion/registration/register_views.hpp"
#include "fringe_fusion/surface/fill_holes.hpp"

namespace fringe_fusion::nodes {

/// The model of one scan and the views it is made of, so that views can be posed anew. Free of ROS.
class ScanModel {
 public:
  struct Configs {
    FusionConfig fusion;
    CropConfig crop;
    OccupancyConfig occupancy;
  };
  /// Points of one view.
  struct Counts {
    int num_points = 0;
    int num_dropped = 0;
  };

  [[nodiscard]] static Result<ScanModel> Create(const Configs& configs);

  /// Forgets all views and poses and takes the views of `scan_id` from now on.
  [[nodiscard]] Status Reset(const std::string& scan_id);
  /// Adds a view, or replaces the one of the same id. Poses solved before for its id prevail.
  /// @return error when the view is refused; the model then lacks it.
  [[nodiscard]] Result<Counts> Integrate(View view);
  /// Goes on from a model that was saved; its views are known by their ids alone.
  void Adopt(SavedModel saved);
  /// Poses all views of `poses` anew, now or when they come.
  /// @return error naming a view that cannot be: refused at its pose, or known by its id alone.
  [[nodiscard]] Status Repose(const std::vector<RegisteredView>& poses, std::uint32_t revision);

  [[nodiscard]] const std::string& scan_id() const { return scan_id_; }
  [[nodiscard]] std::uint32_t revision() const { return revision_; }
  [[nodiscard]] std::vector<int> ViewIds() const { return model_.ViewIds(); }
  /// By view id, at the present poses.
  [[nodiscard]] std::map<int, Counts> ViewCounts() const;
  [[nodiscard]] const ImplicitModel& model() const { return model_; }
  /// The surface with its holes closed where no view saw that space is empty.
  /// @return error of the filling, or when a view is known by its id alone.
  [[nodiscard]] Result<FilledSurface> Fill(const FillConfig& fill,
                                           const SurfaceConfig& surface) const;
  /// Free and occupied space of the views at their present poses.
  [[nodiscard]] Result<OccupancyMap> Occupancy() const;

 private:
  struct Entry {
    View view;
    Counts counts;
  };
  ScanModel(const Configs& configs, ImplicitModel model);
  [[nodiscard]] Status Rebuild(Entry& entry);
  [[nodiscard]] bool Holds(int view_id) const;

  Configs configs_;
  std::string scan_id_;
  std::uint32_t revision_ = 0;
  std::map<int, Entry> entries_;
  std::map<int, Pose> solved_;
  ImplicitModel model_;
};

}  // namespace fringe_fusion::nodes
