#pragma once

#include <string>

#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion {

/// Reads an 8 or 16 bit grey image; colour is converted to grey. PNG, JPG, TIFF.
/// @return error naming the file when it is missing, truncated or of another format.
[[nodiscard]] Result<FramePixels> ReadGrayImage(const std::string& path);
[[nodiscard]] Result<Image<Rgb8>> ReadColorImage(const std::string& path);
[[nodiscard]] Result<Image<float>> ReadFloatImage(const std::string& path);  ///< 32-bit TIFF

// All atomic; errors name the path.
[[nodiscard]] Status WriteImage(const FramePixels& image, const std::string& path);
[[nodiscard]] Status WriteImage(const Image<std::uint8_t>& image, const std::string& path);
[[nodiscard]] Status WriteImage(const Image<Rgb8>& image, const std::string& path);
[[nodiscard]] Status WriteImage(const Image<float>& image, const std::string& path);

}  // namespace fringe_fusion
