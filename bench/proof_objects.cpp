#include "bench/proof_objects.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <utility>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "src/sim/ray_scene.hpp"

namespace fringe_fusion::bench {
namespace {

constexpr double kTwoPi = 2.0 * M_PI;

// Grid of rows x cols points, closed in j; in i closed, or ended by rows that are one point each.
// Faces are counter-clockwise seen from the side (d/di x d/dj) points to.
Mesh GridMesh(int rows, int cols, bool close_rows,
              const std::function<Eigen::Vector3d(int, int)>& point) {
  Mesh mesh;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < cols; ++j) mesh.vertices.push_back(point(i, j).cast<float>());
  }
  const int last = close_rows ? rows : rows - 1;
  for (int i = 0; i < last; ++i) {
    for (int j = 0; j < cols; ++j) {
      const auto at = [&](int di, int dj) { return (i + di) % rows * cols + (j + dj) % cols; };
      const auto add = [&](int a, int b, int c) {
        const auto vertex = [&](int v) { return mesh.vertices[static_cast<std::size_t>(v)]; };
        const float twice_area = (vertex(b) - vertex(a)).cross(vertex(c) - vertex(a)).norm();
        if (twice_area > 1e-14F) mesh.faces.emplace_back(a, b, c);
      };
      add(at(0, 0), at(1, 0), at(1, 1));
      add(at(0, 0), at(1, 1), at(0, 1));
    }
  }
  return mesh;
}

Mesh MakeKnot() {
  const auto center = [](double t) -> Eigen::Vector3d {
    return Eigen::Vector3d(std::sin(t) + 2.0 * std::sin(2.0 * t),
                           std::cos(t) - 2.0 * std::cos(2.0 * t), -std::sin(3.0 * t)) *
           0.016;
  };
  constexpr int kRows = 900;
  constexpr int kCols = 96;
  return GridMesh(kRows, kCols, true, [&](int i, int j) {
    const double t = kTwoPi * i / kRows;
    const Eigen::Vector3d along = (center(t + 1e-4) - center(t - 1e-4)).normalized();
    const Eigen::Vector3d side = along.cross(Eigen::Vector3d::UnitZ()).normalized();
    const double angle = -kTwoPi * j / kCols;
    return Eigen::Vector3d(center(t) +
                           0.007 * (std::cos(angle) * side + std::sin(angle) * along.cross(side)));
  });
}

// Turns the faces of a closed mesh so that they enclose a positive volume.
Mesh Outwards(Mesh mesh) {
  double volume = 0.0;
  for (const Eigen::Vector3i& face : mesh.faces) {
    const auto vertex = [&](int i) {
      return mesh.vertices[static_cast<std::size_t>(face[i])].cast<double>().eval();
    };
    volume += vertex(0).dot(vertex(1).cross(vertex(2)));
  }
  if (volume < 0.0) {
    for (Eigen::Vector3i& face : mesh.faces) std::swap(face[1], face[2]);
  }
  return mesh;
}

// A profile (x, z) over the base line z = 0, extruded along y.
Mesh ExtrudeProfile(const std::vector<Eigen::Vector2d>& top, double length) {
  Mesh mesh;
  const auto quad = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                        const Eigen::Vector3d& c, const Eigen::Vector3d& d) {
    const auto first = static_cast<int>(mesh.vertices.size());
    for (const Eigen::Vector3d& p : {a, b, c, d}) mesh.vertices.push_back(p.cast<float>());
    mesh.faces.emplace_back(first, first + 1, first + 2);
    mesh.faces.emplace_back(first, first + 2, first + 3);
  };
  const auto at = [&](const Eigen::Vector2d& p, double side) {
    return Eigen::Vector3d(p.x(), side * 0.5 * length, p.y());
  };
  for (std::size_t i = 0; i + 1 < top.size(); ++i) {
    const Eigen::Vector2d& a = top[i];
    const Eigen::Vector2d& b = top[i + 1];
    quad(at(a, -1.0), at(b, -1.0), at(b, 1.0), at(a, 1.0));
    if (!(b.x() > a.x())) continue;
    const Eigen::Vector2d a0(a.x(), 0.0);
    const Eigen::Vector2d b0(b.x(), 0.0);
    quad(at(a0, -1.0), at(b0, -1.0), at(b, -1.0), at(a, -1.0));
    quad(at(a, 1.0), at(b, 1.0), at(b0, 1.0), at(a0, 1.0));
    quad(at(a0, 1.0), at(b0, 1.0), at(b0, -1.0), at(a0, -1.0));
  }
  return mesh;
}

