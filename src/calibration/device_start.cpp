#include <algorithm>
#include <cmath>
#include <limits>

#include "cell_data.hpp"
#include "common/constants.hpp"
#include "common/dense.hpp"

namespace fringe_fusion::bundle {
namespace {

constexpr std::size_t kMaxStartPoses = 12;
constexpr int kStartIterations = 12;

/// Stations of one device alone, as a problem of its own.
CellProblem DeviceProblem(const CellData& data, std::size_t device,
                          const std::vector<std::size_t>& chosen) {
  std::vector<Station> stations;
  for (const std::size_t i : chosen) {
    Station station;
    station.block = stations.size();
    station.seen[kCamera] = data.stations[i].seen[device];
    // Far from the solution every point counts the same, in pixels.
    for (Observation& seen : station.seen[kCamera]) seen.whitener.setIdentity();
    stations.push_back(std::move(station));
  }
  return {stations, data.points, std::vector<std::vector<Eigen::Vector3d>>(stations.size())};
}

/// A few poses that represent all of them.
std::vector<std::size_t> ChooseStations(const CellData& data, std::size_t device) {
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i < data.stations.size(); ++i) {
    if (data.homographies[device][i]) all.push_back(i);
  }
  if (all.size() <= kMaxStartPoses) return all;
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < kMaxStartPoses; ++k) {
    chosen.push_back(all[k * all.size() / kMaxStartPoses]);
  }
  return chosen;
}

std::vector<std::optional<Eigen::Vector2d>> PrincipalPoints(int width, int height,
                                                            bool has_lens_shift) {
  const double u = 0.5 * (width - 1);
  std::vector<std::optional<Eigen::Vector2d>> points = {std::nullopt,
                                                        Eigen::Vector2d(u, 0.5 * (height - 1))};
  if (!has_lens_shift) return points;
  for (const double ratio : {0.0, 1.0, -0.4, 1.4}) {
    points.emplace_back(Eigen::Vector2d(u, ratio * height));
  }
  return points;
}

/// Camera matrix of points in space: what a stage makes of a flat target.
/// Ref: Hartley & Zisserman, alg. 7.1, and the RQ decomposition of its left part.
std::optional<CameraModel> ResectionIntrinsics(const CellData& data, std::size_t device,
                                               std::size_t block, int width, int height) {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  const double scale = 1.0 / std::max(width, height);
  for (const Station& station : data.stations) {
    if (station.block != block || station.shift < 0) continue;
    const Eigen::Vector3d& shift =
        data.nominal_shifts[block][static_cast<std::size_t>(station.shift)];
    for (const Observation& seen : station.seen[device]) {
      points.push_back(data.points[static_cast<std::size_t>(seen.point)] + shift);
      pixels.push_back(scale * (seen.pixel - 0.5 * Eigen::Vector2d(width - 1, height - 1)));
    }
  }
  if (points.size() < 12) return std::nullopt;
  Eigen::Matrix<double, 12, 12> normal = Eigen::Matrix<double, 12, 12>::Zero();
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p / static_cast<double>(points.size());
  const double unit = (points.front() - mean).norm();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector4d p = ((points[i] - mean) / unit).homogeneous();
    Eigen::Matrix<double, 2, 12> rows;
    rows << p.transpose(), Eigen::RowVector4d::Zero(), -pixels[i].x() * p.transpose(),
        Eigen::RowVector4d::Zero(), p.transpose(), -pixels[i].y() * p.transpose();
    normal += rows.transpose() * rows;
  }
  const dense::SingularValues svd = dense::DecomposeSingular(normal);
  if (!(svd.values[10] > 1e-10 * svd.values[0])) return std::nullopt;
  const Eigen::VectorXd P = svd.V.col(11);
  Eigen::Matrix3d M;
  M << P.segment<3>(0).transpose(), P.segment<3>(4).transpose(), P.segment<3>(8).transpose();
  // M M^T = K K^T up to scale: no rotation in it.
  Eigen::Matrix3d KK = M * M.transpose();
  KK /= KK(2, 2);
  const double fy2 = KK(1, 1) - KK(1, 2) * KK(1, 2);
  const double fx2 = KK(0, 0) - KK(0, 2) * KK(0, 2);
  if (!(fx2 > 0.0) || !(fy2 > 0.0)) return std::nullopt;
  CameraModel model;
  model.width = width;
  model.height = height;
  model.fx = std::sqrt(fx2) / scale;
  model.fy = std::sqrt(fy2) / scale;
  model.cx = KK(0, 2) / scale + 0.5 * (width - 1);
  model.cy = KK(1, 2) / scale + 0.5 * (height - 1);
  return model;
}

