#include "variational_fit.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "common/dense.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr int kLanes = 8;
using LaneArray = Eigen::Array<float, kLanes, 1>;
// Support of the compact kernel in scaled coordinates: the whole cell.
constexpr double kSupport = 2.5;

// One equation: the value of f at a point, or its slope along a direction.
struct Functional {
  Eigen::Vector3d point;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  bool is_slope = false;
  double target = 0.0;
  double variance = 0.0;
};

struct LaneRadial {
  LaneArray phi, a, b;
};

LaneRadial RadialLanes(KernelKind kind, const LaneArray& r2) {
  constexpr float kTiny = 1e-8F;
  const LaneArray r = r2.sqrt();
  const LaneArray inverse = 1.0F / r.max(kTiny);
  switch (kind) {
    case KernelKind::kBiharmonic:
      return {-r, -inverse, inverse.cube()};
    case KernelKind::kTriharmonic:
      return {r2 * r, 3.0F * r, 3.0F * inverse};
    case KernelKind::kThinPlate: {
      const LaneArray log_r = r.max(kTiny).log();
      return {r2 * log_r, 2.0F * log_r + 1.0F, 2.0F * inverse.square()};
    }
    case KernelKind::kWendland: {
      constexpr auto kS = static_cast<float>(kSupport);
      const LaneArray rest = (1.0F - r / kS).max(0.0F);
      return {rest.square().square() * (4.0F / kS * r + 1.0F), -20.0F / (kS * kS) * rest.cube(),
              60.0F / (kS * kS * kS) * rest.square() * inverse};
    }
  }
  return {};
}

// L_i applied to x and L_j applied to y of phi(|x - y|).
double Entry(KernelKind kind, const Functional& i, const Functional& j) {
  const Eigen::Vector3d e = i.point - j.point;
  const RadialValue radial = Radial(kind, kSupport, e.squaredNorm());
  if (!i.is_slope && !j.is_slope) return radial.phi;
  if (!j.is_slope) return radial.a * i.direction.dot(e);
  if (!i.is_slope) return -radial.a * j.direction.dot(e);
  return -radial.a * i.direction.dot(j.direction) -
         radial.b * i.direction.dot(e) * j.direction.dot(e);
}

using Quadratics = Eigen::Matrix<double, 6, 1>;

// L applied to x^2, y^2, z^2, sqrt(2) xy, sqrt(2) xz, sqrt(2) yz: the same from every direction.
Quadratics QuadraticsOf(const Functional& f) {
  const Eigen::Vector3d& p = f.point;
  const Eigen::Vector3d& d = f.direction;
  Quadratics q;
  if (f.is_slope) {
    q << 2.0 * p.x() * d.x(), 2.0 * p.y() * d.y(), 2.0 * p.z() * d.z(),
        M_SQRT2 * (p.x() * d.y() + p.y() * d.x()), M_SQRT2 * (p.x() * d.z() + p.z() * d.x()),
        M_SQRT2 * (p.y() * d.z() + p.z() * d.y());
  } else {
    q << p.x() * p.x(), p.y() * p.y(), p.z() * p.z(), M_SQRT2 * p.x() * p.y(),
        M_SQRT2 * p.x() * p.z(), M_SQRT2 * p.y() * p.z();
  }
  return q;
}

bool IsPicked(std::size_t index, double ratio) {
  return std::floor(static_cast<double>(index + 1) * ratio) >
         std::floor(static_cast<double>(index) * ratio);
}

}  // namespace

struct LocalFit::System {
  KernelKind kernel;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double scale = 1.0;
  std::vector<Functional> functionals;  // the values on the surface come first
  std::size_t num_centers = 0;
  Eigen::Vector4d polynomial = Eigen::Vector4d::Zero();
  Quadratics quadratic = Quadratics::Zero();

