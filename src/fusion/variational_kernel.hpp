#pragma once

#include <string>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::internal {

enum class KernelKind { kBiharmonic, kTriharmonic, kThinPlate, kWendland };

/// A radial function by its value and the factors of its derivatives, with e = x - y, r = |e|:
///   phi(r),  grad phi = a e,  Hessian = a I + b e e^T.
struct RadialValue {
  double phi = 0.0;
  double a = 0.0;
  double b = 0.0;
};

/// @param support radius of the compact kernel; the others have none.
/// At r = 0 the factors are those of the limit of the derivatives, where there is one.
[[nodiscard]] RadialValue Radial(KernelKind kind, double support, double r2);

/// Whether the kernel has two continuous derivatives at 0, which slopes as data need.
[[nodiscard]] bool HasHessian(KernelKind kind);

/// The factor alpha of the noise with which details of the given width on a surface are damped by
/// half: the spectrum of the kernel on a plane, times the density of the points, equals
/// alpha sigma^2 there.
/// @param density points per area.
[[nodiscard]] double SmoothingFactor(KernelKind kind, double support, double width, double density,
                                     double sigma);

/// @return error naming the value when there is no such kernel.
[[nodiscard]] Result<KernelKind> ParseKernel(const std::string& name);

}  // namespace fringe_fusion::internal