Mesh MakeFins() {
  constexpr double kBase = 0.006;
  constexpr double kTop = 0.026;
  std::vector<Eigen::Vector2d> top{{-0.04, 0.0}, {-0.04, kBase}};
  double x = -0.034;
  for (const double thickness : {0.0008, 0.0012, 0.0016, 0.0024, 0.004}) {
    top.emplace_back(x, kBase);
    top.emplace_back(x, kTop);
    top.emplace_back(x + thickness, kTop);
    top.emplace_back(x + thickness, kBase);
    x += thickness + 0.0125;
  }
  top.emplace_back(0.04, kBase);
  top.emplace_back(0.04, 0.0);
  return ExtrudeProfile(top, 0.06);
}

Mesh MakeGear() {
  constexpr int kTeeth = 24;
  constexpr int kPerTooth = 4;  // foot, tip, tip, foot
  constexpr double kHalfHeight = 0.008;
  return GridMesh(kTeeth * kPerTooth, 4, true, [&](int i, int j) {
    const double in_tooth = std::array<double, kPerTooth>{
        0.0, 0.1, 0.42, 0.52}[static_cast<std::size_t>(i % kPerTooth)];
    const double angle = kTwoPi * (i / kPerTooth + in_tooth) / kTeeth;
    const bool tip = i % kPerTooth == 1 || i % kPerTooth == 2;
    const double outer = tip ? 0.038 : 0.033;
    const double r = j == 0 || j == 3 ? 0.015 : outer;
    const double z = j < 2 ? kHalfHeight : -kHalfHeight;
    return Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), z);
  });
}

Mesh MakeCup() {
  constexpr double kWall = 0.0012;
  constexpr double kRadius = 0.03;
  constexpr double kHeight = 0.05;
  std::vector<Eigen::Vector2d> profile{{0.0, 0.0}};  // (r, z), from below to the inner bottom
  for (double r = 0.004; r < kRadius; r += 0.004) profile.emplace_back(r, 0.0);
  const auto bulge = [](double z) { return kRadius + 0.003 * std::sin(kTwoPi * z / kHeight); };
  const double step = 0.001;
  for (double z = 0.0; z < kHeight; z += step) profile.emplace_back(bulge(z), z);
  for (int i = 0; i <= 8; ++i) {
    const double angle = M_PI * i / 8.0;
    profile.emplace_back(bulge(kHeight) - 0.5 * kWall * (1.0 - std::cos(angle)),
                         kHeight + 0.5 * kWall * std::sin(angle));
  }
  for (double z = kHeight - step; z > 0.003; z -= step) profile.emplace_back(bulge(z) - kWall, z);
  for (double r = 0.028; r > 0.002; r -= 0.004) profile.emplace_back(r, 0.003);
  profile.emplace_back(0.0, 0.003);
  constexpr int kCols = 240;
  return GridMesh(static_cast<int>(profile.size()), kCols, false, [&](int i, int j) {
    const double angle = -kTwoPi * j / kCols;
    const Eigen::Vector2d& p = profile[static_cast<std::size_t>(i)];
    return Eigen::Vector3d(p.x() * std::cos(angle), p.x() * std::sin(angle), p.y());
  });
}

Mesh MakeBlade() {
  constexpr int kRows = 120;
  constexpr int kCols = 160;
  constexpr double kSpan = 0.08;
  // Half thickness of a wing section, with a trailing edge of 0.6 mm.
  const auto half_thickness = [](double s) {
    return 0.0075 * (std::sqrt(s) - s) * 2.0 * (1.0 - 0.3 * s) + 0.0003 * s;
  };
  return GridMesh(kRows + 2, kCols, false, [&](int i, int j) {
    const double along = std::clamp(i - 1, 0, kRows - 1) / static_cast<double>(kRows - 1);
    const double twist = 0.6 * along;
    const double chord = 0.05 * (1.0 - 0.35 * along);
    const int half = kCols / 2;
    const double s = std::pow((j < half ? j : kCols - j) / static_cast<double>(half), 1.5);
    const double y = (j < half ? -1.0 : 1.0) * half_thickness(s) + 0.004 * std::sin(M_PI * s);
    const bool end = i == 0 || i == kRows + 1;
    const Eigen::Vector2d section =
        end ? Eigen::Vector2d(0.0, 0.003) : Eigen::Vector2d((s - 0.5) * chord, y);
    return Eigen::Vector3d(section.x() * std::cos(twist) - section.y() * std::sin(twist),
                           section.x() * std::sin(twist) + section.y() * std::cos(twist),
                           along * kSpan);
  });
}

