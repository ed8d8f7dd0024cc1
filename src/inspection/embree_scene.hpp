#pragma once

#include <embree3/rtcore.h>

#include <Eigen/Core>
#include <vector>

#include "fringe_fusion/common/result.hpp"

namespace fringe_fusion::internal {

/// Owns an Embree scene of one triangle mesh; geometry 0, primitive i is faces[i].
class EmbreeScene {
 public:
  [[nodiscard]] static Result<EmbreeScene> Create(const std::vector<Eigen::Vector3f>& vertices,
                                                  const std::vector<Eigen::Vector3i>& faces);
  EmbreeScene(EmbreeScene&& other) noexcept;
  EmbreeScene& operator=(EmbreeScene&& other) noexcept;
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;
  ~EmbreeScene();

  [[nodiscard]] RTCScene scene() const { return scene_; }

 private:
  EmbreeScene() = default;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
};

}  // namespace fringe_fusion::internal