std::vector<CameraModel> StartModels(const CellData& data, std::size_t device,
                                     const std::vector<std::size_t>& chosen, int width, int height,
                                     bool has_lens_shift) {
  std::vector<Eigen::Matrix3d> homographies;
  for (const std::size_t i : chosen) homographies.push_back(data.homographies[device][i]->H);
  std::vector<CameraModel> models;
  const double size = std::max(width, height);
  for (const auto& principal : PrincipalPoints(width, height, has_lens_shift)) {
    auto model = ZhangIntrinsics(homographies, width, height, principal);
    // Poses that are nearly parallel leave the focal length open: an ordinary lens then.
    const bool plausible = model && std::min(model->fx, model->fy) > 0.1 * size &&
                           std::max(model->fx, model->fy) < 100.0 * size;
    if (!plausible && !principal) continue;
    if (!plausible) {
      model =
          CameraModel{width, height, 1.5 * size, 1.5 * size, principal->x(), principal->y(), {}};
    }
    models.push_back(*model);
  }
  for (std::size_t b = 0; b < data.nominal_shifts.size(); ++b) {
    if (data.nominal_shifts[b].size() < 2) continue;
    const auto model = ResectionIntrinsics(data, device, b, width, height);
    if (model) models.push_back(*model);
  }
  return models;
}

State DeviceState(const CellData& data, std::size_t device, const std::vector<std::size_t>& chosen,
                  const CameraModel& model) {
  State state;
  state.devices = {model, model};
  state.points_target = data.points;
  for (const std::size_t i : chosen) {
    state.blocks.push_back({PlanePose(data.homographies[device][i]->H, model), {}});
  }
  return state;
}

Options StartOptions() {
  Options options;
  for (const std::size_t k : {0, 1, 2, 3, 4}) options.free[k] = true;
  return options;
}

}  // namespace

FreeMask MaskOf(DistortionLevel camera, DistortionLevel projector) {
  FreeMask mask{};
  constexpr std::array<std::size_t, 5> kNumTerms = {0, 1, 2, 4, 5};
  const std::array<DistortionLevel, 2> levels = {camera, projector};
  for (std::size_t device = 0; device < 2; ++device) {
    const std::size_t num_terms = kNumTerms[static_cast<std::size_t>(levels[device])];
    for (std::size_t k = 0; k < 4 + num_terms; ++k) mask[device * kNumModel + k] = true;
  }
  for (std::size_t k = 2 * kNumModel; k < kNumCellParameters; ++k) mask[k] = true;
  return mask;
}

Result<DeviceStart> StartDevice(const CellData& data, std::size_t device, int width, int height,
                                bool has_lens_shift) {
  const std::vector<std::size_t> chosen = ChooseStations(data, device);
  const CellProblem problem = DeviceProblem(data, device, chosen);
  const Options options = StartOptions();
  double best_cost = kInfinity;
  State best;
  for (const CameraModel& model :
       StartModels(data, device, chosen, width, height, has_lens_shift)) {
    State state = DeviceState(data, device, chosen, model);
    if (!problem.Solve(state, options, kStartIterations)) continue;
    const double cost = problem.Cost(state, options);
    const CameraModel& found = state.devices[kCamera];
    if (!(cost < best_cost) || !Validate(found, "start")) continue;
    best_cost = cost;
    best = std::move(state);
  }
  if (!std::isfinite(best_cost)) {
    return Fail("no start for the {}: none of {} poses is usable",
                device == kCamera ? "camera" : "projector", chosen.size());
  }
  DeviceStart start;
  start.model = best.devices[kCamera];
  const DeviceSums sums = problem.Sums(best, options)[kCamera];
  start.rms_px = std::sqrt(sums.sum_px2 / std::max(1, sums.count));
  // Every pose, also those that the start did without.
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i < data.stations.size(); ++i) {
    if (data.homographies[device][i]) all.push_back(i);
  }
  const CellProblem whole = DeviceProblem(data, device, all);
  State state = DeviceState(data, device, all, start.model);
  start.T_device_target.resize(data.stations.size());
  for (std::size_t k = 0; k < all.size(); ++k) {
    whole.FitPose(state, options, k, 5);
    start.T_device_target[all[k]] = state.blocks[k].T_camera_target;
  }
  return start;
}

}  // namespace fringe_fusion::bundle
