#include "embree_scene.hpp"

#include <cstring>
#include <utility>

namespace fringe_fusion::internal {

EmbreeScene::EmbreeScene(EmbreeScene&& other) noexcept
    : device_(std::exchange(other.device_, nullptr)),
      scene_(std::exchange(other.scene_, nullptr)) {}

EmbreeScene& EmbreeScene::operator=(EmbreeScene&& other) noexcept {
  std::swap(device_, other.device_);
  std::swap(scene_, other.scene_);
  return *this;
}

EmbreeScene::~EmbreeScene() {
  if (scene_ != nullptr) rtcReleaseScene(scene_);
  if (device_ != nullptr) rtcReleaseDevice(device_);
}

Result<EmbreeScene> EmbreeScene::Create(const std::vector<Eigen::Vector3f>& vertices,
                                        const std::vector<Eigen::Vector3i>& faces) {
  EmbreeScene result;
  result.device_ = rtcNewDevice(nullptr);
  if (result.device_ == nullptr) {
    return Fail("Embree: no device, error {}", static_cast<int>(rtcGetDeviceError(nullptr)));
  }
  result.scene_ = rtcNewScene(result.device_);
  // No missed hits between neighbouring triangles.
  rtcSetSceneFlags(result.scene_, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry = rtcNewGeometry(result.device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  void* vertex_buffer = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                RTC_FORMAT_FLOAT3, 12, vertices.size());
  void* index_buffer = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                               12, faces.size());
  static_assert(sizeof(Eigen::Vector3f) == 12 && sizeof(Eigen::Vector3i) == 12,
                "the buffers are copied as they are");
  if (vertex_buffer != nullptr && index_buffer != nullptr) {
    std::memcpy(vertex_buffer, vertices.data()->data(), 12 * vertices.size());
    std::memcpy(index_buffer, faces.data()->data(), 12 * faces.size());
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(result.scene_, geometry, 0);
  }
  rtcReleaseGeometry(geometry);
  rtcCommitScene(result.scene_);
  const RTCError error = rtcGetDeviceError(result.device_);
  if (error != RTC_ERROR_NONE) {
    return Fail("Embree: cannot take {} triangles, error {}", faces.size(),
                static_cast<int>(error));
  }
  return result;
}

}  // namespace fringe_fusion::internal
