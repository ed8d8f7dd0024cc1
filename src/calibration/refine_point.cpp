#include "refine_point.hpp"

#include <ceres/tiny_solver.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "common/constants.hpp"

namespace fringe_fusion::internal {
namespace {

/// One grey value of a window.
struct Pixel {
  Eigen::Vector2d p = Eigen::Vector2d::Zero();  ///< from the middle of the window [px]
  double value = 0.0;
  double weight = 1.0;  ///< 1 / sigma
};

/// Cumulative normal distribution and its density.
struct Normal {
  explicit Normal(double t)
      : area(0.5 * std::erfc(-t / std::sqrt(2.0))),
        density(std::exp(-0.5 * t * t) / std::sqrt(2.0 * kPi)) {}
  double area;
  double density;
};

/// The grey value of a dark ellipse: light (dark + (ground - dark) area(h / blur)), where h is the
/// distance to the rim and light = 1 + gradient . p.
struct DotModel {
  static constexpr int kNum = 10;
  enum Parameter { kX, kY, kXx, kXy, kYy, kBlur, kGround, kDark, kLightX, kLightY };
  using Vector = Eigen::Matrix<double, kNum, 1>;

  static double Evaluate(const Vector& m, const Eigen::Vector2d& p, Vector& slope) {
    const Eigen::Vector2d d(p.x() - m[kX], p.y() - m[kY]);
    const Eigen::Vector2d v(m[kXx] * d.x() + m[kXy] * d.y(), m[kXy] * d.x() + m[kYy] * d.y());
    // Away from the middle, which the windows leave out.
    const double square = std::max(d.dot(v), 1e-6);
    const double q = std::sqrt(square);
    const double g = std::max(v.norm(), 1e-9);
    const double n = square - q;
    const double h = n / g;  // (q - 1) over the slope of q: first order distance to the rim
    const Normal normal(h / m[kBlur]);
    const double light = 1.0 + m[kLightX] * p.x() + m[kLightY] * p.y();
    const double step = m[kGround] - m[kDark];
    const double surface = m[kDark] + step * normal.area;

    const double by_h = light * step * normal.density / m[kBlur];
    const double by_square = (1.0 - 0.5 / q) / g;
    const double by_g = -n / (g * g);
    const Eigen::Vector2d A_v(m[kXx] * v.x() + m[kXy] * v.y(), m[kXy] * v.x() + m[kYy] * v.y());
    const Eigen::Vector2d by_centre = -2.0 * by_square * v - by_g / g * A_v;
    slope[kX] = by_h * by_centre.x();
    slope[kY] = by_h * by_centre.y();
    slope[kXx] = by_h * (by_square * d.x() * d.x() + by_g * v.x() * d.x() / g);
    slope[kXy] =
        by_h * (2.0 * by_square * d.x() * d.y() + by_g * (v.x() * d.y() + v.y() * d.x()) / g);
    slope[kYy] = by_h * (by_square * d.y() * d.y() + by_g * v.y() * d.y() / g);
    slope[kBlur] = -by_h * h / m[kBlur];
    slope[kGround] = light * normal.area;
    slope[kDark] = light * (1.0 - normal.area);
    slope[kLightX] = surface * p.x();
    slope[kLightY] = surface * p.y();
    return light * surface;
  }
};

/// The grey value where two edges cross: light (middle + step e1 e2), e = 2 area(h / blur) - 1 of
/// the distance h to each line.
struct CornerModel {
  static constexpr int kNum = 9;
  enum Parameter { kX, kY, kEdge1, kEdge2, kBlur, kMiddle, kStep, kLightX, kLightY };
  using Vector = Eigen::Matrix<double, kNum, 1>;

  static double Evaluate(const Vector& m, const Eigen::Vector2d& p, Vector& slope) {
    const Eigen::Vector2d d(p.x() - m[kX], p.y() - m[kY]);
    const Eigen::Vector2d along_1(std::cos(m[kEdge1]), std::sin(m[kEdge1]));
    const Eigen::Vector2d along_2(std::cos(m[kEdge2]), std::sin(m[kEdge2]));
    const double h_1 = along_1.x() * d.y() - along_1.y() * d.x();
    const double h_2 = along_2.x() * d.y() - along_2.y() * d.x();
    const Normal normal_1(h_1 / m[kBlur]);
    const Normal normal_2(h_2 / m[kBlur]);
    const double e_1 = 2.0 * normal_1.area - 1.0;
    const double e_2 = 2.0 * normal_2.area - 1.0;
    const double light = 1.0 + m[kLightX] * p.x() + m[kLightY] * p.y();
    const double surface = m[kMiddle] + m[kStep] * e_1 * e_2;

    const double by_h1 = light * m[kStep] * e_2 * 2.0 * normal_1.density / m[kBlur];
    const double by_h2 = light * m[kStep] * e_1 * 2.0 * normal_2.density / m[kBlur];
    slope[kX] = by_h1 * along_1.y() + by_h2 * along_2.y();
    slope[kY] = -by_h1 * along_1.x() - by_h2 * along_2.x();
    slope[kEdge1] = -by_h1 * along_1.dot(d);
    slope[kEdge2] = -by_h2 * along_2.dot(d);
    slope[kBlur] = -(by_h1 * h_1 + by_h2 * h_2) / m[kBlur];
    slope[kMiddle] = light;
    slope[kStep] = light * e_1 * e_2;
    slope[kLightX] = surface * p.x();
    slope[kLightY] = surface * p.y();
    return light * surface;
  }
};

/// Weighted residuals of a model over a window, as ceres::TinySolver asks for them.
template <typename Model>
class WindowCost {
 public:
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = Model::kNum };

