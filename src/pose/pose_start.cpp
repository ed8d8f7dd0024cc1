#include "pose_start.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <random>

#include "common/dense.hpp"

namespace fringe_fusion::epipolar {
namespace {

constexpr double kSameRad = 1e-3;

/// Reproducible choice of distinct indices.
class Sampler {
 public:
  explicit Sampler(std::size_t count) : count_(count) {}

  template <std::size_t N>
  std::array<std::size_t, N> Draw() {
    std::array<std::size_t, N> out{};
    for (std::size_t k = 0; k < N; ++k) {
      do {
        out[k] = static_cast<std::size_t>(engine_()) % count_;
      } while (std::find(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(k), out[k]) !=
               out.begin() + static_cast<std::ptrdiff_t>(k));
    }
    return out;
  }

 private:
  std::mt19937 engine_{20260101U};
  std::size_t count_;
};

struct Hypothesis {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  double score = std::numeric_limits<double>::infinity();
};

/// Draws needed until one sample of `size` is free of outliers with probability 0.999.
int NeededDraws(double inlier_ratio, int size) {
  const double clean = std::max(1e-6, std::pow(inlier_ratio, size));
  if (clean > 0.999) return 1;
  return static_cast<int>(std::ceil(std::log(1e-3) / std::log(1.0 - clean)));
}

/// Share of values within three stated deviations: a model that fits nothing earns no early end.
double InlierRatio(const std::vector<double>& values) {
  constexpr double kInlierSigma = 3.0;
  const auto count = std::count_if(values.begin(), values.end(),
                                   [](double value) { return value <= kInlierSigma; });
  return static_cast<double>(count) / static_cast<double>(values.size());
}

std::vector<Eigen::Matrix3d> SolveFivePoint(const std::vector<Ray>& rays,
                                            const std::array<std::size_t, 5>& sample) {
  std::vector<cv::Point2d> anchor;
  std::vector<cv::Point2d> observed;
  for (const std::size_t i : sample) {
    anchor.emplace_back(rays[i].anchor.x(), rays[i].anchor.y());
    observed.emplace_back(rays[i].observed.x(), rays[i].observed.y());
  }
  std::vector<Eigen::Matrix3d> out;
  try {
    const cv::Mat stacked =
        cv::findEssentialMat(anchor, observed, cv::Mat::eye(3, 3, CV_64F), cv::RANSAC, 0.999, 1.0);
    for (int row = 0; row + 3 <= stacked.rows; row += 3) {
      Eigen::Matrix3d essential;
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) essential(r, c) = stacked.at<double>(row + r, c);
      }
      if (essential.allFinite() && essential.norm() > 0.0) out.push_back(essential);
    }
  } catch (const cv::Exception&) {
    out.clear();  // a degenerate sample
  }
  return out;
}

/// Weighted residual of a homography, both components whitened.
double PlaneResidual(const Ray& ray, const Eigen::Matrix3d& H) {
  const Eigen::Vector3d mapped = H * ray.anchor.homogeneous();
  const Eigen::Vector2d d = ray.observed - mapped.head<2>() / mapped.z();
  return std::sqrt(d.dot(ray.covariance.inverse() * d));
}

/// Linear homography from weighted matches in normalised frames (Hartley & Zisserman, alg. 4.2).
Eigen::Matrix3d SolveHomography(const std::vector<Ray>& rays, const std::vector<double>& weights) {
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Eigen::Vector3d a = rays[i].anchor.homogeneous();
    Eigen::Matrix<double, 2, 9> rows = Eigen::Matrix<double, 2, 9>::Zero();
    rows.block<1, 3>(0, 0) = a.transpose();
    rows.block<1, 3>(0, 6) = -rays[i].observed.x() * a.transpose();
    rows.block<1, 3>(1, 3) = a.transpose();
    rows.block<1, 3>(1, 6) = -rays[i].observed.y() * a.transpose();
    normal += weights[i] * rows.transpose() * rows;
  }
  const Eigen::Matrix<double, 9, 1> h = dense::DecomposeSymmetric(normal).vectors.col(0);
  Eigen::Matrix3d H;
  H << h.segment<3>(0).transpose(), h.segment<3>(3).transpose(), h.segment<3>(6).transpose();
  return H;
}

double MedianPlaneResidual(const std::vector<Ray>& rays, const Eigen::Matrix3d& H,
                           std::vector<double>& residuals) {
  residuals.clear();
  for (const Ray& ray : rays) residuals.push_back(PlaneResidual(ray, H));
  std::vector<double> copy = residuals;
  return MedianInPlace(copy);
}