  System(const std::vector<Center>& centers, const std::vector<int>& order,
         const FitSettings& settings);
  void AddSlopes(const std::vector<Center>& centers, const std::vector<int>& order,
                 const FitSettings& settings);
  void AddPairs(const std::vector<Center>& centers, const std::vector<int>& order,
                const FitSettings& settings);
  [[nodiscard]] bool IsNearestTo(const Eigen::Vector3d& point, std::size_t index) const;
  [[nodiscard]] Eigen::MatrixXd Matrix(double alpha) const;
  [[nodiscard]] Eigen::MatrixXd PolynomialMatrix() const;
  [[nodiscard]] Eigen::MatrixXd QuadraticMatrix() const;
  [[nodiscard]] Eigen::VectorXd Targets() const;
};

LocalFit::System::System(const std::vector<Center>& centers, const std::vector<int>& order,
                         const FitSettings& settings)
    : kernel(settings.kernel), num_centers(order.size()) {
  Eigen::AlignedBox3f box;
  for (const int i : order) box.extend(centers[static_cast<std::size_t>(i)].position);
  middle = box.center().cast<double>();
  scale = std::max(1e-30, 0.5 * static_cast<double>(box.sizes().maxCoeff()));
  for (const int i : order) {
    const Center& center = centers[static_cast<std::size_t>(i)];
    Functional on;
    on.point = (center.position.cast<double>() - middle) / scale;
    on.target = static_cast<double>(center.value) / scale;
    on.variance = std::pow(static_cast<double>(center.sigma) / scale, 2);
    functionals.push_back(on);
  }
  if (settings.use_slopes) {
    AddSlopes(centers, order, settings);
  } else {
    AddPairs(centers, order, settings);
  }
}

void LocalFit::System::AddSlopes(const std::vector<Center>& centers, const std::vector<int>& order,
                                 const FitSettings& settings) {
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (!IsPicked(k, settings.slope_ratio)) continue;
    Functional slope;
    slope.point = functionals[k].point;
    slope.direction = centers[static_cast<std::size_t>(order[k])].normal.cast<double>();
    slope.is_slope = true;
    slope.target = 1.0;
    slope.variance = settings.slope_sigma * settings.slope_sigma;
    functionals.push_back(slope);
  }
}

bool LocalFit::System::IsNearestTo(const Eigen::Vector3d& point, std::size_t index) const {
  const double limit = (functionals[index].point - point).squaredNorm() * (1.0 - 1e-9);
  for (std::size_t k = 0; k < num_centers; ++k) {
    if ((functionals[k].point - point).squaredNorm() < limit) return false;
  }
  return true;
}

// The points off the surface share the noise of the point between them, and their distance is as
// uncertain as the normal. A pair that comes nearer to other points would contradict them.
void LocalFit::System::AddPairs(const std::vector<Center>& centers, const std::vector<int>& order,
                                const FitSettings& settings) {
  const double offset = std::min(0.25, std::max(settings.smoothing.width / scale, 0.05));
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (!IsPicked(k, settings.slope_ratio)) continue;
    const Eigen::Vector3d normal =
        centers[static_cast<std::size_t>(order[k])].normal.cast<double>();
    for (const double side : {-1.0, 1.0}) {
      Functional off;
      double distance = offset;
      bool is_free = false;
      for (int halving = 0; halving < 3 && !is_free; ++halving) {
        off.point = functionals[k].point + side * distance * normal;
        is_free = IsNearestTo(off.point, k);
        if (!is_free) distance *= 0.5;
      }
      if (!is_free) continue;
      off.target = functionals[k].target + side * distance;
      off.variance = functionals[k].variance + std::pow(settings.slope_sigma * distance, 2);
      functionals.push_back(off);
    }
  }
}

Eigen::MatrixXd LocalFit::System::Matrix(double alpha) const {
  const auto n = static_cast<Eigen::Index>(functionals.size());
  Eigen::MatrixXd matrix(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const Functional& fj = functionals[static_cast<std::size_t>(j)];
    for (Eigen::Index i = j; i < n; ++i) {
      matrix(i, j) = Entry(kernel, functionals[static_cast<std::size_t>(i)], fj);
      matrix(j, i) = matrix(i, j);
    }
    matrix(j, j) += alpha * fj.variance;
  }
  const Eigen::MatrixXd quadratics = QuadraticMatrix();
  matrix += alpha * dense::Product(quadratics, quadratics.transpose());
  return matrix;
}

