#include <opencv2/core.hpp>

#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/scan_folder.hpp"

namespace fringe_fusion {
namespace {

// Reads a matrix of `count` numbers, in any shape, in row order.
Result<std::vector<double>> ReadNumbers(const cv::FileStorage& storage, const std::string& key,
                                        std::size_t count, const std::string& path) {
  const cv::FileNode node = storage[key];
  if (node.empty()) return Fail("{}: required key '{}' is missing", path, key);
  cv::Mat matrix;
  node >> matrix;
  if (matrix.total() != count || matrix.channels() != 1) {
    return Fail("{}: {} has {} numbers, must have {}", path, key, matrix.total(), count);
  }
  matrix.convertTo(matrix, CV_64F);
  return std::vector<double>(matrix.begin<double>(), matrix.end<double>());
}

Result<CameraModel> ReadDevice(const cv::FileStorage& storage, const std::string& prefix,
                               const std::string& path) {
  const auto size = ReadNumbers(storage, prefix + "_size", 2, path);
  if (!size) return Forward(size);
  const auto matrix = ReadNumbers(storage, prefix + "_K", 9, path);
  if (!matrix) return Forward(matrix);
  const auto distortion = ReadNumbers(storage, prefix + "_kc", 5, path);
  if (!distortion) return Forward(distortion);
  CameraModel model;
  model.width = static_cast<int>((*size)[0]);
  model.height = static_cast<int>((*size)[1]);
  model.fx = (*matrix)[0];
  model.cx = (*matrix)[2];
  model.fy = (*matrix)[4];
  model.cy = (*matrix)[5];
  std::copy(distortion->begin(), distortion->end(), model.distortion.begin());
  return model;
}

Result<Transform> ReadStereo(const cv::FileStorage& storage, const std::string& path) {
  constexpr double kMillimetre = 1e-3;
  const auto R = ReadNumbers(storage, "R", 9, path);
  if (!R) return Forward(R);
  const auto T = ReadNumbers(storage, "T", 3, path);
  if (!T) return Forward(T);
  const Eigen::Matrix3d rotation =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R->data());
  const double error =
      (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error <= 1e-6) || !(rotation.determinant() > 0.0)) {
    return Fail("{}: R is off by {} from orthonormal, limit 1e-6", path, error);
  }
  const Result<Transform> transform = MakeTransform(
      kMillimetre * Eigen::Vector3d(T->data()), Eigen::Quaterniond(rotation).normalized().coeffs());
  if (!transform) return Fail("{}: {}", path, transform.error().message);
  return transform;
}

Result<CellCalibration> ReadStorage(const cv::FileStorage& storage, const std::string& path) {
  const auto camera = ReadDevice(storage, "cam", path);
  if (!camera) return Forward(camera);
  const auto projector = ReadDevice(storage, "pro", path);
  if (!projector) return Forward(projector);
  const auto stereo = ReadStereo(storage, path);
  if (!stereo) return Forward(stereo);
  CellCalibration calibration;
  calibration.camera = *camera;
  calibration.projector = *projector;
  calibration.T_projector_camera = *stereo;
  if (!storage["stereo_rms"].empty()) calibration.rms_px = storage["stereo_rms"].real();
  if (Status status = Validate(calibration, path); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return calibration;
}

}  // namespace

Result<CellCalibration> ReadSltkCalibration(const std::string& path) {
  const Result<std::string> text = ReadFile(path);
  if (!text) return Forward(text);
  try {
    const cv::FileStorage storage(
        *text, cv::FileStorage::READ | cv::FileStorage::MEMORY | cv::FileStorage::FORMAT_YAML);
    if (!storage.isOpened()) return Fail("{}: not an OpenCV YAML file", path);
    return ReadStorage(storage, path);
  } catch (const cv::Exception& exception) {
    return Fail("{}: not an OpenCV YAML file: {}", path, exception.err);
  }
}

}  // namespace fringe_fusion
