#include "pair_search.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "at.hpp"
#include "common/constants.hpp"
#include "common/dense.hpp"
#include "fringe_fusion/registration/pose_system.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr float kMinBaseCells = 4.0F;    // between the two points of a trial
constexpr float kMaxLengthCells = 1.0F;  // difference of their distances in both views
constexpr float kMaxCosine = 0.2F;       // difference of their angles in both views
constexpr float kPartnerCells = 1.5F;    // of a partner that supports a trial
constexpr std::size_t kCandidates = 16;  // trials that are checked by overlap and free space
constexpr int kIterations = 8;           // of the refinement

struct Trial {
  Transform T_first_second = Transform::Identity();
  int support = 0;
};

// Frame of two oriented points: x along their line, z towards their normals.
bool FrameOf(const Eigen::Vector3f& line, const Eigen::Vector3f& normals, Eigen::Matrix3f& frame) {
  const Eigen::Vector3f z = normals - line * line.dot(normals);
  if (!(z.norm() > 0.3F)) return false;
  frame.col(0) = line;
  frame.col(2) = z.normalized();
  frame.col(1) = frame.col(2).cross(line);
  return true;
}

class Trials {
 public:
  Trials(const FeatureCloud& first, const FeatureCloud& second, const AssemblyConfig& config,
         double cell_m, unsigned seed)
      : first_(first),
        second_(second),
        config_(config),
        cell_(static_cast<float>(cell_m)),
        random_(seed),
        matches_(MatchFeatures(first, second, config.num_partners)) {}

  // The trials with the most support, no two of them alike.
  std::vector<Trial> Best() {
    std::vector<Trial> best;
    if (matches_.size() < 2) return best;
    for (int i = 0; i < config_.max_trials; ++i) {
      const FeatureMatch& a = matches_[random_() % matches_.size()];
      const FeatureMatch& b = matches_[random_() % matches_.size()];
      Trial trial;
      if (!Fit(a, b, trial)) continue;
      trial.support = Support(trial.T_first_second);
      Insert(trial, best);
    }
    return best;
  }

 private:
  // Pose of two oriented points in both views; false where their distances and angles differ.
  bool Fit(const FeatureMatch& a, const FeatureMatch& b, Trial& trial) const {
    const Eigen::Vector3f& p_a = first_.points[At(a.first)];
    const Eigen::Vector3f& p_b = first_.points[At(b.first)];
    const Eigen::Vector3f& q_a = second_.points[At(a.second)];
    const Eigen::Vector3f& q_b = second_.points[At(b.second)];
    const float length_p = (p_b - p_a).norm();
    const float length_q = (q_b - q_a).norm();
    if (!(length_p > kMinBaseCells * cell_)) return false;
    if (!(std::abs(length_p - length_q) < kMaxLengthCells * cell_)) return false;
    const Eigen::Vector3f d_p = (p_b - p_a) / length_p;
    const Eigen::Vector3f d_q = (q_b - q_a) / length_q;
    const Eigen::Vector3f& n_pa = first_.normals[At(a.first)];
    const Eigen::Vector3f& n_pb = first_.normals[At(b.first)];
    const Eigen::Vector3f& n_qa = second_.normals[At(a.second)];
    const Eigen::Vector3f& n_qb = second_.normals[At(b.second)];
    if (!(std::abs(n_pa.dot(n_pb) - n_qa.dot(n_qb)) < kMaxCosine)) return false;
    if (!(std::abs(n_pa.dot(d_p) - n_qa.dot(d_q)) < kMaxCosine)) return false;
    if (!(std::abs(n_pb.dot(d_p) - n_qb.dot(d_q)) < kMaxCosine)) return false;
    Eigen::Matrix3f F_p;
    Eigen::Matrix3f F_q;
    if (!FrameOf(d_p, n_pa + n_pb, F_p) || !FrameOf(d_q, n_qa + n_qb, F_q)) return false;
    const Eigen::Matrix3f R = F_p * F_q.transpose();
    if (!(n_pa.dot(R * n_qa) > 0.9F) || !(n_pb.dot(R * n_qb) > 0.9F)) return false;
    trial.T_first_second = Transform::Identity();
    trial.T_first_second.linear() = R.cast<double>();
    trial.T_first_second.translation() =
        (0.5F * (p_a + p_b) - R * (0.5F * (q_a + q_b))).cast<double>();
    return true;
  }

  [[nodiscard]] int Support(const Transform& T_first_second) const {
    const Eigen::Matrix3f R = T_first_second.linear().cast<float>();
    const Eigen::Vector3f t = T_first_second.translation().cast<float>();
    const float limit = kPartnerCells * kPartnerCells * cell_ * cell_;
    int support = 0;
    for (const FeatureMatch& match : matches_) {
      const Eigen::Vector3f q = R * second_.points[At(match.second)] + t;
      if ((q - first_.points[At(match.first)]).squaredNorm() > limit) continue;
      if (first_.normals[At(match.first)].dot(R * second_.normals[At(match.second)]) > 0.85F) {
        ++support;
      }
    }
    return support;
  }

