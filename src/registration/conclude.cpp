// What a solution says about every view, in figures and in words.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "at.hpp"
#include "common/constants.hpp"
#include "common/dense.hpp"
#include "fringe_fusion/registration/doubled_surface.hpp"
#include "fringe_fusion/registration/weak_directions.hpp"
#include "registration.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr double kMinShare = 0.1;       // of a direction's information, for a source to be named
constexpr double kContradiction = 3.0;  // standard deviations
constexpr double kWideRejection = 15.0;
constexpr std::size_t kMaxDoubled = 5;  // warnings

double RmsSigma(const Vector6d& e, const Matrix6d& information) {
  return std::sqrt(std::max(0.0, e.dot(information * e)) / 6.0);
}

std::string NameOf(const View& view) {
  return view.name.empty() ? fmt::format("view {}", view.id)
                           : fmt::format("view {} ({})", view.id, view.name);
}

// Accepted residuals of a view's samples.
struct ViewSums {
  double squares = 0.0;
  int residuals = 0;
  std::vector<bool> partnered;
};

std::vector<ViewSums> SumResiduals(const MatchSet& matches, const SurfaceSet& set) {
  std::vector<ViewSums> sums(set.surfaces.size());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    sums[i].partnered.assign(set.surfaces[i].points().size(), false);
  }
  const auto add = [&](int view, const std::vector<Match>& of) {
    for (const Match& match : of) {
      const double residual = match.residual_m;
      sums[At(view)].squares += residual * residual;
      ++sums[At(view)].residuals;
      sums[At(view)].partnered[At(match.source)] = true;
    }
  };
  for (const ViewPair& pair : matches.pairs) {
    if (!pair.counts) continue;
    add(pair.first, pair.from_first);
    add(pair.second, pair.from_second);
  }
  return sums;
}

// Number of the group of views that surfaces connect; -1: alone.
std::vector<int> GroupsOf(const MatchSet& matches, std::size_t num_views) {
  std::vector<int> root(num_views);
  std::iota(root.begin(), root.end(), 0);
  std::vector<bool> connected(num_views, false);
  const auto find = [&](int i) {
    while (root[At(i)] != i) i = root[At(i)];
    return i;
  };
  for (const ViewPair& pair : matches.pairs) {
    if (!pair.counts) continue;
    connected[At(pair.first)] = connected[At(pair.second)] = true;
    const int a = find(pair.first);
    const int b = find(pair.second);
    root[At(std::max(a, b))] = std::min(a, b);
  }
  std::vector<int> groups(num_views);
  for (std::size_t i = 0; i < num_views; ++i) {
    groups[i] = connected[i] ? find(static_cast<int>(i)) : -1;
  }
  return groups;
}

// One source of information about one view: right perturbations.
struct Source {
  std::string name;
  Matrix6d information = Matrix6d::Zero();
};

std::string NameSources(const std::vector<Source>& sources, double radius_m,
                        const Eigen::Vector3d& middle) {
  Matrix6d total = Matrix6d::Zero();
  for (const Source& source : sources) total += source.information;
  Matrix6d B = Matrix6d::Identity();
  B.topLeftCorner<3, 3>() /= std::max(radius_m, 1e-9);
  B.bottomLeftCorner<3, 3>() = Hat(middle) / std::max(radius_m, 1e-9);
  const dense::SymmetricEigen eigen = dense::DecomposeSymmetric(B.transpose() * total * B);
  const Vector6d root = eigen.values.cwiseMax(1e-12 * eigen.values[5]).cwiseSqrt().cwiseInverse();
  const Matrix6d axes = eigen.vectors;
  const Matrix6d whiten = B * axes * root.asDiagonal();
  std::string names;
  for (const Source& source : sources) {
    const Vector6d shares =
        dense::SymmetricEigenvalues(whiten.transpose() * source.information * whiten);
    if (!(shares[5] >= kMinShare)) continue;
    names += (names.empty() ? "" : " + ") + source.name;
  }
  return names;
}

class Conclusion {
 public:
  Conclusion(const Registration& registration, const ViewGraph& graph, const SurfaceSet& set)
      : registration_(registration),
        graph_(graph),
        set_(set),
        sums_(SumResiduals(registration.matches(), set)),
        groups_(GroupsOf(registration.matches(), graph.views.size())) {}

  RegistrationResult Make() {
    out_.iterations = registration_.iterations();
    out_.converged = registration_.converged();
    for (std::size_t i = 0; i < graph_.views.size(); ++i) out_.views.push_back(ViewOf(i));
    WarnGroups();
    WarnTies();
    WarnChain();
    WarnDoubled();
    if (!out_.converged) {
      out_.warnings.push_back(
          fmt::format("not converged after {} iterations", registration_.iterations()));
    }
    return std::move(out_);
  }

 private:
  [[nodiscard]] bool Tied(int view) const {
    const PoseTerms& terms = registration_.terms();
    const bool tie = std::any_of(terms.ties.begin(), terms.ties.end(), [&](const PoseTie& one) {
      return one.first == view || one.second == view;
    });
    const bool chain =
        terms.chain && std::count(terms.chain->views.begin(), terms.chain->views.end(), view) > 0;
    return tie || chain;
  }

