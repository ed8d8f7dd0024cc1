#include "src/fusion/variational_kernel.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>

#include "src/fusion/variational_fit.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr double kSupport = 2.0;
constexpr KernelKind kKinds[] = {KernelKind::kBiharmonic, KernelKind::kTriharmonic,
                                 KernelKind::kThinPlate, KernelKind::kWendland};

double Phi(KernelKind kind, const Eigen::Vector3d& e) {
  return Radial(kind, kSupport, e.squaredNorm()).phi;
}

TEST(Radial, HasTheValuesOfTheFormulas) {
  EXPECT_DOUBLE_EQ(Phi(KernelKind::kBiharmonic, {0.0, 3.0, 4.0}), -5.0);
  EXPECT_DOUBLE_EQ(Phi(KernelKind::kTriharmonic, {0.0, 3.0, 4.0}), 125.0);
  EXPECT_DOUBLE_EQ(Phi(KernelKind::kThinPlate, {0.0, 3.0, 4.0}), 25.0 * std::log(5.0));
  EXPECT_DOUBLE_EQ(Phi(KernelKind::kWendland, {1.0, 0.0, 0.0}), std::pow(0.5, 4) * 3.0);
  EXPECT_EQ(Phi(KernelKind::kWendland, {2.5, 0.0, 0.0}), 0.0);
}

TEST(Radial, FactorsAreThoseOfTheDerivatives) {
  const Eigen::Vector3d e(0.3, -0.5, 0.7);
  constexpr double kStep = 1e-4;
  for (const KernelKind kind : kKinds) {
    const RadialValue radial = Radial(kind, kSupport, e.squaredNorm());
    const Eigen::Vector3d gradient = radial.a * e;
    const Eigen::Matrix3d hessian =
        radial.a * Eigen::Matrix3d::Identity() + radial.b * e * e.transpose();
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d di = kStep * Eigen::Vector3d::Unit(i);
      EXPECT_NEAR(gradient[i], (Phi(kind, e + di) - Phi(kind, e - di)) / (2.0 * kStep), 1e-6);
      for (int j = 0; j < 3; ++j) {
        const Eigen::Vector3d dj = kStep * Eigen::Vector3d::Unit(j);
        const double numeric = (Phi(kind, e + di + dj) - Phi(kind, e + di - dj) -
                                Phi(kind, e - di + dj) + Phi(kind, e - di - dj)) /
                               (4.0 * kStep * kStep);
        EXPECT_NEAR(hessian(i, j), numeric, 1e-5);
      }
    }
  }
}

TEST(Radial, IsFiniteAtZero) {
  for (const KernelKind kind : kKinds) {
    const RadialValue radial = Radial(kind, kSupport, 0.0);
    EXPECT_TRUE(std::isfinite(radial.phi) && std::isfinite(radial.a) && std::isfinite(radial.b));
  }
  EXPECT_EQ(Radial(KernelKind::kTriharmonic, kSupport, 0.0).phi, 0.0);
  EXPECT_EQ(Radial(KernelKind::kWendland, kSupport, 0.0).phi, 1.0);
}

TEST(ParseKernel, NamesTheUnknownOne) {
  EXPECT_EQ(*ParseKernel("thin_plate"), KernelKind::kThinPlate);
  const auto unknown = ParseKernel("gauss");
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.error().message.find("gauss"), std::string::npos);
}

// A wave on a plane, sampled densely: of the width that the smoothing is set to it must lose half.
TEST(LocalFit, DampsTheStatedWidthByHalf) {
  constexpr double kWave = 0.5;  // 2 pi width
  constexpr int kSide = 31;
  const double step = 2.0 / (kSide - 1);
  std::vector<Center> centers;
  std::vector<int> order;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      Center center;
      const double px = -1.0 + step * x;
      center.position = Eigen::Vector3d(px, -1.0 + step * y, 0.0).cast<float>();
      center.normal = Eigen::Vector3f::UnitZ();
      center.sigma = 0.01F;
      center.value = static_cast<float>(0.01 * std::cos(2.0 * M_PI * px / kWave));
      order.push_back(static_cast<int>(centers.size()));
      centers.push_back(center);
    }
  }
  for (const KernelKind kind : {KernelKind::kTriharmonic, KernelKind::kThinPlate}) {
    FitSettings settings;
    settings.kernel = kind;
    settings.use_slopes = HasHessian(kind);
    settings.slope_ratio = 0.05;
    settings.slope_sigma = 1.0;
    settings.smoothing = {kWave / (2.0 * M_PI), 1.0 / (step * step), 0.01};
    const auto fit = LocalFit::Solve(centers, order, settings);
    ASSERT_TRUE(fit);
    EXPECT_NEAR(fit->At({0.0F, 0.0F, 0.0F}).value, 0.005F, 0.001F);
    EXPECT_NEAR(fit->At({0.25F, 0.0F, 0.0F}).value, -0.005F, 0.001F);
  }
}

}  // namespace
}  // namespace fringe_fusion::internal
