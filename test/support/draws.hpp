#pragma once

#include <initializer_list>
#include <vector>

namespace fringe_fusion::test_support {

/// Sanitizers look at memory and arithmetic, which the first draw of a test exercises like the
/// fiftieth, at a tenth of the speed.
#ifdef __SANITIZE_ADDRESS__
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

/// Draws of a statistical test; what they say on the average needs all of them.
constexpr int Draws(int all, int sanitized) { return kSanitized ? sanitized : all; }

/// The cases of a test; under sanitizers the first one.
template <typename T>
[[nodiscard]] std::vector<T> Cases(std::initializer_list<T> all) {
  return {all.begin(), kSanitized ? all.begin() + 1 : all.end()};
}

}  // namespace fringe_fusion::test_support
