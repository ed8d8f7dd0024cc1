#pragma once

#include <map>
#include <vector>

#include "fringe_fusion/registration/register_views.hpp"

namespace fringe_fusion {

/// Keeps the views of a scan registered while it runs: every new view is placed against those that
/// are there, which stay, in a time that does not grow with their number; Solve moves all of them.
/// Whatever fails leaves the last good state.
class LiveRegistration {
 public:
  /// @param max_neighbors views with the most overlap that a new one is compared with.
  /// @return error when config is out of bounds.
  [[nodiscard]] static Result<LiveRegistration> Create(const RegistrationConfig& config,
                                                       int max_neighbors = 6);

  /// Places one view. @return its pose (the prior, not connected, where it overlaps none); error of
  /// Validate(view), or when its id is known already.
  [[nodiscard]] Result<RegisteredView> Add(const View& view);

  /// Joint solution of all views with ties and device. @return error of RegisterViews; the state is
  /// then as before.
  [[nodiscard]] Result<RegistrationResult> Solve(const std::vector<ViewTie>& ties = {},
                                                 const std::optional<DeviceChain>& chain = {},
                                                 const Progress& progress = NoProgress);

  /// Best known pose of every view, by its id.
  [[nodiscard]] const std::map<int, RegisteredView>& state() const { return state_; }

 private:
  LiveRegistration(const RegistrationConfig& config, int max_neighbors)
      : config_(config), max_neighbors_(max_neighbors) {}
  [[nodiscard]] std::vector<int> NeighborsOf(const ViewSurface& surface, const Transform& T) const;

  RegistrationConfig config_;
  int max_neighbors_ = 6;
  std::vector<View> views_;  ///< with their prior poses
  SurfaceSet set_;           ///< of the views
  std::map<int, RegisteredView> state_;
};

}  // namespace fringe_fusion
