#pragma once

#include "fringe_fusion/triangulation/range_image.hpp"

namespace fringe_fusion::test_support {

/// A range image of 7 x 5 pixels with holes and every attribute.
inline RangeImage SmallRange() {
  RangeImage range = MakeRangeImage(7, 5);
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 7; ++x) {
      if ((x + 2 * y) % 3 == 0) continue;
      range.points(x, y) = {0.1F * static_cast<float>(x), static_cast<float>(y) / 3.0F, 1.0F};
      range.normals(x, y) = {0.6F, 0.0F, -0.8F};
      range.color(x, y) = {static_cast<std::uint8_t>(10 * x), static_cast<std::uint8_t>(y), 200};
      range.sigma_range(x, y) = 1e-5F / 3.0F;
      range.sigma_lateral(x, y) = 2e-5F;
    }
  }
  range.line_of_sight.camera = {0.0F, 0.1F, 1.0F / 3.0F};
  range.line_of_sight.projector = Eigen::Vector3f(0.2F, 0.0F, 0.0F);
  range.first_stamp_ns = 1700000000123456789LL;
  range.last_stamp_ns = 1700000000987654321LL;
  return range;
}

/// Equal to the last bit, NaN equal to NaN; colours only where valid.
inline bool SameRanges(const RangeImage& a, const RangeImage& b) {
  if (a.width != b.width || a.height != b.height) return false;
  const auto same = [](float p, float q) { return p == q || (p != p && q != q); };
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      if (!same(a.points[i][k], b.points[i][k])) return false;
      if (!same(a.normals[i][k], b.normals[i][k])) return false;
    }
    if (!same(a.sigma_range[i], b.sigma_range[i])) return false;
    if (!same(a.sigma_lateral[i], b.sigma_lateral[i])) return false;
    if (a.points[i].allFinite() && (a.color[i].r != b.color[i].r || a.color[i].g != b.color[i].g ||
                                    a.color[i].b != b.color[i].b)) {
      return false;
    }
  }
  return true;
}

}  // namespace fringe_fusion::test_support
