#pragma once

#include <fringe_fusion/Frame.h>

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

/// Collects the Frames of one view at a time until its stack is complete. The first frame of
/// another view, or frame 0 of the same one again (a repeated view), starts anew.
class StackAssembler {
 public:
  /// What became of one frame.
  struct Outcome {
    std::optional<ImageStack> stack;  ///< set once the last missing frame has come
    std::string camera_frame;         ///< of the stack
    std::string discarded;            ///< not empty: words about an incomplete view given up
  };

  /// @return error naming scan, view and frame when the frame is malformed or contradicts those
  /// before; the frame is then left out.
  [[nodiscard]] Result<Outcome> Add(const Frame& frame);

 private:
  [[nodiscard]] bool StartsAnew(const Frame& frame) const;
  void Start(const Frame& frame);

  ImageStack stack_;
  std::string camera_frame_;
  std::set<std::uint32_t> missing_;
};

}  // namespace fringe_fusion::nodes
