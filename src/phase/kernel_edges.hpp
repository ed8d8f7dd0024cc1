#pragma once

// Where the coordinates of a row of the phase map bend.

#include "kernel_bodies.hpp"

namespace fringe_fusion::decode {

// From pixel x on; NaN outside the row.
template <typename Lanes, bool kInside>
FRINGE_FUSION_INLINE typename Lanes::Float LoadNear(const float* row, int x, int count) {
  typename Lanes::Float out;
  float some[Lanes::kCount];
  const float* from = row + x;
  if (!kInside) {
    for (int i = 0; i < Lanes::kCount; ++i) {
      some[i] = x + i >= 0 && x + i < count ? row[x + i] : __builtin_nanf("");
    }
    from = some;
  }
  __builtin_memcpy(&out, from, sizeof(out));
  return out;
}

// A missing pixel (NaN) hides a bend in its direction.
template <typename Lanes, bool kInside>
FRINGE_FUSION_INLINE MaskOf<typename Lanes::Float> Bends(const EdgeAxis& axis,
                                                         const EdgeArgs& limits, int x, int count) {
  using F = typename Lanes::Float;
  const auto near = [&](const float* row, int shift) {
    return LoadNear<Lanes, kInside>(row, x + shift, count);
  };
  const F here = near(axis.rows[1], 0);
  const F limit = Larger(limits.max_bend_sigma * near(axis.sigma, 0), All<F>(limits.max_bend_px));
  const F twice = here + here;
  // A curved surface bends in proportion to its slope, an edge on its own.
  const auto bends = [&](F before, F after) {
    const F slope = limits.max_bend_ratio * Magnitude(after - before);
    return Magnitude(before + after - twice) > Larger(limit, slope);
  };
  return bends(near(axis.rows[1], -1), near(axis.rows[1], 1)) |
         bends(near(axis.rows[0], 0), near(axis.rows[2], 0));
}

template <typename Lanes, bool kInside>
FRINGE_FUSION_INLINE std::uint8_t BendsOfGroup(const EdgeArgs& args, int x, int count) {
  std::int32_t bits = 0;
  for (int i = 0; i < kQuickGroup; i += Lanes::kCount) {
    MaskOf<typename Lanes::Float> found = {};
    if (args.u.rows[1] != nullptr) {
      found |= Bends<Lanes, kInside>(args.u, args, x + i, count);
    }
    if (args.v.rows[1] != nullptr) {
      found |= Bends<Lanes, kInside>(args.v, args, x + i, count);
    }
    bits |= Lanes::Bits(found) << i;
  }
  return static_cast<std::uint8_t>(bits);
}

template <typename Lanes>
FRINGE_FUSION_INLINE void FindBendsBody(const EdgeArgs& given, int count) {
  const EdgeArgs args = given;  // of which the compiler knows that no store changes it
  int x = 0;
  for (; x < count; x += kQuickGroup) {
    const bool inside = x > 0 && x + kQuickGroup < count;
    args.bits[x / kQuickGroup] = inside ? BendsOfGroup<Lanes, true>(args, x, count)
                                        : BendsOfGroup<Lanes, false>(args, x, count);
  }
}

}  // namespace fringe_fusion::decode
