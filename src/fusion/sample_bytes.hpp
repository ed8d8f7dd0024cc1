#pragma once

#include <string>

#include "view_samples.hpp"

namespace fringe_fusion::internal {

/// The samples of a view as bytes (little endian), with a checksum.
[[nodiscard]] std::string ToBytes(const ViewSamples& view);

/// @return error when the bytes are cut off, changed, or describe no samples.
[[nodiscard]] Result<ViewSamples> FromBytes(const std::string& bytes);

}  // namespace fringe_fusion::internal
