#pragma once

#include <fmt/format.h>

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace fringe_fusion {

/// What went wrong, in one line that names the input, the measured value and the limit.
struct Error {
  std::string message;
};

/// A value, or the reason why there is none. Functions that return it are [[nodiscard]].
template <typename T>
using Result = tl::expected<T, Error>;

/// Success, or the reason of the failure.
using Status = tl::expected<void, Error>;

/// Builds the failure branch of a Result: `return Fail("{}: width {} must be positive", file, w);`
template <typename... Args>
[[nodiscard]] tl::unexpected<Error> Fail(fmt::format_string<Args...> format, Args&&... args) {
  return tl::unexpected<Error>(Error{fmt::format(format, std::forward<Args>(args)...)});
}

/// Hands the failure of one call on to the caller: `if (!x) return Forward(x);`
template <typename T>
[[nodiscard]] tl::unexpected<Error> Forward(const Result<T>& failed) {
  return tl::unexpected<Error>(failed.error());
}

}  // namespace fringe_fusion
