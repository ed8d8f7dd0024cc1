#pragma once

#include <string>

namespace fringe_fusion::nodes {

/// Parameters of scanner_node beside `pattern`, `prior`, `motion`, `edges`, `phase`,
/// `diagnosis` and `capture_assistant`.
/// File: config/scanner.yaml.
struct ScannerNodeConfig {
  std::string calibration_file;  ///< cell.yaml
  std::string camera_frame = "camera_optical_frame";
  std::string projector_frame = "projector_optical_frame";
  std::string object_frame = "object";
  std::string camera_node = "camera_node";        ///< whose ~capture is called
  std::string projector_node = "projector_node";  ///< whose ~show_pattern is called
  double exposure_s = 0.02;
  double gain = 1.0;
  double show_timeout_s = 8.0;
  double capture_timeout_s = 5.0;  ///< what the camera is given for one frame
  double service_timeout_s = 5.0;  ///< a node that is silent for longer counts as hung
  double tf_timeout_s = 1.0;
  double tf_cache_s = 600.0;         ///< how far back the first frame of a slow view may lie
  double stamp_tolerance_s = 0.002;  ///< a frame stamped earlier shows another pattern
  int max_retries = 3;               ///< per frame

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("calibration_file", calibration_file);
    field("camera_frame", camera_frame);
    field("projector_frame", projector_frame);
    field("object_frame", object_frame);
    field("camera_node", camera_node);
    field("projector_node", projector_node);
    field("exposure_s", exposure_s, 1e-6, 100.0);
    field("gain", gain, 0.0, 1000.0);
    field("show_timeout_s", show_timeout_s, 0.01, 600.0);
    field("capture_timeout_s", capture_timeout_s, 0.01, 600.0);
    field("service_timeout_s", service_timeout_s, 0.01, 600.0);
    field("tf_timeout_s", tf_timeout_s, 0.0, 600.0);
    field("tf_cache_s", tf_cache_s, 1.0, 86400.0);
    field("stamp_tolerance_s", stamp_tolerance_s, 0.0, 10.0);
    field("max_retries", max_retries, 0, 1000);
  }
};

}  // namespace fringe_fusion::nodes
