// Registration against its Cramer-Rao bound and against truth.
//   registration_proof bound [SHARE]             E10: error over the bound, truth of the covariance
//   registration_proof parts DATA [DRAWS [NAMES [SIGMA_MM [ITERATIONS]]]]
//                                                parts of registration_study: error and bound
//   registration_proof turntable DATA [NAMES [COUNTS]]
//                                                axis unknown: tf alone, pairwise, joint, with axis
#include <Eigen/Cholesky>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <sstream>

#include "bench/registration_scenes.hpp"
#include "fringe_fusion/inspection/surface_distance.hpp"
#include "fringe_fusion/registration/overlap_check.hpp"
#include "fringe_fusion/surface/fuse_views.hpp"
#include "test/registration/bumpy_views.hpp"

namespace fringe_fusion::bench {
namespace {

constexpr double kRad = M_PI / 180.0;

std::vector<std::string> Words(const std::string& list) {
  std::vector<std::string> words;
  std::istringstream in(list);
  for (std::string word; std::getline(in, word, ',');) words.push_back(word);
  return words;
}

double Rank(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

double Rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

// ---- bound ------------------------------------------------------------------------------------

testing::BumpyScene BoundScene(unsigned seed) {
  testing::BumpyScene scene;
  scene.seed = seed;
  scene.width = 256;
  scene.height = 216;
  return scene;
}

/// The views of a scene without any noise, at their true poses.
std::vector<View> ExactBumpy(testing::BumpyScene scene) {
  scene.sigma_range_m = 0.0;
  scene.sigma_normal_rad = 0.0;
  testing::BumpyGraph truth = testing::MakeBumpyGraph(scene);
  for (std::size_t i = 0; i < truth.graph.views.size(); ++i) {
    truth.graph.views[i].pose.T_object_camera = truth.T_object_camera_true[i];
  }
  return truth.graph.views;
}

struct BoundSums {
  double ratio2 = 0.0;
  std::vector<double> nees;  // mean over the views of one run
};

// One draw of the noise: registered from 0.05 deg and 0.2 mm aside, the first view held.
bool AddBoundRun(unsigned seed, const Eigen::MatrixXd& information, BoundSums& sums) {
  testing::BumpyGraph truth = testing::MakeBumpyGraph(BoundScene(seed));
  for (View& view : truth.graph.views) view.pose.covariance.setZero();
  truth.graph.views[0].pose.T_object_camera = truth.T_object_camera_true[0];
  RegistrationConfig config;
  config.use_prior = false;
  const auto result = RegisterViews(truth.graph, config);
  if (!result || !result->converged) return false;
  const std::size_t num_free = truth.graph.views.size() - 1;
  Eigen::VectorXd error(static_cast<Eigen::Index>(6 * num_free));
  double nees = 0.0;
  for (std::size_t i = 0; i < num_free; ++i) {
    const Pose& pose = result->views[i + 1].pose;
    const Vector6d e = Log(pose.T_object_camera.inverse() * truth.T_object_camera_true[i + 1]);
    error.segment<6>(static_cast<Eigen::Index>(6 * i)) = e;
    nees += e.dot(pose.covariance.ldlt().solve(e)) / (6.0 * static_cast<double>(num_free));
  }
  sums.ratio2 += error.dot(information * error) / static_cast<double>(error.size());
  sums.nees.push_back(nees);
  return true;
}

Status RunBound(double share) {
  constexpr int kRuns = 120;
  constexpr double kMaxRatio = 1.2;
  const testing::BumpyScene scene = BoundScene(1);
  PinholeGrid grid;
  grid.focal_px = 0.42 * scene.height * scene.distance_m / scene.radius_m;
  grid.middle_px = {0.5 * scene.width, 0.5 * scene.height};
  const Eigen::MatrixXd all = RegistrationInformation(ExactBumpy(scene), grid, scene.sigma_range_m);
  const Eigen::Index size = all.rows() - 6;
  const Eigen::MatrixXd information = all.bottomRightCorner(size, size);
  const int runs = std::max(3, static_cast<int>(std::lround(share * kRuns)));
  BoundSums sums;
  int failures = 0;
  for (int run = 0; run < runs; ++run) {
    failures += AddBoundRun(1000U + static_cast<unsigned>(run), information, sums) ? 0 : 1;
  }
  const auto count = static_cast<double>(sums.nees.size());
  const double ratio = std::sqrt(sums.ratio2 / count);
  double mean = 0.0;
  for (const double nees : sums.nees) mean += nees / count;
  double scatter2 = 0.0;
  for (const double nees : sums.nees) scatter2 += (nees - mean) * (nees - mean);
  // Views of one run err together: the standard error is that of the runs.
  const double error = std::sqrt(scatter2 / count / std::max(1.0, count - 1.0));
  const double dof = count * static_cast<double>(size);
  const bool passed = failures == 0 && ratio <= kMaxRatio + 3.0 / std::sqrt(2.0 * dof) &&
                      mean >= 0.9 - 3.0 * error && mean <= 1.1 + 3.0 * error;
  std::printf(
      "E10 six views, %d runs x %d dof, %d failed: error / bound %.3f (limit %.1f), squared error "
      "/ "
      "covariance %.3f +- %.3f (0.9 to 1.1)%s\n",
      runs, static_cast<int>(size), failures, ratio, kMaxRatio, mean, error,
      passed ? "" : "  MISSED");
  return passed ? Status{} : Fail("a limit was missed");
}

// ---- parts ------------------------------------------------------------------------------------

/// Why a part may have failed.
void Explain(const RegistrationResult& result, const std::vector<double>& rms_m) {
  std::printf("  not converged%s; views [mm]:", result.recovered ? ", places found by shape" : "");
  for (const double value : rms_m) std::printf(" %.2f", 1e3 * value);
  std::printf("\n");
  for (const std::string& warning : result.warnings) std::printf("  %s\n", warning.c_str());
}

Status RunParts(const std::string& data, int draws, const std::vector<std::string>& names,
                double sigma_m, int iterations) {
  std::printf(
      "| part | bound [mm] | error, median [mm] | worst [mm] | error / bound | "
      "residual [mm] |\n|---|---|---|---|---|---|\n");
  for (const std::string& name : names) {
    const auto exact = MakePartScene(name, data, RegistrationCameras(), 0.0);
    if (!exact) return Forward(exact);
    const double bound_m = ExpectedMaxRms(
        exact->graph.views, RegistrationInformation(exact->graph.views, exact->grid, sigma_m), 101);
    std::vector<double> errors;
    std::vector<double> residuals;
    for (int draw = 1; draw <= draws; ++draw) {
      ProofCameras cameras = RegistrationCameras();
      cameras.noise_seed = static_cast<unsigned>(draw);
      auto scene = MakePartScene(name, data, cameras, sigma_m);
      if (!scene) return Forward(scene);
      const auto start = DisturbedPoses(*scene, kDisturbances[0], static_cast<unsigned>(draw));
      for (std::size_t i = 0; i < start.size(); ++i) {
        scene->graph.views[i].pose.T_object_camera = start[i];
      }
      RegistrationConfig config;
      config.max_iterations = iterations;
      config.max_distance_m = std::max(config.max_distance_m, 2.0 * kDisturbances[0].shift_m);
      const auto result = RegisterViews(scene->graph, config);
      if (!result) return Forward(result);
      const auto compared =
          RigidAlign(scene->graph, testing::PosesOf(*result), scene->T_object_camera_reference);
      if (!compared) return Forward(compared);
      if (!(compared->max_rms_m <= kConvergedM)) Explain(*result, compared->rms_m);
      errors.push_back(compared->max_rms_m);
      residuals.push_back(result->rms_after_m);
    }
    std::printf("| %s | %.4f | %.4f | %.4f | %.2f | %.4f |\n", name.c_str(), 1e3 * bound_m,
                1e3 * Rank(errors, 0.5), 1e3 * Rank(errors, 1.0), Rank(errors, 0.5) / bound_m,
                1e3 * Rank(residuals, 0.5));
    std::fflush(stdout);
  }
  return {};
}

// ---- turntable --------------------------------------------------------------------------------

// The table as tf believes it: tilted and shifted, and every stop a little off.
constexpr double kAxisTiltRad = 0.3 * kRad;
constexpr double kAxisShiftM = 0.5e-3;
constexpr double kStopRad = 0.01 * kRad;
constexpr double kStopM = 0.01e-3;

/// A scan on a table whose true axis is the vertical through the middle of the part.
struct TableScan {
  RegistrationScene exact;
  RegistrationScene scene;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< a point of the axis
};

Result<TableScan> MakeTableScan(const std::string& name, const std::string& data, int count) {
  ProofCameras cameras;
  cameras.rings = {{count, 25.0}};
  cameras.image_px = 320;
  auto exact = MakePartScene(name, data, cameras, 0.0);
  if (!exact) return Forward(exact);
  cameras.noise_seed = 1;
  auto noisy = MakePartScene(name, data, cameras, kPartSigmaM);
  if (!noisy) return Forward(noisy);
  TableScan scan{std::move(*exact), std::move(*noisy), {}};
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : scan.scene.truth.vertices) box.extend(vertex);
  scan.middle = box.center().cast<double>();
  // Where the cameras really stood: the table did not stop where its encoder says.
  std::mt19937 random(7);
  std::normal_distribution<double> gauss;
  std::vector<double> angles;
  std::vector<int> ids;
  Transform T_table_object = Transform::Identity();  // of tf: frame of the believed axis
  T_table_object.linear() = ExpRotation(Eigen::Vector3d(kAxisTiltRad, 0.0, 0.0));
  T_table_object.translation() =
      Eigen::Vector3d(kAxisShiftM, 0.0, 0.0) - T_table_object.linear() * scan.middle;
  const Transform T_object_table = T_table_object.inverse();
  const Transform T_first = scan.scene.T_object_camera_reference.front();
  for (int i = 0; i < count; ++i) {
    ids.push_back(scan.scene.graph.views[static_cast<std::size_t>(i)].id);
    angles.push_back(-2.0 * M_PI * i / count + kStopRad * gauss(random));
  }
  scan.scene.graph.chain = TurntableChain(ids, angles, kStopRad, kStopM);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const Transform& T_base_flange = scan.scene.graph.chain->readings[i].T_base_flange;
    scan.scene.graph.views[i].pose.T_object_camera =
        T_object_table * T_base_flange *
        scan.scene.graph.chain->readings.front().T_base_flange.inverse() * T_table_object * T_first;
    scan.scene.graph.views[i].pose.covariance.setZero();
  }
  return scan;
}

/// Each view against the one before, from where tf says they stand to each other.
Result<std::vector<Transform>> Pairwise(const ViewGraph& graph) {
  std::vector<Transform> poses{graph.views.front().pose.T_object_camera};
  RegistrationConfig config;
  config.use_prior = false;
  for (std::size_t i = 1; i < graph.views.size(); ++i) {
    ViewGraph pair;
    pair.views = {graph.views[i - 1], graph.views[i]};
    const auto result = RegisterViews(pair, config);
    if (!result) return Forward(result);
    const std::vector<Transform> both = testing::PosesOf(*result);
    poses.push_back(poses.back() * both[0].inverse() * both[1]);
  }
  return poses;
}

struct TableRow {
  std::string method;
  std::vector<Transform> poses;
  std::optional<AxisLine> axis;
  double seconds = 0.0;
};

Status PrintTableRow(const TableScan& scan, const SurfaceDistance& truth, int count,
                     const TableRow& row) {
  const auto compared =
      RigidAlign(scan.exact.graph, row.poses, scan.exact.T_object_camera_reference);
  if (!compared) return Forward(compared);
  std::vector<double> placed;
  std::vector<View> views = scan.scene.graph.views;
  for (std::size_t i = 0; i < row.poses.size(); ++i) {
    const Transform T = compared->T_reference_poses * row.poses[i];
    views[i].pose = {T, Matrix6d::Zero(), PoseSource::kRegistration};
    int number = 0;
    for (const Eigen::Vector3f& point : scan.exact.graph.views[i].range.points) {
      if (!point.allFinite() || number++ % 16 != 0) continue;
      const auto nearest = truth.Nearest(T * point.cast<double>(), 0.01);
      if (nearest) placed.push_back(std::abs(nearest->distance_m));
    }
  }
  FusionConfig fusion;
  fusion.voxel_m = 0.75e-3;
  const auto fused = FuseViews(views, fusion, {}, {});
  if (!fused) return Forward(fused);
  std::vector<double> surface;
  for (const Eigen::Vector3f& vertex : fused->mesh.vertices) {
    const auto nearest = truth.Nearest(vertex.cast<double>(), 0.01);
    if (nearest) surface.push_back(std::abs(nearest->distance_m));
  }
  std::string axis = "| |";
  if (row.axis) {
    // Compared in the frame of the truth.
    const Transform& T = compared->T_reference_poses;
    const Eigen::Vector3d direction = T.linear() * row.axis->direction;
    const double angle = std::asin(std::min(1.0, direction.head<2>().norm()));
    const Eigen::Vector3d offset = T * row.axis->point - scan.middle;
    const double distance = (offset - direction * direction.dot(offset)).norm();
    axis = fmt::format("{:.4f} | {:.4f} |", angle / kRad, 1e3 * distance);
  }
  std::printf("| %s, %d views | %s | %.4f | %.4f | %.4f | %.4f | %.4f | %s %.2f |\n",
              scan.scene.name.c_str(), count, row.method.c_str(), 1e3 * compared->max_rms_m,
              1e3 * Rms(placed), 1e3 * Rank(placed, 0.95), 1e3 * Rms(surface),
              1e3 * Rank(surface, 0.95), axis.c_str(), row.seconds);
  std::fflush(stdout);
  return {};
}

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Result<TableRow> Joint(const TableScan& scan, bool with_axis) {
  ViewGraph graph = scan.scene.graph;
  if (!with_axis) graph.chain.reset();
  const double start = Now();
  const auto result = RegisterViews(graph, {});
  if (!result) return Forward(result);
  TableRow row;
  row.method = with_axis ? "joint, axis solved with the poses" : "joint, surfaces alone";
  row.poses = testing::PosesOf(*result);
  row.seconds = Now() - start;
  if (result->chain) row.axis = TurntableAxis(*result->chain);
  return row;
}

Status RunTurntable(const std::string& data, const std::vector<std::string>& names,
                    const std::vector<std::string>& counts) {
  std::printf(
      "| scan | poses | worst view [mm] | placed points, rms [mm] | 95 %% [mm] | fused, rms [mm] | "
      "95 %% [mm] | axis direction [deg] | axis position [mm] | wall [s] |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n");
  for (const std::string& name : names) {
    for (const std::string& word : counts) {
      const int count = std::stoi(word);
      const auto scan = MakeTableScan(name, data, count);
      if (!scan) return Forward(scan);
      const auto truth = SurfaceDistance::Create(scan->scene.truth);
      if (!truth) return Forward(truth);
      std::vector<TableRow> rows(1);
      rows[0].method = "tf alone";
      rows[0].poses = testing::PosesOf(scan->scene.graph);
      const double start = Now();
      auto pairwise = Pairwise(scan->scene.graph);
      if (!pairwise) return Forward(pairwise);
      rows.push_back({"each view to the one before", *pairwise, {}, Now() - start});
      for (const bool with_axis : {false, true}) {
        auto row = Joint(*scan, with_axis);
        if (!row) return Forward(row);
        rows.push_back(std::move(*row));
      }
      for (const TableRow& row : rows) {
        if (Status status = PrintTableRow(*scan, *truth, count, row); !status) return status;
      }
    }
  }
  return {};
}

Status Main(const std::vector<std::string>& words) {
  const auto word = [&](std::size_t i, const std::string& fallback) {
    return i < words.size() ? words[i] : fallback;
  };
  if (!words.empty() && words[0] == "bound") return RunBound(std::stod(word(1, "1")));
  if (words.size() >= 2 && words[0] == "parts") {
    return RunParts(words[1], std::stoi(word(2, "3")), Words(word(3, "knot,fins,blade,bumpy,hare")),
                    1e-3 * std::stod(word(4, "0.05")), std::stoi(word(5, "30")));
  }
  if (words.size() >= 2 && words[0] == "turntable") {
    return RunTurntable(words[1], Words(word(2, "knot,bumpy")), Words(word(3, "12,24,36")));
  }
  return Fail("{}", "registration_proof bound|parts|turntable ..., see its first lines");
}

}  // namespace
}  // namespace fringe_fusion::bench

int main(int argc, char** argv) {
  const auto status = fringe_fusion::bench::Main({argv + 1, argv + argc});
  if (status) return 0;
  std::fprintf(stderr, "registration_proof: %s\n", status.error().message.c_str());
  return 1;
}
