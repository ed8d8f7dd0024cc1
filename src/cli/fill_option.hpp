#pragma once

#include <optional>
#include <string>
#include <vector>

#include "command.hpp"
#include "fringe_fusion/inspection/report.hpp"
#include "fringe_fusion/pose/view.hpp"
#include "fringe_fusion/surface/fill_holes.hpp"

namespace fringe_fusion::cli {

/// Options about holes, of every command that makes a mesh of views.
struct FillOptions {
  bool fill_holes = false;
  bool watertight = false;
  double max_hole_mm = 0.0;

  [[nodiscard]] bool Wanted() const { return fill_holes || watertight; }
};

void DeclareFill(Command& command, FillOptions& options);

/// Settings of the filling, with what the options say; none where it was not asked for.
[[nodiscard]] Result<std::optional<FillConfig>> LoadFillConfig(const FillOptions& options,
                                                               const Session& session);

/// Closes the holes of a field, notes the figures in the session and tells of them.
/// @param field the measured distance. @param views what was measured of the object.
[[nodiscard]] Result<FilledSurface> FillMesh(const FillConfig& config, const VoxelField& field,
                                             const std::vector<View>& views, Session& session);

[[nodiscard]] Report::Table FillTable(const FillFigures& figures);

}  // namespace fringe_fusion::cli
