#include "variational_kernel.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fringe_fusion::internal {
namespace {

// Keeps divisions by r finite at r = 0; lengths are scaled to about 1.
constexpr double kTiny = 1e-12;

RadialValue Wendland(double support, double r) {
  const double rest = std::max(0.0, 1.0 - r / support);
  const double s2 = support * support;
  return {rest * rest * rest * rest * (4.0 * r / support + 1.0), -20.0 * rest * rest * rest / s2,
          60.0 * rest * rest / (s2 * support * std::max(r, kTiny))};
}

}  // namespace

RadialValue Radial(KernelKind kind, double support, double r2) {
  const double r = std::sqrt(r2);
  const double inverse = 1.0 / std::max(r, kTiny);
  switch (kind) {
    case KernelKind::kBiharmonic:
      return {-r, -inverse, inverse * inverse * inverse};
    case KernelKind::kTriharmonic:
      return {r2 * r, 3.0 * r, 3.0 * inverse};
    case KernelKind::kThinPlate: {
      const double log_r = std::log(std::max(r, kTiny));
      return {r2 * log_r, 2.0 * log_r + 1.0, 2.0 * inverse * inverse};
    }
    case KernelKind::kWendland:
      return Wendland(support, r);
  }
  return {};
}

bool HasHessian(KernelKind kind) {
  return kind == KernelKind::kTriharmonic || kind == KernelKind::kWendland;
}

// Fourier transform of r^b on a plane: 2^(b+2) pi Gamma(1+b/2) / Gamma(-b/2) w^(-b-2).
// Ref: Gelfand and Shilov, Generalized Functions 1, 1964.
double SmoothingFactor(KernelKind kind, double support, double width, double density,
                       double sigma) {
  constexpr double kOfR = 2.0 * M_PI;          // -r: w^-3
  constexpr double kOfR3 = 18.0 * M_PI;        // r^3: w^-5
  constexpr double kOfThinPlate = 8.0 * M_PI;  // r^2 log r: w^-4
  const double per_noise = density / (sigma * sigma);
  switch (kind) {
    case KernelKind::kBiharmonic:
      return kOfR * per_noise * std::pow(width, 3);
    case KernelKind::kTriharmonic:
      return kOfR3 * per_noise * std::pow(width, 5);
    case KernelKind::kThinPlate:
      return kOfThinPlate * per_noise * std::pow(width, 4);
    case KernelKind::kWendland:
      // phi = 1 - 10 (r/s)^2 + 20 (r/s)^3 - ...: the odd term gives the spectrum at short waves.
      return 20.0 / std::pow(support, 3) * kOfR3 * per_noise * std::pow(width, 5);
  }
  return std::numeric_limits<double>::quiet_NaN();
}

Result<KernelKind> ParseKernel(const std::string& name) {
  if (name == "biharmonic") return KernelKind::kBiharmonic;
  if (name == "triharmonic") return KernelKind::kTriharmonic;
  if (name == "thin_plate") return KernelKind::kThinPlate;
  if (name == "wendland") return KernelKind::kWendland;
  return Fail(
      "variational: kernel = '{}' is unknown; use biharmonic, triharmonic, thin_plate or wendland",
      name);
}

}  // namespace fringe_fusion::internal
