#include "sum_lines.hpp"

#if defined(__x86_64__)

// Every function from here on is compiled for AVX2, and none of them leaves this file.
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2")
#endif

namespace fringe_fusion::internal {
namespace {
#include "sum_lines_body.hpp"
}  // namespace
}  // namespace fringe_fusion::internal

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

namespace fringe_fusion::internal {

const LineKernels& BestLineKernels() {
  return __builtin_cpu_supports("avx2") != 0 ? kLineKernels : PortableLineKernels();
}

}  // namespace fringe_fusion::internal

#else

namespace fringe_fusion::internal {

const LineKernels& BestLineKernels() { return PortableLineKernels(); }

}  // namespace fringe_fusion::internal

#endif