  [[nodiscard]] bool Alike(const Trial& a, const Trial& b) const {
    const Transform T = a.T_first_second.inverse() * b.T_first_second;
    const Eigen::Vector3d middle = second_.points[second_.points.size() / 2].cast<double>();
    return LogRotation(T.linear()).norm() < 10.0 * kRadPerDeg &&
           (T * middle - middle).norm() < 4.0 * static_cast<double>(cell_);
  }

  void Insert(const Trial& trial, std::vector<Trial>& best) const {
    if (best.size() == kCandidates && trial.support <= best.back().support) return;
    const auto alike = std::find_if(best.begin(), best.end(),
                                    [&](const Trial& other) { return Alike(trial, other); });
    if (alike != best.end()) {
      if (trial.support <= alike->support) return;
      best.erase(alike);
    }
    const auto at = std::find_if(best.begin(), best.end(),
                                 [&](const Trial& other) { return other.support < trial.support; });
    best.insert(at, trial);
    if (best.size() > kCandidates) best.pop_back();
  }

  const FeatureCloud& first_;
  const FeatureCloud& second_;
  const AssemblyConfig& config_;
  float cell_;
  std::mt19937 random_;
  std::vector<FeatureMatch> matches_;
};

// Point to plane on the coarsest level, with a search radius that shrinks from three cells to one.
Transform Refine(const SurfaceSet& set, const PairNumbers& pair, const Transform& T_first_second,
                 double cell_m, double max_normal_angle_rad) {
  std::vector<Transform> poses(set.surfaces.size(), Transform::Identity());
  poses[At(pair.second)] = T_first_second;
  MatchLimits limits;
  limits.max_normal_angle_rad = max_normal_angle_rad;
  for (int i = 0; i < kIterations; ++i) {
    limits.radius_m = cell_m * (i < kIterations / 2 ? 3.0 : 1.5);
    const MatchSet matches = MatchViews(set, poses, {pair}, limits);
    if (!matches.pairs.front().counts) break;
    const PairInformation sum = SumPair(matches.pairs.front(), set, poses);
    // Twist of the first view in the frame of the object: the second one moves the other way.
    const Matrix6d damped = sum.hessian + 1e-6 * sum.hessian.trace() * Matrix6d::Identity();
    const Vector6d y = -dense::SolveSymmetric(damped, sum.gradient);
    const Vector6d twist = dense::Solve(sum.S, y);
    if (!twist.allFinite()) break;
    poses[At(pair.second)] = Exp(-twist) * poses[At(pair.second)];
  }
  return poses[At(pair.second)];
}

}  // namespace

double AgreementDistance(const SurfaceSet& set, double cell_m) {
  return std::max(0.4 * cell_m, set.max_spacing_m);
}

std::vector<Hypothesis> SearchPair(const SurfaceSet& set, const std::vector<FeatureCloud>& clouds,
                                   const PairNumbers& pair, const AssemblyConfig& config,
                                   double cell_m) {
  const auto seed = static_cast<unsigned>(config.seed) +
                    1000003U * static_cast<unsigned>(pair.first) +
                    static_cast<unsigned>(pair.second);
  Trials trials(clouds[At(pair.first)], clouds[At(pair.second)], config, cell_m, seed);
  const ViewSurface& first = set.surfaces[At(pair.first)];
  const ViewSurface& second = set.surfaces[At(pair.second)];
  const double distance_m = AgreementDistance(set, cell_m);
  const auto better = [](const Hypothesis& a, const Hypothesis& b) {
    return a.check.evidence > b.check.evidence;
  };
  std::vector<Hypothesis> found;
  for (const Trial& trial : trials.Best()) {
    Hypothesis one{pair.first, pair.second, trial.T_first_second, {}};
    one.check = CheckPair(first, second, trial.T_first_second, 2.0 * distance_m);
    found.push_back(one);
  }
  std::stable_sort(found.begin(), found.end(), better);
  if (found.size() > At(config.num_hypotheses)) found.resize(At(config.num_hypotheses));
  for (Hypothesis& one : found) {
    one.T_first_second =
        Refine(set, pair, one.T_first_second, cell_m, config.max_normal_angle_deg * kRadPerDeg);
    one.check = CheckPair(first, second, one.T_first_second, distance_m);
  }
  std::stable_sort(found.begin(), found.end(), better);
  return found;
}

}  // namespace fringe_fusion::internal