  explicit WindowCost(const std::vector<Pixel>& pixels) : pixels_(pixels) {}
  [[nodiscard]] int NumResiduals() const { return static_cast<int>(pixels_.size()); }

  bool operator()(const double* parameters, double* residuals, double* jacobian) const {
    const typename Model::Vector m = Eigen::Map<const typename Model::Vector>(parameters);
    typename Model::Vector slope;
    const std::size_t count = pixels_.size();
    for (std::size_t i = 0; i < count; ++i) {
      const double value = Model::Evaluate(m, pixels_[i].p, slope);
      residuals[i] = pixels_[i].weight * (value - pixels_[i].value);
      if (jacobian == nullptr) continue;
      for (std::size_t k = 0; k < Model::kNum; ++k) {
        jacobian[k * count + i] = pixels_[i].weight * slope[static_cast<Eigen::Index>(k)];
      }
    }
    return true;
  }

 private:
  const std::vector<Pixel>& pixels_;
};

/// Fit of a model with the covariance of its parameters, scaled by the residuals.
template <typename Model>
struct Fit {
  typename Model::Vector m;
  Eigen::Matrix<double, Model::kNum, Model::kNum> covariance;
  double residual_dn = 0.0;
};

template <typename Model>
std::optional<Fit<Model>> FitModel(const std::vector<Pixel>& pixels,
                                   const typename Model::Vector& start) {
  const auto count = static_cast<double>(pixels.size());
  if (count < 2.0 * Model::kNum) return std::nullopt;
  const WindowCost<Model> cost(pixels);
  ceres::TinySolver<WindowCost<Model>> solver;
  solver.options.max_num_iterations = 30;
  // Steps far below the noise end the search.
  solver.options.parameter_tolerance = 1e-7;
  Fit<Model> fit;
  fit.m = start;
  solver.Solve(cost, &fit.m);
  if (!fit.m.allFinite()) return std::nullopt;
  Eigen::Matrix<double, Model::kNum, Model::kNum> normal;
  normal.setZero();
  double chi2 = 0.0;
  double squares = 0.0;
  typename Model::Vector slope;
  for (const Pixel& pixel : pixels) {
    const double residual = Model::Evaluate(fit.m, pixel.p, slope) - pixel.value;
    normal += pixel.weight * pixel.weight * slope * slope.transpose();
    chi2 += pixel.weight * pixel.weight * residual * residual;
    squares += residual * residual;
  }
  const Eigen::LDLT<decltype(normal)> factors(normal);
  if (factors.info() != Eigen::Success || !factors.isPositive()) return std::nullopt;
  const decltype(normal) identity = decltype(normal)::Identity();
  fit.covariance = chi2 / (count - Model::kNum) * factors.solve(identity);
  fit.residual_dn = std::sqrt(squares / count);
  if (!fit.covariance.allFinite()) return std::nullopt;
  return fit;
}

/// Pixels about a middle that `wants`, with their weights; nothing where the window is cut off.
template <typename Wants>
std::optional<std::vector<Pixel>> Window(const Image<float>& picture, const Eigen::Vector2d& middle,
                                         const Eigen::Vector2d& half_size,
                                         const DetectConfig& config, Wants&& wants) {
  const int left = static_cast<int>(std::ceil(middle.x() - half_size.x()));
  const int right = static_cast<int>(std::floor(middle.x() + half_size.x()));
  const int top = static_cast<int>(std::ceil(middle.y() - half_size.y()));
  const int bottom = static_cast<int>(std::floor(middle.y() + half_size.y()));
  if (!picture.Contains(left, top) || !picture.Contains(right, bottom)) return std::nullopt;
  const double quiet = config.read_noise_dn * config.read_noise_dn + 1.0 / 12.0;
  std::vector<Pixel> pixels;
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) {
      const Eigen::Vector2d p = Eigen::Vector2d(x, y) - middle;
      if (!wants(p)) continue;
      const auto value = static_cast<double>(picture(x, y));
      if (!std::isfinite(value)) return std::nullopt;
      pixels.push_back({p, value, 1.0 / std::sqrt(quiet + config.gain_dn * std::abs(value))});
    }
  }
  return pixels;
}

