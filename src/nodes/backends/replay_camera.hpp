#pragma once

#include <optional>
#include <string>

#include "fringe_fusion/capture/devices.hpp"
#include "fringe_fusion/io/scan_folder.hpp"

namespace fringe_fusion::nodes {

struct ReplayCameraConfig {
  std::string scan;    ///< scan folder
  int view_id = 0;     ///< whose frames are given, over and over in the order of patterns.yaml
  bool stamps = true;  ///< true: stamps of the recording if it has some; false: time of the call

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("scan", scan);
    field("view_id", view_id, 0, 999999);
    field("stamps", stamps);
  }
};

/// A camera that gives the recorded frames of one view of a scan folder in their order.
class ReplayCamera : public Camera {
 public:
  explicit ReplayCamera(ReplayCameraConfig config);
  [[nodiscard]] std::string Id() const override;
  /// The recording fixes exposure and gain; only the bounds are checked.
  [[nodiscard]] Status Configure(double exposure_s, double gain) override;
  [[nodiscard]] Result<CapturedFrame> Capture(double timeout_s) override;

 private:
  ReplayCameraConfig config_;
  std::optional<ImageStack> stack_;  // Read when first asked, so that the folder may come later.
  std::string serial_;               // Of the camera that took them.
  std::size_t next_ = 0;
};

}  // namespace fringe_fusion::nodes
