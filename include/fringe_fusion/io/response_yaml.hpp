#pragma once

#include <string>

#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/diagnosis/response.hpp"

namespace fringe_fusion {

/// Writes a response table: the light of each 8-bit value, its gamma and the sigma of that, and
/// where it is to be undone (undo_in: patterns or phase). Numbers survive a round trip bit by bit.
/// @return error naming the path.
[[nodiscard]] Status WriteResponse(const ResponseCurve& response, const std::string& path);

/// Reads a response table.
/// @return error naming the file when it cannot be read, the light does not rise from 0 to 1, or
/// undo_in has another value.
[[nodiscard]] Result<ResponseCurve> ReadResponse(const std::string& path);

}  // namespace fringe_fusion
