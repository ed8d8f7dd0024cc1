#pragma once

#include <fringe_fusion/CalibrateCellResult.h>
#include <fringe_fusion/CalibrationState.h>
#include <ros/node_handle.h>

#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_session.hpp"
#include "nodes/calibration_files.hpp"
#include "nodes/calibration_task.hpp"

namespace fringe_fusion::nodes {

/// Calibration of camera, projector and their pose. Latched topics: calibration_state (poses,
/// coverage, residuals, next useful pose), calibration_markers, and the residuals as pictures on
/// calibration_residuals/camera and calibration_residuals/projector.
class CellTask : public CalibrationTask {
 public:
  struct Setup {
    std::string calibration_file;    ///< in force
    std::string camera_info_folder;  ///< "": none
    std::string camera_frame;
    double marker_enlarge = 1.0;  ///< factor on the residuals that are shown in space
    CalibrationTarget target;
    CalibrationConfig calibration;
    CellCalibration in_force;
  };
  /// @param files kept by the caller, longer than this object.
  CellTask(ros::NodeHandle nh, Setup setup, CalibrationFiles& files);

  [[nodiscard]] std::vector<std::string> Names() const override;
  [[nodiscard]] Result<std::string> Add(const SightedTarget& seen) override;
  [[nodiscard]] Result<std::string> Remove(const std::string& name) override;
  void Reset() override;
  [[nodiscard]] Result<std::string> Solve(const std::string& report_folder) override;
  [[nodiscard]] Result<std::string> Accept(bool force) override;

  [[nodiscard]] const CellCalibration& in_force() const { return setup_.in_force; }
  /// With the state that was published last.
  [[nodiscard]] CalibrateCellResult Message() const;

 private:
  /// Solves where the poses suffice, and publishes. @return the state in words.
  std::string Update();
  void PublishPictures(const CellCalibrationResult& result);
  [[nodiscard]] std_msgs::Header Header() const;
  [[nodiscard]] Status Write(const CellCalibrationResult& result) const;
  /// Files that Write replaces.
  [[nodiscard]] std::vector<std::string> Paths() const;

  Setup setup_;
  CalibrationFiles& files_;
  CellSession session_;
  bool solved_ = false;  ///< by the step `solve`, of the present poses
  std::int64_t last_stamp_ns_ = 0;
  CalibrationState state_;
  ros::Publisher state_publisher_;
  ros::Publisher marker_publisher_;
  ros::Publisher camera_picture_publisher_;
  ros::Publisher projector_picture_publisher_;
};

}  // namespace fringe_fusion::nodes