/// Extremes of a window without its outermost tenths.
std::pair<double, double> RobustRange(const std::vector<Pixel>& pixels) {
  std::vector<double> values;
  for (const Pixel& pixel : pixels) values.push_back(pixel.value);
  std::sort(values.begin(), values.end());
  return {values[values.size() / 10], values[values.size() - 1 - values.size() / 10]};
}

template <typename Model>
RefinedPoint Refined(const Fit<Model>& fit, const Eigen::Vector2d& middle) {
  RefinedPoint refined;
  refined.pixel = middle + fit.m.template head<2>();
  refined.covariance_px2 = fit.covariance.template topLeftCorner<2, 2>();
  refined.blur_px = std::abs(fit.m[Model::kBlur]);
  refined.residual_dn = fit.residual_dn;
  return refined;
}

std::optional<Fit<DotModel>> FitDot(const std::vector<Pixel>& pixels, const Feature& dot) {
  const auto [dark, light] = RobustRange(pixels);
  DotModel::Vector start = DotModel::Vector::Zero();
  start[DotModel::kXx] = dot.shape(0, 0);
  start[DotModel::kXy] = dot.shape(0, 1);
  start[DotModel::kYy] = dot.shape(1, 1);
  start[DotModel::kBlur] = 0.8;
  start[DotModel::kGround] = light;
  start[DotModel::kDark] = dark;
  return FitModel<DotModel>(pixels, start);
}

}  // namespace

std::optional<RefinedPoint> RefineDot(const Image<float>& picture, const Feature& dot,
                                      double reach_px, const DetectConfig& config) {
  // Pixels far inside and far outside tell the levels only, and glare lies there.
  constexpr double kMaxReach = 7.0;
  const double reach = std::min(reach_px, kMaxReach);
  const auto from_rim = [&](const Eigen::Vector2d& p) {
    const Eigen::Vector2d v = dot.shape * p;
    const double q = std::sqrt(std::max(0.0, p.dot(v)));
    return (q - 1.0) * q / std::max(v.norm(), 1e-9);
  };
  const auto wants = [&](const Eigen::Vector2d& p) {
    const double h = from_rim(p);
    return h < reach && h > -kMaxReach && p.dot(dot.shape * p) > 0.04;
  };
  const Eigen::Matrix2d spread = dot.shape.inverse();
  const Eigen::Vector2d half_size(std::sqrt(spread(0, 0)) + reach, std::sqrt(spread(1, 1)) + reach);
  const auto pixels = Window(picture, dot.pixel, half_size, config, wants);
  if (!pixels || pixels->size() < 2 * DotModel::kNum) return std::nullopt;
  const auto fit = FitDot(*pixels, dot);
  if (!fit) return std::nullopt;
  RefinedPoint refined = Refined(*fit, dot.pixel);
  const auto& m = fit->m;
  refined.shape << m[DotModel::kXx], m[DotModel::kXy], m[DotModel::kXy], m[DotModel::kYy];
  refined.contrast_dn = m[DotModel::kGround] - m[DotModel::kDark];
  const bool is_ellipse = refined.shape(0, 0) > 0.0 && refined.shape.determinant() > 0.0;
  if (!is_ellipse || !((refined.pixel - dot.pixel).norm() < 0.5 * dot.radius_px)) {
    return std::nullopt;
  }
  const double growth = std::sqrt(dot.shape.determinant() / refined.shape.determinant());
  if (!(growth > 0.4 && growth < 2.5)) return std::nullopt;
  return refined;
}

std::optional<RefinedPoint> RefineCorner(const Image<float>& picture, const Feature& corner,
                                         double radius_px, const DetectConfig& config) {
  Eigen::Vector2d middle = corner.pixel;
  std::optional<RefinedPoint> refined;
  // The second window is centred.
  for (int round = 0; round < 2; ++round) {
    const auto pixels = Window(picture, middle, Eigen::Vector2d::Constant(radius_px), config,
                               [&](const Eigen::Vector2d& p) { return p.norm() <= radius_px; });
    if (!pixels || pixels->empty()) return std::nullopt;
    const auto [dark, light] = RobustRange(*pixels);
    CornerModel::Vector start = CornerModel::Vector::Zero();
    start[CornerModel::kEdge1] = corner.edges_rad[0];
    start[CornerModel::kEdge2] = corner.edges_rad[1];
    start[CornerModel::kBlur] = 1.0;
    start[CornerModel::kMiddle] = 0.5 * (dark + light);
    // Left of the first and right of the second edge, e1 e2 is negative between the two.
    start[CornerModel::kStep] = (corner.is_bright_between ? -0.5 : 0.5) * (light - dark);
    const auto fit = FitModel<CornerModel>(*pixels, start);
    if (!fit) return std::nullopt;
    refined = Refined(*fit, middle);
    refined->contrast_dn = 2.0 * std::abs(fit->m[CornerModel::kStep]);
    if (!((refined->pixel - corner.pixel).norm() < 0.7 * radius_px)) return std::nullopt;
    middle = refined->pixel;
  }
  return refined;
}

}  // namespace fringe_fusion::internal
