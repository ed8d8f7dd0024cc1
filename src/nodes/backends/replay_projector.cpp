#include "nodes/backends/replay_projector.hpp"

#include <algorithm>
#include <utility>

#include "fringe_fusion/io/scan_folder.hpp"

namespace fringe_fusion::nodes {

ReplayProjector::ReplayProjector(ReplayProjectorConfig config, const CameraModel& projector,
                                 PatternCorrection correction)
    : config_(std::move(config)),
      width_(projector.width),
      height_(projector.height),
      correction_(std::move(correction)) {}

std::string ReplayProjector::Id() const {
  return fmt::format("replay of '{}' {}", config_.scan, serial_);
}

Status ReplayProjector::Show(const Image<std::uint8_t>& picture) {
  if (!sequence_) {
    const Result<ScanFolder> scan = OpenScan(config_.scan);
    if (!scan) return Fail("{}: {}", Id(), scan.error().message);
    sequence_ = scan->sequence;
    serial_ = scan->calibration.projector_serial;
  }
  const std::size_t num_frames = sequence_->frames.size();
  for (std::size_t i = 0; i < num_frames; ++i) {
    const std::size_t index = (next_ + i) % num_frames;
    const Image<std::uint8_t> recorded = RenderCorrectedPattern(
        sequence_->frames[index], sequence_->width, sequence_->height, correction_);
    if (recorded.width() != picture.width() || recorded.height() != picture.height()) break;
    if (!std::equal(picture.begin(), picture.end(), recorded.begin())) continue;
    next_ = index + 1;
    return {};
  }
  return Fail(
      "{}: the picture is none of the {} patterns of {} x {} px that were shown then: check "
      "the pattern settings of scanner_node",
      Id(), num_frames, sequence_->width, sequence_->height);
}

}  // namespace fringe_fusion::nodes
