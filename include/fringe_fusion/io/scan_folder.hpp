#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/phase/phase_map.hpp"
#include "fringe_fusion/pose/view.hpp"

namespace fringe_fusion {

/// What view.yaml says of one view; every key is optional.
struct ViewDescription {
  std::string root;                      ///< folder of the frames, relative to view.yaml; "": same
  std::vector<std::string> frame_files;  ///< in the order of patterns.yaml; default frame_NNN.png
  std::string color_file;                ///< colour picture, relative to root; "": none
  std::vector<std::int64_t> stamps_ns;   ///< empty or one per frame
  std::vector<double> exposures_s;       ///< empty or one per frame
  std::vector<double> gains;             ///< empty (all 1) or one per frame
  int bit_depth = 0;                     ///< 0: 8 for 8-bit files, 16 for 16-bit files
  std::optional<Pose> prior;             ///< T_object_camera with sigmas
  std::vector<double> joint_positions;   ///< [rad or m]
  std::string scan_id;
  std::string camera_id;
};

/// A scan on disk: cell.yaml, patterns.yaml, views/NNN/. Opening reads the YAML files only.
struct ScanFolder {
  std::string path;
  CellCalibration calibration;
  PatternSequence sequence;
  std::vector<int> view_ids;  ///< rising; a view without view.yaml is incomplete and left out
};

[[nodiscard]] Result<CellCalibration> ReadCellCalibration(const std::string& path);
[[nodiscard]] Status WriteCellCalibration(const CellCalibration& calibration,
                                          const std::string& path);
/// Reads the OpenCV FileStorage calibration of sltk (cam_K, cam_kc, pro_K, pro_kc, R, T in mm).
[[nodiscard]] Result<CellCalibration> ReadSltkCalibration(const std::string& path);
[[nodiscard]] Result<PatternSequence> ReadPatterns(const std::string& path);
[[nodiscard]] Status WritePatterns(const PatternSequence& sequence, const std::string& path);

[[nodiscard]] Result<ScanFolder> OpenScan(const std::string& path);
/// Creates the folder with cell.yaml and patterns.yaml; existing views stay.
/// @return error when existing views were taken with another calibration or other patterns.
[[nodiscard]] Result<ScanFolder> CreateScan(const std::string& path,
                                            const CellCalibration& calibration,
                                            const PatternSequence& sequence);
/// views/NNN of a scan.
[[nodiscard]] std::string ViewFolder(const ScanFolder& scan, int view_id);

[[nodiscard]] Result<ViewDescription> ReadViewDescription(const ScanFolder& scan, int view_id);
/// view.yaml itself, without looking at frames; numbers survive a round trip bit by bit.
[[nodiscard]] Result<ViewDescription> ReadViewDescriptionFile(const std::string& path);
[[nodiscard]] Status WriteViewDescriptionFile(const ViewDescription& view, const std::string& path);
/// Folder of a view's frames: its `root` from the view's own folder. If the variable
/// FRINGE_FUSION_DATA is set, a root `.../shared/data/X` means `$FRINGE_FUSION_DATA/X`.
[[nodiscard]] std::string FrameFolder(const ScanFolder& scan, int view_id,
                                      const ViewDescription& view);
/// Reads the frames of a view and checks them against the sequence and the camera: its size and,
/// where both are stated, camera_id of view.yaml against camera_serial of cell.yaml.
[[nodiscard]] Result<ImageStack> ReadStack(const ScanFolder& scan, int view_id);
/// Writes frames as PNG and view.yaml into a temporary folder that replaces the view's folder at
/// the end: a view is complete or as it was before. What was decoded from earlier frames goes.
[[nodiscard]] Status WriteStack(const ScanFolder& scan, const ImageStack& stack,
                                const std::optional<Pose>& prior,
                                const std::vector<double>& joint_positions);

/// u.tiff ... mask.png of a view, mask.png last; also offset.tiff and texture.png. The stamps come
/// from view.yaml.
[[nodiscard]] Status WritePhaseMap(const ScanFolder& scan, int view_id, const PhaseMap& phase);
[[nodiscard]] Result<PhaseMap> ReadPhaseMap(const ScanFolder& scan, int view_id);

}  // namespace fringe_fusion