  RegisteredView ViewOf(std::size_t i) {
    const auto number = static_cast<int>(i);
    const PoseConstraint& constraint = registration_.terms().constraints[i];
    RegisteredView view;
    view.id = graph_.views[i].id;
    view.pose = graph_.views[i].pose;
    view.connected = groups_[i] >= 0;
    if (view.connected) {
      const auto samples =
          static_cast<double>(set_.surfaces[i].samples(ViewSurface::kNumLevels - 1).size());
      const auto partnered = std::count(sums_[i].partnered.begin(), sums_[i].partnered.end(), true);
      view.overlap_ratio = static_cast<double>(partnered) / samples;
      view.rms_m = std::sqrt(sums_[i].squares / std::max(1, sums_[i].residuals));
      if (constraint.held) view.pose.covariance.setZero();  // the others are relative to it
    }
    view.information = constraint.held ? "held" : "prior";
    if ((view.connected || Tied(number)) && !constraint.held) {
      view.pose.T_object_camera = registration_.state().poses[i];
      view.pose.covariance = registration_.covariances()[i];
      view.pose.source = PoseSource::kRegistration;
      Explain(number, view);
    }
    ComparePrior(i, view);
    return view;
  }

  void Explain(int number, RegisteredView& view) {
    const Transform& T = view.pose.T_object_camera;
    const ViewSurface& surface = set_.surfaces[At(number)];
    const Matrix6d A = Adjoint(T);
    const Matrix6d object = SurfaceInformation(registration_.information(), number);
    std::vector<Source> sources = {
        {"surface", A.transpose() * object * A / registration_.data_scale()}};
    AddDevices(number, sources);
    view.information = NameSources(sources, surface.radius_m(), surface.centroid());
    if (!view.connected) return;
    view.weak_directions =
        Describe(FindWeakDirections(object, T * surface.centroid(), surface.radius_m()));
    if (view.weak_directions.empty()) return;
    out_.warnings.push_back(fmt::format("{}: the surfaces leave it free in {}; there it follows {}",
                                        NameOf(graph_.views[At(number)]), view.weak_directions,
                                        sources.size() > 1 ? "the priors" : "its start"));
  }

  void AddDevices(int number, std::vector<Source>& sources) const {
    const PoseTerms& terms = registration_.terms();
    const PoseState& state = registration_.state();
    const PoseConstraint& constraint = terms.constraints[At(number)];
    if (constraint.has_prior) sources.push_back({"prior", constraint.information});
    Source ties{"tie", Matrix6d::Zero()};
    for (const PoseTie& tie : terms.ties) {
      if (tie.second == number) ties.information += tie.information;
      if (tie.first != number) continue;
      const Matrix6d A = Adjoint(tie.T_first_second.inverse());
      ties.information += A.transpose() * tie.information * A;
    }
    if (ties.information.norm() > 0.0) sources.push_back(ties);
    if (terms.chain && std::count(terms.chain->views.begin(), terms.chain->views.end(), number)) {
      sources.push_back({graph_.chain->name, ChainInformation(*terms.chain, state)});
    }
  }

  void ComparePrior(std::size_t i, RegisteredView& view) {
    const PoseConstraint& constraint = registration_.terms().constraints[i];
    const Transform moved =
        constraint.T_object_camera_prior.inverse() * registration_.state().poses[i];
    const Eigen::Vector3d middle = set_.surfaces[i].centroid();
    view.prior_shift_m = (moved * middle - middle).norm();
    view.prior_turn_rad = LogRotation(moved.linear()).norm();
    if (!constraint.has_prior) return;
    view.prior_sigma = RmsSigma(Log(moved), constraint.information);
    if (!(view.prior_sigma > kContradiction)) return;
    out_.warnings.push_back(fmt::format(
        "{}: its given pose ({}) is {:.3f} mm and {:.3f} deg off, {:.1f} standard deviations",
        NameOf(graph_.views[i]), PoseSourceName(graph_.views[i].pose.source),
        1e3 * view.prior_shift_m, kDegPerRad * view.prior_turn_rad, view.prior_sigma));
  }

  void WarnGroups() {
    std::vector<int> roots;
    for (std::size_t i = 0; i < groups_.size(); ++i) {
      if (groups_[i] < 0) {
        out_.warnings.push_back(fmt::format(
            "{} shares no surface with any other view: {}", NameOf(graph_.views[i]),
            Tied(static_cast<int>(i)) ? "its ties alone place it" : "it keeps its given pose"));
      } else if (groups_[i] == static_cast<int>(i)) {
        roots.push_back(groups_[i]);
      }
    }
    if (roots.size() < 2) return;
    std::string list;
    for (const int root : roots) {
      list += list.empty() ? "" : " | ";
      for (std::size_t i = 0; i < groups_.size(); ++i) {
        if (groups_[i] == root) list += fmt::format("{} ", graph_.views[i].id);
      }
      list.pop_back();
    }
    out_.warnings.push_back(fmt::format(
        "the views fall into {} groups that share no surface: {}; only given poses tie them",
        roots.size(), list));
  }