Mesh MakeRipple() {
  constexpr int kRows = 400;
  constexpr int kCols = 640;
  constexpr double kRadius = 0.035;
  const double waves = kTwoPi * kRadius / 0.007;
  return GridMesh(kRows + 1, kCols, false, [&](int i, int j) {
    const double polar = M_PI * (1.0 - i / static_cast<double>(kRows));  // from below
    const double angle = -kTwoPi * j / kCols;
    const Eigen::Vector3d n(std::sin(polar) * std::cos(angle), std::sin(polar) * std::sin(angle),
                            std::cos(polar));
    const double bump = std::sin(waves * n.x()) + std::sin(waves * n.y()) + std::sin(waves * n.z());
    return Eigen::Vector3d(n * (kRadius + 0.0005 / 3.0 * bump));
  });
}

// Middle and radius of the box around a mesh.
struct Bounds {
  Eigen::Vector3d center;
  double radius_m;
};
Bounds BoundsOf(const Mesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex);
  return {box.center().cast<double>(), 0.5 * static_cast<double>(box.diagonal().norm())};
}

Transform LookAt(const Eigen::Vector3d& position, const Eigen::Vector3d& target) {
  const Eigen::Vector3d forward = (target - position).normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d(0.0, 0.0, 1.0)).normalized();
  Transform T_object_camera = Transform::Identity();
  T_object_camera.linear().col(0) = right;
  T_object_camera.linear().col(1) = forward.cross(right);
  T_object_camera.linear().col(2) = forward;
  T_object_camera.translation() = position;
  return T_object_camera;
}

// Unit directions to the cameras.
std::vector<Eigen::Vector3d> CameraDirections(const ProofCameras& cameras) {
  std::vector<Eigen::Vector3d> directions;
  for (const auto& [count, elevation_deg] : cameras.rings) {
    for (int i = 0; i < count; ++i) {
      const double azimuth = kTwoPi * (i + 0.3 * count) / count;
      const double elevation = elevation_deg * M_PI / 180.0;
      directions.emplace_back(std::cos(elevation) * std::cos(azimuth),
                              std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
    }
  }
  return directions;
}

// The scan of the bunny has holes in its base: a ray that enters there meets the inner side of a
// skin without thickness, which no solid object shows.
bool FacesCamera(const Mesh& truth, const sim::RayHit& hit) {
  const Eigen::Vector3i& face = truth.faces[static_cast<std::size_t>(hit.face)];
  const auto corner = [&](int i) -> const Eigen::Vector3f& {
    return truth.vertices[static_cast<std::size_t>(face[i])];
  };
  const Eigen::Vector3f outwards = (corner(1) - corner(0)).cross(corner(2) - corner(0));
  return outwards.cast<double>().dot(hit.normal) > 0.0;
}

View RenderView(const sim::RayScene& scene, const ProofScene& proof, const Transform& T, int id,
                double sigma_m, unsigned noise_seed) {
  View view;
  view.id = id;
  view.name = fmt::format("{:03}", id);
  view.pose.T_object_camera = T;
  view.pose.source = PoseSource::kFile;
  view.range = MakeRangeImage(proof.image_px, proof.image_px);
  ParallelFor(proof.image_px, 8, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      std::mt19937_64 random(static_cast<std::uint64_t>(noise_seed) * 100000007U +
                             static_cast<std::uint64_t>(id) * 100003U +
                             static_cast<std::uint64_t>(y));
      std::normal_distribution<double> noise;
      for (int x = 0; x < proof.image_px; ++x) {
        const double middle = 0.5 * (proof.image_px - 1);
        const Eigen::Vector3d ray =
            Eigen::Vector3d((x - middle) / proof.focal_px, (y - middle) / proof.focal_px, 1.0)
                .normalized();
        const double error_m = sigma_m * noise(random);
        const auto hit = scene.Cast(T.translation(), T.linear() * ray);
        if (!hit || !FacesCamera(proof.truth, *hit)) continue;
        const double range_m = (hit->point - T.translation()).norm() + error_m;
        view.range.points(x, y) = (ray * range_m).cast<float>();
        view.range.sigma_range(x, y) = static_cast<float>(sigma_m);
        view.range.sigma_lateral(x, y) = 0.0F;
        view.range.color(x, y) = Rgb8{180, 180, 180};
      }
    }
  });
  view.range = EstimateNormals(view.range, TriangulationConfig{});
  return view;
}

}  // namespace

