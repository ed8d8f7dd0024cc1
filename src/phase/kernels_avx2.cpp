#include "kernels.hpp"

#if defined(__x86_64__)

#include <immintrin.h>

// Every function from here on is compiled for AVX2, and none of them leaves this file.
#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("avx2")
#endif

#include "lanes_avx2.hpp"

// After the lanes, whose functions they use.
#include "kernel_edges.hpp"
#include "kernel_ladder.hpp"
#include "kernel_quick.hpp"

namespace fringe_fusion::decode {
namespace {
using Lanes = AvxLanes;
constexpr const char* kName = "avx2";
}  // namespace
}  // namespace fringe_fusion::decode

#include "kernel_table.hpp"

#if defined(__clang__)
#pragma clang attribute pop
#else
#pragma GCC pop_options
#endif

namespace fringe_fusion::decode {

const Kernels& BestKernels() {
  return __builtin_cpu_supports("avx2") != 0 ? kKernels : PortableKernels();
}

}  // namespace fringe_fusion::decode

#else

namespace fringe_fusion::decode {

const Kernels& BestKernels() { return PortableKernels(); }

}  // namespace fringe_fusion::decode

#endif
