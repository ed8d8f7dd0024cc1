#include "ray_scene.hpp"

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::sim {
namespace {

Status CheckMesh(const Mesh& mesh, const char* owner) {
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!mesh.vertices[i].allFinite()) return Fail("{}: vertex {} is not finite", owner, i);
  }
  const int num_vertices = static_cast<int>(mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const Eigen::Vector3i& face = mesh.faces[i];
    if (face.minCoeff() < 0 || face.maxCoeff() >= num_vertices) {
      return Fail("{}: face {} names vertex {}, but there are {}", owner, i,
                  face.minCoeff() < 0 ? face.minCoeff() : face.maxCoeff(), num_vertices);
    }
  }
  return {};
}

void SetRay(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, RTCRay& ray) {
  ray.org_x = static_cast<float>(origin.x());
  ray.org_y = static_cast<float>(origin.y());
  ray.org_z = static_cast<float>(origin.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tnear = 0.0F;
  ray.tfar = std::numeric_limits<float>::infinity();
  ray.time = 0.0F;
  ray.mask = 0xffffffffU;
  ray.id = 0;
  ray.flags = 0;
}

}  // namespace

struct RayScene::Embree {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  Embree() = default;
  Embree(const Embree&) = delete;
  Embree& operator=(const Embree&) = delete;
  ~Embree() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }
};

RayScene::RayScene() : embree_(std::make_unique<Embree>()) {}
RayScene::RayScene(RayScene&&) noexcept = default;
RayScene& RayScene::operator=(RayScene&&) noexcept = default;
RayScene::~RayScene() = default;

Result<RayScene> RayScene::Create(const Mesh& part, const Mesh& background) {
  for (const auto& [mesh, owner] :
       {std::pair(&part, "object"), std::pair(&background, "background")}) {
    if (const Status status = CheckMesh(*mesh, owner); !status) {
      return tl::unexpected<Error>(status.error());
    }
  }
  if (part.faces.empty()) return Fail("object: no faces, at least 1 is needed to cast rays");
  RayScene scene;
  scene.Append(part);
  scene.num_part_faces_ = static_cast<int>(scene.faces_.size());
  scene.Append(background);
  scene.embree_->device = rtcNewDevice(nullptr);
  if (scene.embree_->device == nullptr) {
    return Fail("Embree: no device, error {}", static_cast<int>(rtcGetDeviceError(nullptr)));
  }
  scene.Commit();
  const RTCError error = rtcGetDeviceError(scene.embree_->device);
  if (error != RTC_ERROR_NONE) {
    return Fail("Embree: error {} while building {} triangles", static_cast<int>(error),
                scene.faces_.size());
  }
  return scene;
}

void RayScene::Append(const Mesh& mesh) {
  const int offset = static_cast<int>(vertices_.size());
  vertices_.insert(vertices_.end(), mesh.vertices.begin(), mesh.vertices.end());
  faces_.reserve(faces_.size() + mesh.faces.size());
  for (const Eigen::Vector3i& face : mesh.faces) {
    faces_.push_back(face + Eigen::Vector3i::Constant(offset));
  }
}

void RayScene::Commit() {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : vertices_) box.extend(vertex);
  // Well above the rounding of single precision at this size, well below anything measured.
  lift_m_ = 3e-6 * static_cast<double>(box.diagonal().norm()) + 1e-9;

  embree_->scene = rtcNewScene(embree_->device);
  rtcSetSceneFlags(embree_->scene, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry = rtcNewGeometry(embree_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                           3 * sizeof(float), vertices_.size());
  void* faces = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                        3 * sizeof(int), faces_.size());
  if (vertices != nullptr && faces != nullptr) {
    auto* vertex_out = static_cast<float*>(vertices);
    for (const Eigen::Vector3f& vertex : vertices_) {
      for (int i = 0; i < 3; ++i) *vertex_out++ = vertex[i];
    }
    auto* face_out = static_cast<unsigned*>(faces);
    for (const Eigen::Vector3i& face : faces_) {
      for (int i = 0; i < 3; ++i) *face_out++ = static_cast<unsigned>(face[i]);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(embree_->scene, geometry);
    // One thread: the order of triangles in a leaf, and with it which of two triangles wins on
    // their common edge, must not depend on the number of threads.
    const ThreadLimit one_thread(1);
    rtcCommitScene(embree_->scene);
  }
  rtcReleaseGeometry(geometry);
}

std::optional<RayHit> RayScene::Cast(const Eigen::Vector3d& origin,
                                     const Eigen::Vector3d& direction) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query;
  SetRay(origin, direction, query.ray);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(embree_->scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return Intersect(static_cast<int>(query.hit.primID), origin, direction);
}

RayHit RayScene::Intersect(int face, const Eigen::Vector3d& origin,
                           const Eigen::Vector3d& direction) const {
  const Eigen::Matrix3d corners = Corners(face);
  RayHit hit;
  hit.face = face;
  const Eigen::Vector3d edge_1 = corners.col(1) - corners.col(0);
  const Eigen::Vector3d edge_2 = corners.col(2) - corners.col(0);
  hit.normal = edge_1.cross(edge_2).normalized();
  const double along = hit.normal.dot(direction);
  hit.point = origin + hit.normal.dot(corners.col(0) - origin) / along * direction;
  // The plane of a sliver, or of a face seen edge-on, can miss the face by far: take its middle.
  const Eigen::Vector3d middle = corners.rowwise().mean();
  const double reach = (corners.colwise() - middle).colwise().norm().maxCoeff() + lift_m_;
  if (!((hit.point - middle).norm() <= reach)) {
    hit.point = origin + (middle - origin).dot(direction) / direction.squaredNorm() * direction;
  }
  if (along > 0.0) hit.normal = -hit.normal;
  return hit;
}

bool RayScene::Sees(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                    const Eigen::Vector3d& device) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay ray;
  const Eigen::Vector3d start = point + lift_m_ * normal;
  SetRay(start, device - start, ray);
  ray.tfar = 1.0F;
  rtcOccluded1(embree_->scene, &context, &ray);
  return ray.tfar >= 0.0F;
}

Eigen::Matrix3d RayScene::Corners(int face) const {
  const Eigen::Vector3i& indices = faces_[static_cast<std::size_t>(face)];
  Eigen::Matrix3d corners;
  for (int i = 0; i < 3; ++i) {
    corners.col(i) = vertices_[static_cast<std::size_t>(indices[i])].cast<double>();
  }
  return corners;
}

}  // namespace fringe_fusion::sim
