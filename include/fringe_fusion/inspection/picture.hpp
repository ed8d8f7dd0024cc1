#pragma once

#include <string>
#include <vector>

#include "fringe_fusion/common/image.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion {

/// Shaded picture of a mesh seen from `direction` (object frame, towards the eye), fitted to frame,
/// in its vertex colours or grey. Back faces are drawn bluish.
/// @return error when the mesh has no faces.
[[nodiscard]] Result<Image<Rgb8>> RenderMesh(const Mesh& mesh, const Eigen::Vector3f& direction,
                                             int width, int height, bool use_colors);

/// Blue - green - red colours of signed values over [-limit, limit]; NaN is grey.
[[nodiscard]] std::vector<Rgb8> DeviationColors(const std::vector<float>& deviation_m,
                                                double limit_m);

/// False-colour picture of a scalar image between its 1 % and 99 % quantiles; NaN is black.
/// @param unit when given, a colour bar labelled in it is added at the right edge, e.g. "px".
[[nodiscard]] Image<Rgb8> RenderScalar(const Image<float>& image, const std::string& unit = "");

/// Adds a colour bar of signed deviations, labelled [-limit_mm, limit_mm], at the right edge.
[[nodiscard]] Image<Rgb8> WithColorBar(const Image<Rgb8>& picture, double limit_mm);

}  // namespace fringe_fusion