Eigen::Matrix3d FourPointHomography(const std::vector<Ray>& rays) {
  Sampler sampler(rays.size());
  Hypothesis best;
  std::vector<double> residuals;
  constexpr int kMaxDraws = 50;  // clean with probability 0.999 up to 40 % outliers
  int needed = kMaxDraws;
  for (int draw = 0; draw < needed; ++draw) {
    std::vector<Ray> sample;
    for (const std::size_t i : sampler.Draw<4>()) sample.push_back(rays[i]);
    const Eigen::Matrix3d H = SolveHomography(sample, std::vector<double>(4, 1.0));
    const double score = MedianPlaneResidual(rays, H, residuals);
    if (!(score < best.score)) continue;
    best = {H, score};
    needed = std::clamp(NeededDraws(InlierRatio(residuals), 4), 12, kMaxDraws);
  }
  return best.matrix;
}

}  // namespace

std::vector<Ray> Thin(const std::vector<Ray>& rays, std::size_t max_count) {
  const std::size_t step = std::max<std::size_t>(1, (rays.size() + max_count - 1) / max_count);
  std::vector<Ray> out;
  for (std::size_t i = step / 2; i < rays.size(); i += step) out.push_back(rays[i]);
  return out;
}

bool IsSame(const Geometry& a, const Geometry& b) {
  return LogRotation(a.R.transpose() * b.R).norm() < kSameRad &&
         std::atan2(a.t.cross(b.t).norm(), a.t.dot(b.t)) < kSameRad;
}

double RotationOnlyResidual(const std::vector<Ray>& rays) {
  std::vector<double> residuals(rays.size(), 0.0);
  double median = std::numeric_limits<double>::infinity();
  double limit = std::numeric_limits<double>::infinity();
  for (int round = 0; round < 4; ++round) {
    // Wahba's problem on unit rays (Kabsch), outliers of the round before left out.
    Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (!(residuals[i] <= limit)) continue;
      correlation += rays[i].observed.homogeneous().normalized() *
                     rays[i].anchor.homogeneous().normalized().transpose();
    }
    const dense::SingularValues svd = dense::DecomposeSingular(correlation);
    const Eigen::Matrix3d U = svd.U;
    const Eigen::Matrix3d V = svd.V;
    Eigen::Vector3d signs = Eigen::Vector3d::Ones();
    signs.z() = (U * V.transpose()).determinant();
    const Eigen::Matrix3d R = U * signs.asDiagonal() * V.transpose();
    median = MedianPlaneResidual(rays, R, residuals);
    limit = 2.5 * 1.4826 * median;
  }
  return median;
}

double CheiralityRatio(const std::vector<Ray>& rays, const Geometry& geometry) {
  if (rays.empty()) return 0.0;
  const auto count = std::count_if(rays.begin(), rays.end(), [&](const Ray& ray) {
    return (Depths(ray, geometry).array() > 0.0).all();
  });
  return static_cast<double>(count) / static_cast<double>(rays.size());
}

Geometry DecomposeEssential(const Eigen::Matrix3d& essential, const std::vector<Ray>& rays) {
  const dense::SingularValues svd = dense::DecomposeSingular(essential);
  Eigen::Matrix3d U = svd.U;
  Eigen::Matrix3d V = svd.V;
  if (U.determinant() < 0.0) U.col(2) *= -1.0;
  if (V.determinant() < 0.0) V.col(2) *= -1.0;
  Eigen::Matrix3d W;
  W << 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0;
  Geometry best;
  double best_ratio = -1.0;
  for (const bool transposed : {false, true}) {
    for (const double sign : {1.0, -1.0}) {
      Geometry geometry;
      geometry.R = U * (transposed ? Eigen::Matrix3d(W.transpose()) : W) * V.transpose();
      geometry.t = sign * U.col(2);
      const double ratio = CheiralityRatio(rays, geometry);
      if (ratio <= best_ratio) continue;
      best_ratio = ratio;
      best = geometry;
    }
  }
  return best;
}

std::vector<Geometry> FivePointStarts(const std::vector<Ray>& rays, int max_starts) {
  // Minimal samples of a narrow field amplify noise: at least kMinDraws, however clean they are.
  constexpr int kMinDraws = 10;
  constexpr int kMaxDraws = 85;  // clean with probability 0.999 up to 40 % outliers
  if (rays.size() < 6) return {};
  Sampler sampler(rays.size());
  std::vector<Hypothesis> kept;
  std::vector<double> residuals(rays.size());
  double best = std::numeric_limits<double>::infinity();
  int needed = kMaxDraws;
  for (int draw = 0; draw < needed; ++draw) {
    for (const Eigen::Matrix3d& essential : SolveFivePoint(rays, sampler.Draw<5>())) {
      for (std::size_t i = 0; i < rays.size(); ++i) {
        residuals[i] = std::abs(Residual(rays[i], essential));
      }
      std::vector<double> copy = residuals;
      const double score = MedianInPlace(copy);
      if (!std::isfinite(score)) continue;
      kept.push_back({essential, score});
      if (!(score < best)) continue;
      best = score;
      needed = std::clamp(NeededDraws(InlierRatio(residuals), 5), kMinDraws, kMaxDraws);
    }
  }
  std::stable_sort(kept.begin(), kept.end(),
                   [](const Hypothesis& a, const Hypothesis& b) { return a.score < b.score; });
  std::vector<Geometry> starts;
  for (const Hypothesis& hypothesis : kept) {
    if (static_cast<int>(starts.size()) >= max_starts) break;
    const Geometry geometry = DecomposeEssential(hypothesis.matrix, rays);
    const bool known = std::any_of(starts.begin(), starts.end(),
                                   [&](const Geometry& other) { return IsSame(geometry, other); });
    if (!known) starts.push_back(geometry);
  }
  return starts;
}

