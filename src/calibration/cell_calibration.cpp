#include "fringe_fusion/calibration/cell_calibration.hpp"

#include <cmath>
#include <cstdint>
#include <cstring>

namespace fringe_fusion {
namespace {

// FNV-1a, 64 bit: a fingerprint, not a secret.
class Fingerprint {
 public:
  void Add(double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof(bits));
    for (int byte = 0; byte < 8; ++byte) Mix(static_cast<unsigned char>(bits >> (8 * byte)));
  }
  void Add(const CameraModel& m) {
    for (const double value :
         {static_cast<double>(m.width), static_cast<double>(m.height), m.fx, m.fy, m.cx, m.cy}) {
      Add(value);
    }
    for (const double k : m.distortion) Add(k);
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  void Mix(unsigned char byte) { value_ = (value_ ^ byte) * 1099511628211ULL; }
  std::uint64_t value_ = 14695981039346656037ULL;
};

}  // namespace

Status Validate(const CellCalibration& calibration, const std::string& owner) {
  if (Status status = Validate(calibration.camera, owner + ": camera"); !status) return status;
  if (Status status = Validate(calibration.projector, owner + ": projector"); !status) {
    return status;
  }
  const Transform& T = calibration.T_projector_camera;
  if (!T.matrix().allFinite()) {
    return Fail("{}: T_projector_camera has a value that is not finite", owner);
  }
  if (!(T.translation().norm() > 1e-6)) {
    return Fail("{}: baseline {} m must be longer than 1e-6 m", owner, T.translation().norm());
  }
  return {};
}

std::string CalibrationId(const CellCalibration& calibration) {
  Fingerprint fingerprint;
  fingerprint.Add(calibration.camera);
  fingerprint.Add(calibration.projector);
  // A pose loses its last bits on the way through a quaternion or tf.
  constexpr double kStep = 1e-9;
  const Transform::MatrixType& T = calibration.T_projector_camera.matrix();
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 3; ++row) fingerprint.Add(std::round(T(row, column) / kStep) + 0.0);
  }
  return fmt::format("{:016x}", fingerprint.value());
}

}  // namespace fringe_fusion
