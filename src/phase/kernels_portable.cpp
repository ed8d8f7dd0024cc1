#include "kernel_edges.hpp"
#include "kernel_ladder.hpp"
#include "kernel_quick.hpp"
#include "lanes_portable.hpp"

namespace fringe_fusion::decode {
namespace {
using Lanes = PortableLanes;
constexpr const char* kName = "portable";
}  // namespace
}  // namespace fringe_fusion::decode

#include "kernel_table.hpp"

namespace fringe_fusion::decode {

const Kernels& PortableKernels() { return kKernels; }

}  // namespace fringe_fusion::decode
