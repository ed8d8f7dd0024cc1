#pragma once

#include <string>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/diagnosis/response.hpp"

namespace fringe_fusion {

/// Writes a response table: the light of each 8-bit value, its gamma and the sigma of that. Numbers
/// survive a round trip bit by bit. @return error naming the path.
[[nodiscard]] Status WriteResponse(const ResponseCurve& response, const std::string& path);

/// Reads a response table.
/// @return error naming the file when it cannot be read, or the light does not rise from 0 to 1.
[[nodiscard]] Result<ResponseCurve> ReadResponse(const std::string& path);

}  // namespace fringe_fusion
