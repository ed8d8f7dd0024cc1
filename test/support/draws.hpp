#pragma once

#include <dlfcn.h>

#include <initializer_list>
#include <vector>

namespace fringe_fusion::test_support {

/// True on a core with sanitizers. They look at memory and arithmetic, which the first draw of a
/// test exercises like the fiftieth, at a tenth of the speed.
inline bool Sanitized() { return dlsym(RTLD_DEFAULT, "__asan_init") != nullptr; }

/// Draws of a statistical test; what they say on the average needs all of them.
inline int Draws(int all, int sanitized) { return Sanitized() ? sanitized : all; }

/// The cases of a test; under sanitizers the first one.
template <typename T>
[[nodiscard]] std::vector<T> Cases(std::initializer_list<T> all) {
  return {all.begin(), Sanitized() ? all.begin() + 1 : all.end()};
}

}  // namespace fringe_fusion::test_support
