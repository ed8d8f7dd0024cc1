#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "command.hpp"
#include "fringe_fusion/diagnosis/response.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/phase/phase_map.hpp"
#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion::cli {

/// Which views a command works on, and what their files do not say.
struct ViewsOptions {
  std::string views;                               ///< POSES.conf or a scan folder
  std::array<double, 3> line_of_sight{{0, 0, 1}};  ///< of directional scans, in their own frame
  double sigma_mm = 0.1;                           ///< noise of scans that state none
  bool no_prior = false;  ///< poses of a scan are not read: every view is in its own camera frame
};
void DeclareViews(Command& command, ViewsOptions& options);

/// Settings of the stages from frames to phase maps.
struct DecodeConfig {
  PhaseConfig phase;
  DiagnosisConfig diagnosis;  ///< how sensor noise is estimated, where phase asks for it
  std::optional<ResponseCurve> response;  ///< undone in the phases, if it says so
};
[[nodiscard]] Result<DecodeConfig> LoadDecodeConfig(const Session& session);

/// Decodes the frames of one view with the sensor noise that the settings choose.
/// @param owner names the view in errors. @param recycled see DecodePhase.
[[nodiscard]] Result<PhaseMap> DecodeView(const ImageStack& stack, const DecodeConfig& config,
                                          const std::string& owner, const Progress& progress,
                                          PhaseMap recycled = {});

/// Settings of the stages from frames to range images.
struct ReconstructConfig {
  DecodeConfig decode;
  TriangulationConfig triangulation;
};
[[nodiscard]] Result<ReconstructConfig> LoadReconstructConfig(const Session& session);

/// Frames of one view -> phase map -> range image; a view without any point is an error that tells
/// why its pixels were discarded.
struct Reconstruction {
  PhaseMap phase;
  TriangulationResult triangulation;
};
[[nodiscard]] Result<Reconstruction> ReconstructView(const ScanFolder& scan, int view_id,
                                                     const ReconstructConfig& config,
                                                     const Progress& progress);
/// The same where the frames have been read. @param stack of view stack.view_id.
[[nodiscard]] Result<Reconstruction> ReconstructStack(const ScanFolder& scan,
                                                      const ImageStack& stack,
                                                      const ReconstructConfig& config,
                                                      const Progress& progress);

/// Pose of a view from its view.yaml. The camera frame of a single view without a prior is taken
/// as the object frame; with several views such a view is an error that names it.
[[nodiscard]] Result<Pose> PriorPose(const ScanFolder& scan, int view_id);

/// Ids to work on: all, or the one that was asked for. @param view_id -1: all.
[[nodiscard]] Result<std::vector<int>> SelectViews(const ScanFolder& scan, int view_id);

/// Name of a view in files and messages, e.g. "003".
[[nodiscard]] std::string ViewName(int view_id);

/// Views that are read one at a time.
struct ViewList {
  int count = 0;
  std::function<Result<View>(int index, const Progress& progress)> read;
};
/// What LoadViews loads.
[[nodiscard]] Result<ViewList> ListViews(const ViewsOptions& options, const Session& session);

/// Loads range images with their poses: those of a POSES.conf, or those of a scan folder, where a
/// view without range.ply is reconstructed from its frames.
[[nodiscard]] Result<std::vector<View>> LoadViews(const ViewsOptions& options, Session& session);

/// File of a view's range image relative to a scan or output folder: views/003/range.ply.
[[nodiscard]] std::string RangeFile(int view_id);

}  // namespace fringe_fusion::cli