const std::vector<std::string>& ProofObjectNames() {
  static const std::vector<std::string> names{"knot", "fins", "gear", "cup", "blade", "ripple"};
  return names;
}

Result<Mesh> MakeProofObject(const std::string& name_or_path) {
  if (name_or_path == "knot") return Outwards(MakeKnot());
  if (name_or_path == "fins") return Outwards(MakeFins());
  if (name_or_path == "gear") return Outwards(MakeGear());
  if (name_or_path == "cup") return Outwards(MakeCup());
  if (name_or_path == "blade") return Outwards(MakeBlade());
  if (name_or_path == "ripple") return Outwards(MakeRipple());
  return ReadMesh(name_or_path);
}

Result<ProofScene> RenderProof(Mesh truth, double sigma_m, const ProofCameras& cameras) {
  const Result<sim::RayScene> scene = sim::RayScene::Create(truth, Mesh{});
  if (!scene) return Forward(scene);
  const Bounds bounds = BoundsOf(truth);
  ProofScene proof;
  proof.truth = std::move(truth);
  proof.image_px = cameras.image_px;
  // The ball around the object fills the image from five radii away.
  proof.focal_px = 0.5 * proof.image_px * std::sqrt(24.0);
  int id = 0;
  for (const Eigen::Vector3d& direction : CameraDirections(cameras)) {
    const Eigen::Vector3d position = bounds.center + 5.0 * bounds.radius_m * direction;
    proof.views.push_back(RenderView(*scene, proof, LookAt(position, bounds.center), id++, sigma_m,
                                     cameras.noise_seed));
  }
  return proof;
}

SurfacePoints SpreadPoints(const Mesh& mesh, std::size_t count) {
  std::vector<double> area_up_to;
  double area = 0.0;
  const auto corner = [&](std::size_t face, int i) {
    return mesh.vertices[static_cast<std::size_t>(mesh.faces[face][i])].cast<double>().eval();
  };
  for (std::size_t face = 0; face < mesh.faces.size(); ++face) {
    const Eigen::Vector3d a = corner(face, 0);
    area += 0.5 * (corner(face, 1) - a).cross(corner(face, 2) - a).norm();
    area_up_to.push_back(area);
  }
  SurfacePoints spread;
  std::mt19937_64 random(4711);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (std::size_t i = 0; i < count && area > 0.0; ++i) {
    const double at =
        area * (static_cast<double>(i) + uniform(random)) / static_cast<double>(count);
    const auto found = std::lower_bound(area_up_to.begin(), area_up_to.end(), at);
    const auto face =
        std::min(static_cast<std::size_t>(found - area_up_to.begin()), area_up_to.size() - 1);
    const double root = std::sqrt(uniform(random));
    const double v = uniform(random);
    const Eigen::Vector3d a = corner(face, 0);
    const Eigen::Vector3d ab = corner(face, 1) - a;
    const Eigen::Vector3d ac = corner(face, 2) - a;
    spread.points.emplace_back(a + root * (1.0 - v) * ab + root * v * ac);
    spread.normals.emplace_back(ab.cross(ac).normalized());
  }
  return spread;
}

Result<std::vector<bool>> SeenPoints(const ProofScene& scene, const SurfacePoints& points) {
  const Result<sim::RayScene> rays = sim::RayScene::Create(scene.truth, Mesh{});
  if (!rays) return Forward(rays);
  const double min_cosine = std::cos(75.0 * M_PI / 180.0);
  std::vector<std::uint8_t> seen(points.points.size(), 0);
  ParallelFor(static_cast<int>(seen.size()), 1024, [&](int begin, int end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      for (const View& view : scene.views) {
        const Eigen::Vector3d camera = view.pose.T_object_camera.translation();
        const double cosine = (camera - points.points[i]).normalized().dot(points.normals[i]);
        if (!(cosine > min_cosine)) continue;
        if (rays->Sees(points.points[i], points.normals[i], camera)) seen[i] = 1;
      }
    }
  });
  return std::vector<bool>(seen.begin(), seen.end());
}

}  // namespace fringe_fusion::bench
