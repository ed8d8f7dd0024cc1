#pragma once

#include <fringe_fusion/ViewPoses.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/geometry/transform.hpp"

namespace fringe_fusion::nodes {

// What scan_object leaves in its output folder:
//   job.yaml          scan id and number of views, so that an interrupted scan can be resumed
//   scan/             raw frames as a scan folder
//   poses_prior.conf  device poses; poses.conf: registered ones; both name scan/views/NNN/range.ply
//   mesh.ply mesh.png figures.json report.html

/// One scan_object job as job.yaml tells it.
struct ScanJob {
  std::string scan_id;
  int num_views = 0;
};

[[nodiscard]] Status WriteJob(const ScanJob& job, const std::string& folder);
/// @return error naming the file when it is missing or malformed.
[[nodiscard]] Result<ScanJob> ReadJob(const std::string& folder);

/// The figures of one finished scan.
struct ScanFigures {
  /// One thing that was wrong with the capture of a view.
  struct Finding {
    std::string name;
    std::string evidence;
    std::string advice;
  };
  struct View {
    int id = 0;
    int num_points = 0;
    int num_dropped = 0;
    double overlap_ratio = 0.0;
    double rms_m = 0.0;
    bool connected = false;
    std::vector<Finding> findings;
  };
  ScanJob job;
  std::vector<View> views;
  double rms_before_m = 0.0;
  double rms_after_m = 0.0;
  int num_vertices = 0;
  int num_faces = 0;
  std::vector<std::string> warnings;                    ///< of the registration
  std::vector<std::pair<std::string, double>> seconds;  ///< per stage

  [[nodiscard]] int NumPoints() const;
  [[nodiscard]] int NumDropped() const;
};

/// Writes a Stanford .conf of the given T_object_camera.
[[nodiscard]] Status WritePoses(const std::map<int, Transform>& poses, const std::string& path);
/// T_object_camera of each view. @return error naming a malformed pose.
[[nodiscard]] Result<std::map<int, Transform>> PosesOf(const ViewPoses& poses);

[[nodiscard]] Status WriteFigures(const ScanFigures& figures, const std::string& path);
/// Draws mesh.png from mesh.ply and writes report.html.
[[nodiscard]] Status WriteScanReport(const ScanFigures& figures, const std::string& folder);

}  // namespace fringe_fusion::nodes
