#pragma once

#include <utility>

#include "src/phase/frame_rows.hpp"
#include "synthetic_stack.hpp"

namespace fringe_fusion::test {

/// A stack with everything that the row decoders need.
struct RowFixture {
  explicit RowFixture(ImageStack the_stack, PhaseConfig the_config = {},
                      const decode::Kernels& kernels = decode::BestKernels())
      : stack(std::move(the_stack)),
        config(the_config),
        plan(decode::MakeDecodePlan(stack.sequence).value()),
        context{plan, config, kernels, Width(stack.frames.front()),
                static_cast<float>((1 << stack.frames.front().bit_depth) - 1)},
        rows(stack, context) {}

  ImageStack stack;
  PhaseConfig config;
  decode::DecodePlan plan;
  decode::DecodeContext context;
  decode::FrameRows rows;
};

}  // namespace fringe_fusion::test
