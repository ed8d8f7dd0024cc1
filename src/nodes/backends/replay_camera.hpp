#pragma once

#include <optional>
#include <string>

#include "fringe_fusion/capture/devices.hpp"
#include "fringe_fusion/io/scan_folder.hpp"

namespace fringe_fusion::nodes {

struct ReplayCameraConfig {
  std::string scan;     ///< scan folder
  bool stamps = false;  ///< true: stamps of the recording if it has some; false: time of the call

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("scan", scan);
    field("stamps", stamps);
  }
};

/// A camera that gives the recorded frames of a scan folder.
class ReplayCamera : public Camera {
 public:
  explicit ReplayCamera(ReplayCameraConfig config);
  [[nodiscard]] std::string Id() const override;
  /// The recording fixes exposure and gain; only the bounds are checked.
  [[nodiscard]] Status Configure(double exposure_s, double gain) override;
  void Announce(int view_id, int frame_index) override;
  /// @return error when the recording has no such view or frame.
  [[nodiscard]] Result<CapturedFrame> Capture(double timeout_s) override;

 private:
  [[nodiscard]] Status Load();

  ReplayCameraConfig config_;
  std::optional<ImageStack> stack_;  // Read when first asked, so that the folder may come later.
  std::string serial_;               // Of the camera that took them.
  int view_id_ = 0;
  int frame_index_ = 0;
};

}  // namespace fringe_fusion::nodes
