#include "truth.hpp"

#include <Eigen/Geometry>
#include <limits>

#include "common/constants.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion::sim {
namespace {

ViewTruth EmptyTruth(int width, int height) {
  ViewTruth truth;
  truth.u = Image<float>(width, height, kNan);
  truth.v = Image<float>(width, height, kNan);
  truth.points = Image<Eigen::Vector3f>(width, height, Eigen::Vector3f::Constant(kNan));
  truth.normals = Image<Eigen::Vector3f>(width, height, Eigen::Vector3f::Constant(kNan));
  truth.lit = Image<std::uint8_t>(width, height, 0);
  truth.on_part = Image<std::uint8_t>(width, height, 0);
  return truth;
}

// True when the middle of a face is in front of both devices, in their fields and unhidden.
class FaceVisibility {
 public:
  FaceVisibility(const RayScene& scene, const CellCalibration& calibration,
                 const Transform& T_object_camera)
      : scene_(scene),
        calibration_(calibration),
        T_camera_object_(T_object_camera.inverse()),
        T_projector_object_(calibration.T_projector_camera * T_camera_object_) {}

  [[nodiscard]] bool operator()(int face) const {
    const Eigen::Matrix3d corners = scene_.Corners(face);
    const Eigen::Vector3d middle = corners.rowwise().mean();
    const Eigen::Vector3d normal =
        (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0)).normalized();
    return Sees(calibration_.camera, T_camera_object_, middle, normal) &&
           Sees(calibration_.projector, T_projector_object_, middle, normal);
  }

 private:
  [[nodiscard]] bool Sees(const CameraModel& model, const Transform& T_device_object,
                          const Eigen::Vector3d& point, const Eigen::Vector3d& normal) const {
    const Eigen::Vector3d device = T_device_object.inverse().translation();
    return normal.dot(device - point) > 0.0 &&
           Covers(model, ProjectSafely(model, T_device_object * point)) &&
           scene_.Sees(point, normal, device);
  }

  const RayScene& scene_;
  const CellCalibration& calibration_;
  Transform T_camera_object_;
  Transform T_projector_object_;
};

}  // namespace

ViewTruth MakeTruth(const RayScene& scene, const CellCalibration& calibration,
                    const ViewSamples& view, const Image<Eigen::Vector2d>& rays,
                    const Transform& T_object_camera) {
  const int width = view.centers.width();
  const int height = view.centers.height();
  const Transform T_camera_object = T_object_camera.inverse();
  ViewTruth truth = EmptyTruth(width, height);
  truth.T_object_camera = T_object_camera;
  ParallelFor(height, 8, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < width; ++x) {
        const SurfaceSample& sample = view.centers(x, y);
        if (sample.face < 0) continue;
        const Eigen::Vector3d direction = T_object_camera.linear() * rays(x, y).homogeneous();
        const RayHit hit = scene.Intersect(sample.face, T_object_camera.translation(), direction);
        truth.u(x, y) = sample.u;
        truth.v(x, y) = sample.v;
        truth.points(x, y) = (T_camera_object * hit.point).cast<float>();
        truth.normals(x, y) = (T_camera_object.linear() * hit.normal).cast<float>();
        truth.lit(x, y) = sample.lit ? 1 : 0;
        truth.on_part(x, y) = sample.face < scene.num_part_faces() ? 1 : 0;
      }
    }
  });
  truth.face_visible.assign(static_cast<std::size_t>(scene.num_part_faces()), 0);
  const FaceVisibility visible(scene, calibration, T_object_camera);
  ParallelFor(scene.num_part_faces(), 1024, [&](int begin, int end) {
    for (int face = begin; face < end; ++face) {
      truth.face_visible[static_cast<std::size_t>(face)] = visible(face) ? 1 : 0;
    }
  });
  // A large face counts as seen when any of its pixels is, even if its middle is not.
  for (const SurfaceSample& sample : view.centers) {
    if (sample.lit && sample.face < scene.num_part_faces()) {
      truth.face_visible[static_cast<std::size_t>(sample.face)] = 1;
    }
  }
  return truth;
}

}  // namespace fringe_fusion::sim