  void WarnTies() {
    const PoseTerms& terms = registration_.terms();
    for (std::size_t k = 0; k < terms.ties.size(); ++k) {
      const Vector6d e = TieResidual(terms.ties[k], registration_.state());
      const double sigma = RmsSigma(e, terms.ties[k].information);
      if (!(sigma > kContradiction)) continue;
      out_.warnings.push_back(fmt::format(
          "the tie of views {} and {} ({}) leaves a loop error of {:.3f} mm and {:.3f} deg, {:.1f} "
          "standard deviations",
          graph_.ties[k].first, graph_.ties[k].second, PoseSourceName(graph_.ties[k].source),
          1e3 * e.tail<3>().norm(), kDegPerRad * e.head<3>().norm(), sigma));
    }
  }

  void WarnChain() {
    const PoseTerms& terms = registration_.terms();
    if (!terms.chain) return;
    const PoseState& state = registration_.state();
    SolvedChain chain;
    chain.name = graph_.chain->name;
    chain.T_object_base = state.T_object_base;
    chain.T_flange_camera = state.T_flange_camera;
    chain.covariance_object_base = registration_.step().covariance_chain[0];
    chain.covariance_flange_camera = registration_.step().covariance_chain[1];
    const Matrix6d information = ChainInformation(*terms.chain, state);
    double squares = 0.0;
    for (std::size_t k = 0; k < terms.chain->views.size(); ++k) {
      const Vector6d e = ChainResidual(*terms.chain, k, state);
      const double sigma = RmsSigma(e, information);
      squares += sigma * sigma;
      if (!(sigma > kContradiction)) continue;
      out_.warnings.push_back(fmt::format(
          "{} at view {}: the reading is {:.3f} mm and {:.3f} deg off, {:.1f} standard deviations",
          chain.name, graph_.chain->readings[k].view, 1e3 * e.tail<3>().norm(),
          kDegPerRad * e.head<3>().norm(), sigma));
    }
    chain.rms_sigma = std::sqrt(squares / static_cast<double>(terms.chain->views.size()));
    out_.chain = chain;
  }

  // Residuals far beyond the rejection limit count here: a second layer is one to the iteration.
  void WarnDoubled() {
    MatchLimits limits;
    limits.level = 1;
    limits.rejection_mad = kWideRejection;
    std::vector<PairNumbers> pairs;
    double rms = 0.0;
    for (const ViewPair& pair : registration_.matches().pairs) {
      if (pair.counts) pairs.push_back({pair.first, pair.second, true});
    }
    rms = registration_.matches().rms_m;
    limits.radius_m =
        2.5 * set_.max_spacing_m * set_.surfaces.front().margin_px(1) * 2.0 + kWideRejection * rms;
    const MatchSet wide = MatchViews(set_, registration_.state().poses, pairs, limits);
    std::vector<std::pair<double, std::string>> found;
    for (const ViewPair& pair : wide.pairs) {
      std::vector<float> residuals;
      double variance = 0.0;
      for (const std::vector<Match>* side : {&pair.from_first, &pair.from_second}) {
        for (const Match& match : *side) {
          residuals.push_back(match.residual_m);
          const double r = match.normalized != 0.0F
                               ? static_cast<double>(match.residual_m / match.normalized)
                               : 0.0;
          variance = std::max(variance, r * r);
        }
      }
      const double sigma = set_.sigma_known ? std::sqrt(variance) : 0.0;
      const auto doubled = FindDoubledSurface(residuals, sigma);
      if (!doubled) continue;
      for (const int view : {pair.first, pair.second}) {
        double& worst = out_.views[At(view)].doubled_m;
        worst = std::max(worst, doubled->distance_m);
      }
      found.emplace_back(
          -doubled->distance_m,
          fmt::format("{} and {} show a doubled surface: two layers {:.3f} mm apart, {:.0f} % of "
                      "the overlap in the smaller one",
                      NameOf(graph_.views[At(pair.first)]), NameOf(graph_.views[At(pair.second)]),
                      1e3 * doubled->distance_m, 100.0 * doubled->share));
    }
    std::sort(found.begin(), found.end());
    for (std::size_t k = 0; k < std::min(found.size(), kMaxDoubled); ++k) {
      out_.warnings.push_back(found[k].second);
    }
  }

  const Registration& registration_;
  const ViewGraph& graph_;
  const SurfaceSet& set_;
  std::vector<ViewSums> sums_;
  std::vector<int> groups_;
  RegistrationResult out_;
};

}  // namespace

RegistrationResult Conclude(const Registration& registration, const ViewGraph& graph,
                            const SurfaceSet& set) {
  return Conclusion(registration, graph, set).Make();
}

}  // namespace fringe_fusion::internal
