#include "fringe_fusion/registration/grid_projection.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/dense.hpp"

namespace fringe_fusion {
namespace {

constexpr int kMinSide = 8;
constexpr int kMinPoints = 200;
constexpr int kMaxPoints = 4000;  // enough for ten terms at any noise
constexpr float kMaxErrorPx = 1.0F;
constexpr double kMaxErrorShare = 0.05;
constexpr float kMaxExtrapolation = 1.3F;  // of the half extent of the points

struct PixelPoint {
  Eigen::Vector2f pixel;
  Eigen::Vector3f point;
};

std::vector<PixelPoint> SomePixels(const RangeImage& range) {
  const int stride = std::max(1, CountValid(range) / kMaxPoints);
  std::vector<PixelPoint> some;
  int count = 0;
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x < range.width; ++x) {
      const Eigen::Vector3f& point = range.points(x, y);
      if (!point.allFinite() || count++ % stride != 0) continue;
      some.push_back({{static_cast<float>(x), static_cast<float>(y)}, point});
    }
  }
  return some;
}

}  // namespace

// Axes across and along the mean line of sight.
void GridProjection::SetFrame(const RangeImage& range) {
  directional_ = range.line_of_sight.directional;
  camera_ = range.line_of_sight.camera;
  Eigen::Vector3f along = Eigen::Vector3f::Zero();
  if (directional_) {
    along = -camera_.normalized();
    camera_.setZero();
  } else {
    for (const Eigen::Vector3f& point : range.points) {
      if (point.allFinite()) along += (point - camera_).normalized();
    }
    along.normalize();
  }
  int thin = 0;
  along.cwiseAbs().minCoeff(&thin);
  const Eigen::Vector3f first = along.cross(Eigen::Vector3f::Unit(thin)).normalized();
  axes_.row(0) = first;
  axes_.row(1) = along.cross(first);
  axes_.row(2) = along;
}

std::optional<Eigen::Vector2f> GridProjection::Across(const Eigen::Vector3f& point_camera) const {
  const Eigen::Vector3f local = axes_ * (point_camera - camera_);
  if (directional_) return local.head<2>().eval();
  if (!(local.z() > 0.0F)) return std::nullopt;
  return (local.head<2>() / local.z()).eval();
}

GridProjection::Terms GridProjection::TermsOf(const Eigen::Vector2f& across) {
  const float a = across.x();
  const float b = across.y();
  Terms terms;
  terms << 1.0F, a, b, a * a, a * b, b * b, a * a * a, a * a * b, a * b * b, b * b * b;
  return terms;
}

std::optional<GridProjection> GridProjection::Fit(const RangeImage& range) {
  if (range.width < kMinSide || range.height < kMinSide) return std::nullopt;
  GridProjection grid;
  grid.SetFrame(range);
  const std::vector<PixelPoint> some = SomePixels(range);
  if (static_cast<int>(some.size()) < kMinPoints) return std::nullopt;
  std::vector<Eigen::Vector2f> across;
  Eigen::Vector2f low = Eigen::Vector2f::Constant(INFINITY);
  Eigen::Vector2f high = -low;
  for (const PixelPoint& one : some) {
    const auto at = grid.Across(one.point);
    if (!at) return std::nullopt;
    across.push_back(*at);
    low = low.cwiseMin(*at);
    high = high.cwiseMax(*at);
  }
  grid.middle_ = 0.5F * (low + high);
  const float extent = 0.5F * (high - low).maxCoeff();
  if (!(extent > 0.0F) || !std::isfinite(extent)) return std::nullopt;
  grid.scale_ = 1.0F / extent;
  Eigen::Matrix<double, kNumTerms, kNumTerms> normal =
      Eigen::Matrix<double, kNumTerms, kNumTerms>::Identity() * 1e-9;
  Eigen::Matrix<double, kNumTerms, 2> right = Eigen::Matrix<double, kNumTerms, 2>::Zero();
  for (std::size_t i = 0; i < some.size(); ++i) {
    across[i] = grid.scale_ * (across[i] - grid.middle_);
    const Eigen::Matrix<double, kNumTerms, 1> terms = TermsOf(across[i]).cast<double>();
    normal.noalias() += terms * terms.transpose();
    right.noalias() += terms * some[i].pixel.cast<double>().transpose();
  }
  grid.coefficients_ = dense::SolveSymmetric(normal, right).transpose().cast<float>();
  if (!grid.coefficients_.allFinite()) return std::nullopt;
  std::size_t off = 0;
  for (std::size_t i = 0; i < some.size(); ++i) {
    const Eigen::Vector2f error = grid.coefficients_ * TermsOf(across[i]) - some[i].pixel;
    if (!(error.cwiseAbs().maxCoeff() <= kMaxErrorPx)) ++off;
  }
  if (static_cast<double>(off) > kMaxErrorShare * static_cast<double>(some.size())) {
    return std::nullopt;
  }
  return grid;
}

std::optional<Eigen::Vector2f> GridProjection::Project(const Eigen::Vector3f& point_camera) const {
  const auto across = Across(point_camera);
  if (!across) return std::nullopt;
  const Eigen::Vector2f scaled = scale_ * (*across - middle_);
  if (!(scaled.cwiseAbs().maxCoeff() <= kMaxExtrapolation)) return std::nullopt;
  return (coefficients_ * TermsOf(scaled)).eval();
}

}  // namespace fringe_fusion