PlaneFit FitPlane(const std::vector<Ray>& rays) {
  PlaneFit fit;
  if (rays.size() < 8) return fit;
  const std::vector<Ray> sample = Thin(rays, 300);
  fit.H = FourPointHomography(sample);
  std::vector<double> residuals;
  double median = MedianPlaneResidual(rays, fit.H, residuals);
  for (int round = 0; round < 3 && std::isfinite(median); ++round) {
    std::vector<double> weights;
    const double limit = 2.5 * std::max(1.0, 1.4826 * median);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const double w = (fit.H * rays[i].anchor.homogeneous()).z();
      const double variance = 0.5 * rays[i].covariance.trace() * w * w;
      weights.push_back(residuals[i] < limit && variance > 0.0 ? 1.0 / variance : 0.0);
    }
    const Eigen::Matrix3d H = SolveHomography(rays, weights);
    const double next = MedianPlaneResidual(rays, H, residuals);
    if (!(next < median)) break;
    fit.H = H;
    median = next;
  }
  fit.median_sigma = median;
  fit.valid = std::isfinite(median);
  return fit;
}

bool PrefersPlane(const std::vector<Ray>& rays, const Eigen::Matrix3d& H,
                  const Eigen::Matrix3d& essential, double scale) {
  constexpr double kDimension = 4.0;  // of the data: two pixels
  const double n = static_cast<double>(rays.size());
  const auto gric = [&](double sum, double manifold, double parameters) {
    return sum + std::log(kDimension) * manifold * n + std::log(kDimension * n) * parameters;
  };
  double plane = 0.0;
  double lines = 0.0;
  for (const Ray& ray : rays) {
    const double p = PlaneResidual(ray, H) / scale;
    const double l = Residual(ray, essential) / scale;
    plane += std::min(p * p, 2.0 * (kDimension - 2.0));
    lines += std::min(l * l, 2.0 * (kDimension - 3.0));
  }
  return gric(plane, 2.0, 8.0) < gric(lines, 3.0, 5.0);
}

std::vector<Geometry> HomographyStarts(const Eigen::Matrix3d& H, const std::vector<Ray>& rays) {
  std::vector<Geometry> starts;
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  std::vector<cv::Mat> normals;
  try {
    cv::Mat homography(3, 3, CV_64F);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) homography.at<double>(r, c) = H(r, c);
    }
    cv::decomposeHomographyMat(homography, cv::Mat::eye(3, 3, CV_64F), rotations, translations,
                               normals);
  } catch (const cv::Exception&) {
    return starts;
  }
  for (std::size_t k = 0; k < rotations.size(); ++k) {
    Geometry geometry;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) geometry.R(r, c) = rotations[k].at<double>(r, c);
      geometry.t[r] = translations[k].at<double>(r);
    }
    if (!geometry.R.allFinite() || !(geometry.t.norm() > 1e-9)) continue;
    geometry.t.normalize();
    if (CheiralityRatio(rays, geometry) < 0.5) continue;
    const bool known = std::any_of(starts.begin(), starts.end(),
                                   [&](const Geometry& other) { return IsSame(geometry, other); });
    if (!known) starts.push_back(geometry);
  }
  return starts;
}

std::vector<Geometry> MakeStarts(const std::vector<Ray>& sample, const PlaneFit& plane,
                                 const std::optional<Geometry>& prior) {
  constexpr std::size_t kScoringRays = 400;
  constexpr int kMaxFivePointStarts = 5;
  std::vector<Geometry> starts = FivePointStarts(Thin(sample, kScoringRays), kMaxFivePointStarts);
  if (plane.valid) {
    for (const Geometry& start : HomographyStarts(plane.H, sample)) {
      starts.push_back(start);
    }
  }
  if (prior) starts.push_back(*prior);
  return starts;
}

}  // namespace fringe_fusion::epipolar
