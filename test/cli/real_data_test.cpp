// Real captured data, read in place, held against what their authors published.
#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <nanoflann.hpp>

#include "fringe_fusion/inspection/compare.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/poses_conf.hpp"
#include "fringe_fusion/registration/register_views.hpp"
#include "fringe_program.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

using Points = std::vector<Eigen::Vector3f>;

fs::path DataFolder() {
  const char* folder = std::getenv("FRINGE_FUSION_DATA");
  return folder != nullptr ? fs::path(folder) : fs::path(SOURCE_DIR "/../shared/data");
}

#define SKIP_WITHOUT_DATA(path) \
  if (!fs::exists(path)) GTEST_SKIP() << "skipped: no data at " << (path).string()

struct PointSet {
  const Points& points;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return points.size(); }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i][static_cast<Eigen::Index>(axis)];
  }
  template <typename Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

/// Distance from every point of `from` to the nearest of `to`, sorted [units of the points].
std::vector<double> NearestDistances(const Points& from, const Points& to) {
  using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointSet>,
                                                   PointSet, 3>;
  const PointSet set{to};
  const Tree tree(3, set, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  std::vector<double> distances;
  for (const Eigen::Vector3f& point : from) {
    std::size_t index = 0;
    float squared = 0.0F;
    nanoflann::KNNResultSet<float> result(1);
    result.init(&index, &squared);
    tree.findNeighbors(result, point.data(), nanoflann::SearchParams());
    distances.push_back(std::sqrt(static_cast<double>(squared)));
  }
  std::sort(distances.begin(), distances.end());
  return distances;
}

double Quantile(const std::vector<double>& sorted, double q) {
  return sorted[static_cast<std::size_t>(q * static_cast<double>(sorted.size() - 1))];
}

Points ValidPoints(const RangeImage& range, const Transform& T_object_camera) {
  Points points;
  for (const Eigen::Vector3f& point : range.points) {
    if (point.allFinite()) points.push_back(T_object_camera.cast<float>() * point);
  }
  return points;
}

TEST(RealData, SltkScanAgreesWithThePublishedCloud) {
  const fs::path data = DataFolder() / "sltk";
  SKIP_WITHOUT_DATA(data);
  const TemporaryFolder folder("fringe_sltk");
  const Outcome outcome = RunFringe({"run", "--scan", SOURCE_DIR "/config/datasets/sltk", "--out",
                                     (folder / "run").string(), "--quiet"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto mesh = ReadMesh((folder / "run/mesh.ply").string());
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_GT(mesh->faces.size(), 10000U);

  const auto cloud = ReadMesh((folder / "run/cloud.ply").string());
  ASSERT_TRUE(cloud) << cloud.error().message;
  const Points& ours = cloud->vertices;
  auto published = ReadMesh((data / "scan_0020_cloud.ply").string(), 1e-3);
  ASSERT_TRUE(published) << published.error().message;
  // Its author turned y and z around.
  for (Eigen::Vector3f& point : published->vertices) point = {point.x(), -point.y(), -point.z()};

  const std::vector<double> accuracy_m = NearestDistances(ours, published->vertices);
  const std::vector<double> coverage_m = NearestDistances(published->vertices, ours);
  const auto within = std::upper_bound(coverage_m.begin(), coverage_m.end(), 0.5e-3);
  const double covered_ratio =
      static_cast<double>(within - coverage_m.begin()) / static_cast<double>(coverage_m.size());
  RecordProperty("num_points", static_cast<int>(ours.size()));
  RecordProperty("median_um", static_cast<int>(1e6 * Quantile(accuracy_m, 0.5)));
  RecordProperty("covered_permille", static_cast<int>(1e3 * covered_ratio));
  fmt::print(
      "sltk: {} points, to the published cloud median {:.4f} mm, 90 % {:.4f} mm; {:.2f} % "
      "of the published points within 0.5 mm\n",
      ours.size(), 1e3 * Quantile(accuracy_m, 0.5), 1e3 * Quantile(accuracy_m, 0.9),
      100.0 * covered_ratio);
  EXPECT_LE(Quantile(accuracy_m, 0.5), 0.14e-3);
  EXPECT_GE(covered_ratio, 0.95);
}

TEST(RealData, BunnyFusesIntoThePublishedSurface) {
  const fs::path data = DataFolder() / "stanford_bunny";
  SKIP_WITHOUT_DATA(data);
  const TemporaryFolder folder("fringe_bunny");
  const std::string file = (folder / "mesh.ply").string();
  const Outcome outcome =
      RunFringe({"fuse", "--views", (data / "bun.conf").string(), "--out", file, "--quiet"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto mesh = ReadMesh(file);
  ASSERT_TRUE(mesh) << mesh.error().message;
  const auto published = ReadMesh((data / "stanford-bunny.obj").string());
  ASSERT_TRUE(published) << published.error().message;
  const auto result = Compare(*mesh, *published, InspectionConfig{});
  ASSERT_TRUE(result) << result.error().message;
  const DistanceStatistics& deviation = result->model_to_reference;
  fmt::print(
      "bunny: {} faces, to the published surface median {:.4f} mm, 95 % {:.4f} mm, {} of {} "
      "vertices farther than 5 mm; back median {:.4f} mm, 95 % {:.4f} mm\n",
      mesh->faces.size(), 1e3 * deviation.median_abs_m, 1e3 * deviation.p95_abs_m,
      deviation.num_far, mesh->vertices.size(), 1e3 * result->reference_to_model.median_abs_m,
      1e3 * result->reference_to_model.p95_abs_m);
  EXPECT_LE(deviation.median_abs_m, 0.12e-3);
  EXPECT_LE(deviation.p95_abs_m, 0.5e-3);
  // What is far off must not hide in the count of strays.
  EXPECT_LE(deviation.num_far, mesh->vertices.size() / 1000);
}

/// The rigid motion that takes all points a[i] to b[i] with the least squares.
Transform Align(const Points& a, const Points& b) {
  Eigen::Matrix3Xd from(3, static_cast<Eigen::Index>(a.size()));
  Eigen::Matrix3Xd to(3, static_cast<Eigen::Index>(b.size()));
  for (std::size_t i = 0; i < a.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = a[i].cast<double>();
    to.col(static_cast<Eigen::Index>(i)) = b[i].cast<double>();
  }
  return Transform(Eigen::umeyama(from, to, false));
}

struct Bunny {
  std::vector<RangeImage> scans;
  std::vector<Transform> published;
};

Bunny ReadBunny(const fs::path& data) {
  Bunny bunny;
  const auto entries = ReadPosesConf((data / "bun.conf").string());
  EXPECT_TRUE(entries) << entries.error().message;
  for (const ConfEntry& entry : *entries) {
    auto range = ReadRangeImage((data / entry.file).string());
    EXPECT_TRUE(range) << range.error().message;
    range->line_of_sight.directional = true;
    range->line_of_sight.camera = Eigen::Vector3f::UnitZ();
    for (std::size_t i = 0; i < range->points.size(); ++i) {
      range->sigma_range[i] = range->points[i].allFinite() ? 1e-4F : range->sigma_range[i];
      range->sigma_lateral[i] = range->points[i].allFinite() ? 1e-4F : range->sigma_lateral[i];
    }
    bunny.scans.push_back(EstimateNormals(*range, TriangulationConfig{}));
    bunny.published.push_back(entry.T_object_camera);
  }
  return bunny;
}

TEST(RealData, BunnyRegistersNearThePublishedPoses) {
  const fs::path data = DataFolder() / "stanford_bunny";
  SKIP_WITHOUT_DATA(data);
  const TemporaryFolder folder("fringe_bunny");
  const std::string file = (folder / "poses.conf").string();
  const Outcome outcome =
      RunFringe({"register", "--views", (data / "bun.conf").string(), "--out", file, "--quiet"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto registered = ReadPosesConf(file);
  ASSERT_TRUE(registered) << registered.error().message;
  const Bunny bunny = ReadBunny(data);
  ASSERT_EQ(registered->size(), bunny.scans.size());

  Points all_registered;
  Points all_published;
  std::vector<std::size_t> begins;
  for (std::size_t i = 0; i < bunny.scans.size(); ++i) {
    begins.push_back(all_registered.size());
    const Points a = ValidPoints(bunny.scans[i], (*registered)[i].T_object_camera);
    const Points b = ValidPoints(bunny.scans[i], bunny.published[i]);
    all_registered.insert(all_registered.end(), a.begin(), a.end());
    all_published.insert(all_published.end(), b.begin(), b.end());
  }
  begins.push_back(all_registered.size());
  const Transform T_published_registered = Align(all_registered, all_published);
  for (std::size_t scan = 0; scan + 1 < begins.size(); ++scan) {
    double sum = 0.0;
    for (std::size_t i = begins[scan]; i < begins[scan + 1]; ++i) {
      const Eigen::Vector3d moved = T_published_registered * all_registered[i].cast<double>();
      sum += (moved - all_published[i].cast<double>()).squaredNorm();
    }
    const double rms_m = std::sqrt(sum / static_cast<double>(begins[scan + 1] - begins[scan]));
    fmt::print("bunny: {} moved by {:.3f} mm rms\n", (*registered)[scan].file, 1e3 * rms_m);
    EXPECT_LE(rms_m, 0.4e-3) << (*registered)[scan].file;
  }
}

/// Square tiles of the image by turns: the same surface is seen by both halves, but no point of
/// one is a point of the other.
RangeImage KeepTiles(const RangeImage& range, int parity) {
  constexpr int kTilePx = 8;
  RangeImage kept = range;
  for (int y = 0; y < range.height; ++y) {
    for (int x = 0; x < range.width; ++x) {
      if ((x / kTilePx + y / kTilePx) % 2 == parity) continue;
      kept.points(x, y).setConstant(std::numeric_limits<float>::quiet_NaN());
      kept.normals(x, y).setConstant(std::numeric_limits<float>::quiet_NaN());
    }
  }
  return kept;
}

/// Median distance of each scan's points to the tangent plane at the nearest point of all others,
/// over points that have one within 2 mm.
double OverlapResidual(const std::vector<RangeImage>& scans, const std::vector<Transform>& poses) {
  std::vector<double> residuals;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    Points others;
    Points normals;
    for (std::size_t j = 0; j < scans.size(); ++j) {
      if (j == i) continue;
      const Eigen::Isometry3f T = poses[j].cast<float>();
      for (std::size_t k = 0; k < scans[j].points.size(); ++k) {
        if (!scans[j].points[k].allFinite() || !scans[j].normals[k].allFinite()) continue;
        others.push_back(T * scans[j].points[k]);
        normals.push_back(T.linear() * scans[j].normals[k]);
      }
    }
    using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointSet>,
                                                     PointSet, 3>;
    const PointSet set{others};
    const Tree tree(3, set, nanoflann::KDTreeSingleIndexAdaptorParams(16));
    const Points points = ValidPoints(scans[i], poses[i]);
    for (const Eigen::Vector3f& point : points) {
      std::size_t index = 0;
      float squared = 0.0F;
      nanoflann::KNNResultSet<float> result(1);
      result.init(&index, &squared);
      tree.findNeighbors(result, point.data(), nanoflann::SearchParams());
      if (!(squared < 4e-6F)) continue;
      residuals.push_back(static_cast<double>(std::abs(normals[index].dot(point - others[index]))));
    }
  }
  std::sort(residuals.begin(), residuals.end());
  return residuals.empty() ? std::nan("") : Quantile(residuals, 0.5);
}

TEST(RealData, BunnyRegistrationImprovesPointsThatItDidNotUse) {
  const fs::path data = DataFolder() / "stanford_bunny";
  SKIP_WITHOUT_DATA(data);
  const Bunny bunny = ReadBunny(data);
  ViewGraph graph;
  std::vector<RangeImage> held_out;
  for (std::size_t i = 0; i < bunny.scans.size(); ++i) {
    View view;
    view.id = static_cast<int>(i);
    view.range = KeepTiles(bunny.scans[i], 0);
    view.pose.T_object_camera = bunny.published[i];
    view.pose.source = PoseSource::kFile;
    graph.views.push_back(std::move(view));
    held_out.push_back(KeepTiles(bunny.scans[i], 1));
  }
  const auto result = RegisterViews(graph, RegistrationConfig{});
  ASSERT_TRUE(result) << result.error().message;
  std::vector<Transform> registered;
  for (const RegisteredView& view : result->views) registered.push_back(view.pose.T_object_camera);
  const double before_m = OverlapResidual(held_out, bunny.published);
  const double after_m = OverlapResidual(held_out, registered);
  fmt::print("bunny: held-out overlap residual {:.4f} mm published, {:.4f} mm registered\n",
             1e3 * before_m, 1e3 * after_m);
  EXPECT_LE(after_m, before_m);
}

TEST(RealData, BagCloudIsRead) {
  const fs::path data = DataFolder() / "ros_bag";
  SKIP_WITHOUT_DATA(data);
  const TemporaryFolder folder("fringe_bag");
  const std::string file = (folder / "cloud.ply").string();
  const std::string topic = "/euclidean_cluster_indices_decomposer/output00";
  const Outcome outcome = RunFringe(
      {"import", "--bag", (data / "watercan.bag").string(), "--cloud", topic, "--out", file});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto cloud = ReadMesh(file);
  ASSERT_TRUE(cloud) << cloud.error().message;
  EXPECT_EQ(cloud->vertices.size(), 13966U);
  EXPECT_EQ(cloud->colors.size(), cloud->vertices.size());

  const Outcome wrong = RunFringe({"import", "--bag", (data / "test.bag").string(), "--cloud",
                                   topic, "--out", file, "--quiet"});
  EXPECT_EQ(wrong.exit_status, 1);
  EXPECT_NE(wrong.err.find("/depth_image_error/result"), std::string::npos) << wrong.err;
}

}  // namespace
}  // namespace fringe_fusion::cli
