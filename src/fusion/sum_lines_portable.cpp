#include "sum_lines.hpp"

namespace fringe_fusion::internal {
namespace {
#include "sum_lines_body.hpp"
}  // namespace

const LineKernels& PortableLineKernels() { return kLineKernels; }

}  // namespace fringe_fusion::internal
