#pragma once

#include <fringe_fusion/Frame.h>

#include <list>
#include <optional>
#include <set>
#include <string>

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::nodes {

/// Collects the Frames of views until their stacks are complete. Frame 0 of a view again (a
/// repeated view) starts it anew; of more than kMaxOpen views at a time the oldest is given up.
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
  /// Two publishers, the scanner and a resumed scan from disk, may overlap by a view.
  static constexpr std::size_t kMaxOpen = 2;
  struct Open {
    ImageStack stack;
    std::string camera_frame;
    std::set<std::uint32_t> missing;
  };
  [[nodiscard]] static Open Start(const Frame& frame);
  [[nodiscard]] std::string GiveUp(std::list<Open>::iterator open);

  std::list<Open> open_;  ///< the oldest first
};

}  // namespace fringe_fusion::nodes