Eigen::MatrixXd LocalFit::System::QuadraticMatrix() const {
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(functionals.size()), 6);
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    matrix.row(i) = QuadraticsOf(functionals[static_cast<std::size_t>(i)]).transpose();
  }
  return matrix;
}

Eigen::MatrixXd LocalFit::System::PolynomialMatrix() const {
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(functionals.size()), 4);
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    const Functional& f = functionals[static_cast<std::size_t>(i)];
    if (f.is_slope) {
      matrix.row(i) << 0.0, f.direction.transpose();
    } else {
      matrix.row(i) << 1.0, f.point.transpose();
    }
  }
  return matrix;
}

Eigen::VectorXd LocalFit::System::Targets() const {
  Eigen::VectorXd targets(static_cast<Eigen::Index>(functionals.size()));
  for (Eigen::Index i = 0; i < targets.size(); ++i) {
    targets[i] = functionals[static_cast<std::size_t>(i)].target;
  }
  return targets;
}

std::optional<LocalFit> LocalFit::Solve(const std::vector<Center>& centers,
                                        const std::vector<int>& order,
                                        const FitSettings& settings) {
  constexpr std::size_t kMinCenters = 3;
  if (order.size() < kMinCenters) return std::nullopt;
  System system(centers, order, settings);
  const double s = system.scale;
  const double alpha =
      SmoothingFactor(settings.kernel, kSupport, settings.smoothing.width / s,
                      settings.smoothing.density * s * s, settings.smoothing.sigma / s);
  constexpr double kRankThreshold = 1e-5;
  constexpr std::size_t kMaxForSigma = 2500;
  const bool with_sigma = system.functionals.size() <= kMaxForSigma;
  const auto solved = dense::SolveConstrained(system.Matrix(alpha), system.PolynomialMatrix(),
                                              system.Targets(), kRankThreshold, with_sigma);
  if (!solved) return std::nullopt;
  // Columns beyond the rank add nothing that the points could tell: they are 0.
  system.polynomial = solved->c;
  system.quadratic = alpha * dense::Product(system.QuadraticMatrix().transpose(), solved->x);
  if (!solved->x.allFinite() || !system.polynomial.allFinite()) return std::nullopt;

  LocalFit fit;
  fit.alpha_ = alpha;
  fit.Store(system, solved->x);
  if (with_sigma) {
    // Posterior variance s^2 (1 - alpha s^2 S_ii) of f at the centres, with S = Z (..)^-1 Z^T.
    fit.sigma_.resize(static_cast<Eigen::Index>(order.size()));
    for (Eigen::Index i = 0; i < fit.sigma_.size(); ++i) {
      const double variance = system.functionals[static_cast<std::size_t>(i)].variance;
      const double left = 1.0 - alpha * variance * solved->diagonal[i];
      fit.sigma_[i] = static_cast<float>(s * std::sqrt(variance * std::max(0.0, left)));
    }
  }
  return fit;
}

