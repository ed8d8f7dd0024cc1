#include "bench/registration_scenes.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/poses_conf.hpp"

namespace fringe_fusion::bench {
namespace {

constexpr double kRadPerDeg = M_PI / 180.0;
constexpr double kDiameterM = 0.16;

Mesh MakeBumpy() {
  constexpr int kRows = 300;
  constexpr int kCols = 600;
  Mesh mesh;
  const auto add = [&](double polar, double angle) {
    const Eigen::Vector3d d(std::sin(polar) * std::cos(angle), std::sin(polar) * std::sin(angle),
                            std::cos(polar));
    const double bumps = std::sin(5.0 * d.x() + 1.0) * std::cos(6.0 * d.y()) +
                         0.7 * std::sin(7.0 * d.z() + 2.0 * d.x());
    mesh.vertices.push_back((d * (1.0 + 0.1 * bumps)).cast<float>());
  };
  for (int i = 0; i <= kRows; ++i) {
    for (int j = 0; j < kCols; ++j) add(M_PI * i / kRows, 2.0 * M_PI * j / kCols);
  }
  for (int i = 0; i < kRows; ++i) {
    for (int j = 0; j < kCols; ++j) {
      const int a = i * kCols + j;
      const int b = i * kCols + (j + 1) % kCols;
      if (i + 1 < kRows) mesh.faces.emplace_back(a, a + kCols, b + kCols);
      if (i > 0) mesh.faces.emplace_back(a, b + kCols, b);
    }
  }
  return mesh;
}

Mesh Scaled(Mesh mesh) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex);
  const float scale = static_cast<float>(kDiameterM) / box.diagonal().norm();
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex *= scale;
  return mesh;
}

Result<Mesh> MakePart(const std::string& name, const std::string& data_folder) {
  if (name == "bumpy") return MakeBumpy();
  if (name == "hare") return ReadMesh(data_folder + "/stanford_bunny/stanford-bunny.obj");
  return MakeProofObject(name);
}

void SetReference(RegistrationScene& scene) {
  for (const View& view : scene.graph.views) {
    scene.T_object_camera_reference.push_back(view.pose.T_object_camera);
  }
}

Result<RegistrationScene> RealScans(const std::string& data_folder) {
  RegistrationScene scene;
  scene.name = "bunny";
  scene.exact = false;
  const std::string folder = data_folder + "/stanford_bunny/";
  const auto entries = ReadPosesConf(folder + "bun.conf");
  if (!entries) return Forward(entries);
  for (const ConfEntry& entry : *entries) {
    auto range = ReadRangeImage(folder + entry.file);
    if (!range) return Forward(range);
    range->line_of_sight.directional = true;
    range->line_of_sight.camera = Eigen::Vector3f::UnitZ();
    for (float& sigma : range->sigma_range) sigma = 1e-4F;
    for (float& sigma : range->sigma_lateral) sigma = 1e-4F;
    View view;
    view.id = static_cast<int>(scene.graph.views.size());
    view.name = entry.file;
    view.range = EstimateNormals(*range, {});
    view.pose.T_object_camera = entry.T_object_camera;
    view.pose.source = PoseSource::kFile;
    scene.graph.views.push_back(std::move(view));
  }
  SetReference(scene);
  return scene;
}

Eigen::Vector3d MiddleOf(const RegistrationScene& scene) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0.0;
  for (std::size_t i = 0; i < scene.graph.views.size(); ++i) {
    for (const Eigen::Vector3f& point : scene.graph.views[i].range.points) {
      if (!point.allFinite()) continue;
      sum += scene.T_object_camera_reference[i] * point.cast<double>();
      count += 1.0;
    }
  }
  return sum / count;
}

}  // namespace

const std::vector<std::string>& RegistrationSceneNames() {
  static const std::vector<std::string> names{"knot", "fins", "blade", "bumpy", "hare", "bunny"};
  return names;
}

ProofCameras RegistrationCameras() {
  ProofCameras cameras;
  cameras.rings = {{6, 15.0}, {4, 50.0}};
  cameras.image_px = 260;
  return cameras;
}

Result<RegistrationScene> MakePartScene(const std::string& name, const std::string& data_folder,
                                        const ProofCameras& cameras, double sigma_m) {
  const auto mesh = MakePart(name, data_folder);
  if (!mesh) return Forward(mesh);
  auto proof = RenderProof(Scaled(*mesh), sigma_m, cameras);
  if (!proof) return Forward(proof);
  RegistrationScene scene;
  scene.name = name;
  scene.graph.views = std::move(proof->views);
  scene.truth = std::move(proof->truth);
  scene.grid.focal_px = proof->focal_px;
  scene.grid.middle_px.setConstant(0.5 * (proof->image_px - 1));
  SetReference(scene);
  return scene;
}

Result<RegistrationScene> MakeRegistrationScene(const std::string& name,
                                                const std::string& data_folder) {
  if (name == "bunny") return RealScans(data_folder);
  return MakePartScene(name, data_folder, RegistrationCameras(), kPartSigmaM);
}

std::vector<Transform> DisturbedPoses(const RegistrationScene& scene,
                                      const Disturbance& disturbance, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss;
  const auto direction = [&] {
    const double x = gauss(random);
    const double y = gauss(random);
    const double z = gauss(random);
    return Eigen::Vector3d(x, y, z).normalized().eval();
  };
  const Eigen::Vector3d middle = MiddleOf(scene);
  std::vector<Transform> poses;
  for (const Transform& T_object_camera : scene.T_object_camera_reference) {
    const Eigen::Vector3d axis = direction();
    const Eigen::Vector3d shift = direction();
    Transform moved = Transform::Identity();
    moved.linear() = ExpRotation(disturbance.angle_deg * kRadPerDeg * axis);
    moved.translation() = middle - moved.linear() * middle + disturbance.shift_m * shift;
    poses.push_back(moved * T_object_camera);
  }
  return poses;
}

}  // namespace fringe_fusion::bench
