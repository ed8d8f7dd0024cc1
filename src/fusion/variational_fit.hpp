#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "variational_kernel.hpp"

namespace fringe_fusion::internal {

/// An oriented point with the value that the function takes there.
struct Center {
  Eigen::Vector3f position;
  Eigen::Vector3f normal;  ///< unit
  float sigma = 0.0F;      ///< of the position along the normal
  /// Of the function: the mean of the points of a bent patch lies off the surface.
  float value = 0.0F;
};

/// How strongly a fit smooths, whatever its kernel and scale: see SmoothingFactor.
struct Smoothing {
  double width = 0.0;
  double density = 0.0;
  double sigma = 0.0;
};

struct FitSettings {
  KernelKind kernel = KernelKind::kTriharmonic;
  bool use_slopes = true;  ///< false: pairs of points off the surface
  Smoothing smoothing;
  double slope_sigma = 0.1;
  double slope_ratio = 0.34;
};

/// Value and gradient of f at one point.
struct FitValue {
  float value = 0.0F;  ///< a length, as the positions
  Eigen::Vector3f gradient = Eigen::Vector3f::Zero();
};

/// f(x) = sum lambda_j phi(|x - x_j|) - sum m_j . grad phi(x - x_j) + P(x) + Q(x), fitted to one
/// cloud by one dense system, in coordinates scaled to about [-1, 1]. P is linear; Q is a quadratic
/// form whose coefficients have a standard deviation of 1 beforehand, so that strong smoothing does
/// not flatten what is bent and what the points do not tell stays 0.
class LocalFit {
 public:
  /// Minimises sum (f(x_j) - d_j)^2 / sigma_j^2 + sum (n_j . grad f - 1)^2 / slope_sigma^2 +
  /// alpha |f|^2 in the native space of the kernel.
  /// The result does not depend on threads.
  /// @param order which centres, by index; the slopes are spread over them evenly.
  /// @return none when the system cannot be solved: too few centres, or no smoothing and double
  /// points.
  [[nodiscard]] static std::optional<LocalFit> Solve(const std::vector<Center>& centers,
                                                     const std::vector<int>& order,
                                                     const FitSettings& settings);

  [[nodiscard]] FitValue At(const Eigen::Vector3f& point) const;
  /// Posterior standard deviations of f at the centres, in their order; asked for before
  /// ReleaseSystem.
  [[nodiscard]] const Eigen::VectorXf& sigma() const { return sigma_; }
  [[nodiscard]] double alpha() const { return alpha_; }
  [[nodiscard]] std::size_t MemoryBytes() const;
  void ReleaseSigma() { sigma_.resize(0); }

 private:
  struct System;
  using Lanes = Eigen::Array<float, Eigen::Dynamic, 1>;
  void Store(const System& system, const Eigen::VectorXd& solution);

  KernelKind kernel_ = KernelKind::kTriharmonic;
  Eigen::Vector3f middle_ = Eigen::Vector3f::Zero();
  float scale_ = 1.0F;
  // Padded to whole lanes by entries that add nothing.
  Lanes value_x_, value_y_, value_z_, lambda_;
  Lanes slope_x_, slope_y_, slope_z_, m_x_, m_y_, m_z_;
  Eigen::Vector4f polynomial_ = Eigen::Vector4f::Zero();
  Eigen::Matrix3f quadratic_ = Eigen::Matrix3f::Zero();
  Eigen::VectorXf sigma_;
  double alpha_ = 0.0;
};

}  // namespace fringe_fusion::internal