void LocalFit::Store(const System& system, const Eigen::VectorXd& solution) {
  kernel_ = system.kernel;
  middle_ = system.middle.cast<float>();
  scale_ = static_cast<float>(system.scale);
  polynomial_ = system.polynomial.cast<float>();
  const Quadratics& q = system.quadratic;
  Eigen::Matrix3d form;
  form << q[0], q[3] / M_SQRT2, q[4] / M_SQRT2,  //
      q[3] / M_SQRT2, q[1], q[5] / M_SQRT2,      //
      q[4] / M_SQRT2, q[5] / M_SQRT2, q[2];
  quadratic_ = form.cast<float>();
  std::size_t num_slopes = 0;
  for (const Functional& f : system.functionals) num_slopes += f.is_slope ? 1U : 0U;
  const auto padded = [](std::size_t count) {
    return static_cast<Eigen::Index>((count + kLanes - 1) / kLanes * kLanes);
  };
  for (Lanes* lanes : {&value_x_, &value_y_, &value_z_, &lambda_}) {
    lanes->setZero(padded(system.functionals.size() - num_slopes));
  }
  for (Lanes* lanes : {&slope_x_, &slope_y_, &slope_z_, &m_x_, &m_y_, &m_z_}) {
    lanes->setZero(padded(num_slopes));
  }
  Eigen::Index values = 0;
  Eigen::Index slopes = 0;
  for (std::size_t i = 0; i < system.functionals.size(); ++i) {
    const Functional& f = system.functionals[i];
    const double weight = solution[static_cast<Eigen::Index>(i)];
    const Eigen::Vector3f point = f.point.cast<float>();
    if (f.is_slope) {
      const Eigen::Vector3f m = (weight * f.direction).cast<float>();
      slope_x_[slopes] = point.x(), slope_y_[slopes] = point.y(), slope_z_[slopes] = point.z();
      m_x_[slopes] = m.x(), m_y_[slopes] = m.y(), m_z_[slopes] = m.z();
      ++slopes;
    } else {
      value_x_[values] = point.x(), value_y_[values] = point.y(), value_z_[values] = point.z();
      lambda_[values] = static_cast<float>(weight);
      ++values;
    }
  }
}

FitValue LocalFit::At(const Eigen::Vector3f& point) const {
  const Eigen::Vector3f u = (point - middle_) / scale_;
  LaneArray value = LaneArray::Zero();
  LaneArray gx = LaneArray::Zero();
  LaneArray gy = LaneArray::Zero();
  LaneArray gz = LaneArray::Zero();
  for (Eigen::Index k = 0; k < lambda_.size(); k += kLanes) {
    const LaneArray ex = u.x() - value_x_.segment<kLanes>(k);
    const LaneArray ey = u.y() - value_y_.segment<kLanes>(k);
    const LaneArray ez = u.z() - value_z_.segment<kLanes>(k);
    const LaneRadial radial = RadialLanes(kernel_, ex * ex + ey * ey + ez * ez);
    const LaneArray weight = lambda_.segment<kLanes>(k);
    value += weight * radial.phi;
    const LaneArray along = weight * radial.a;
    gx += along * ex;
    gy += along * ey;
    gz += along * ez;
  }
  for (Eigen::Index k = 0; k < m_x_.size(); k += kLanes) {
    const LaneArray ex = u.x() - slope_x_.segment<kLanes>(k);
    const LaneArray ey = u.y() - slope_y_.segment<kLanes>(k);
    const LaneArray ez = u.z() - slope_z_.segment<kLanes>(k);
    const LaneRadial radial = RadialLanes(kernel_, ex * ex + ey * ey + ez * ez);
    const LaneArray mx = m_x_.segment<kLanes>(k);
    const LaneArray my = m_y_.segment<kLanes>(k);
    const LaneArray mz = m_z_.segment<kLanes>(k);
    const LaneArray dot = mx * ex + my * ey + mz * ez;
    value -= radial.a * dot;
    const LaneArray along = radial.b * dot;
    gx -= radial.a * mx + along * ex;
    gy -= radial.a * my + along * ey;
    gz -= radial.a * mz + along * ez;
  }
  FitValue result;
  const Eigen::Vector3f bent = quadratic_ * u;
  result.value =
      scale_ * (value.sum() + polynomial_[0] + polynomial_.tail<3>().dot(u) + bent.dot(u));
  result.gradient =
      Eigen::Vector3f(gx.sum(), gy.sum(), gz.sum()) + polynomial_.tail<3>() + 2.0F * bent;
  return result;
}

std::size_t LocalFit::MemoryBytes() const {
  const auto lanes = static_cast<std::size_t>(4 * lambda_.size() + 6 * m_x_.size());
  return lanes * sizeof(float) + sizeof(LocalFit) + 16 * 10;
}

}  // namespace fringe_fusion::internal
