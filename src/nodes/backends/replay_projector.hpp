#pragma once

#include <optional>
#include <string>

#include "fringe_fusion/capture/devices.hpp"
#include "fringe_fusion/diagnosis/response.hpp"
#include "fringe_fusion/geometry/camera_model.hpp"
#include "fringe_fusion/pattern/pattern_sequence.hpp"

namespace fringe_fusion::nodes {

struct ReplayProjectorConfig {
  std::string scan;  ///< scan folder

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("scan", scan);
  }
};

/// The projector of a recording. It shows nothing, but refuses every picture that was not shown
/// then: the recorded frames would be taken for what they are not.
class ReplayProjector : public Projector {
 public:
  /// @param projector whose size the pictures have. @param correction undone in the pictures.
  ReplayProjector(ReplayProjectorConfig config, const CameraModel& projector,
                  PatternCorrection correction);
  [[nodiscard]] std::string Id() const override;
  [[nodiscard]] int Width() const override { return width_; }
  [[nodiscard]] int Height() const override { return height_; }
  [[nodiscard]] Status Show(const Image<std::uint8_t>& picture) override;

 private:
  ReplayProjectorConfig config_;
  std::string serial_;
  int width_;
  int height_;
  PatternCorrection correction_;
  std::optional<PatternSequence> sequence_;  // Read when first asked, as the camera's frames are.
  std::size_t next_ = 0;                     // Where the search for a picture begins.
};

}  // namespace fringe_fusion::nodes
