#include "fringe_fusion/io/opencv_calibration.hpp"

#include <array>
#include <opencv2/core.hpp>

#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/scan_folder.hpp"

namespace fringe_fusion {
namespace {

/// How one program names what it writes. A size is one matrix, or two numbers, or missing ("").
struct DeviceKeys {
  const char* matrix;
  const char* distortion;
  const char* size;
  const char* width;
  const char* height;
  bool is_height_first;
};
struct Layout {
  DeviceKeys camera;
  DeviceKeys projector;
  const char* R;
  const char* T;
  const char* rms;
};
constexpr std::array<Layout, 3> kLayouts = {{
    {{"cam_K", "cam_kc", "cam_size", "", "", false},
     {"pro_K", "pro_kc", "pro_size", "", "", false},
     "R",
     "T",
     "stereo_rms"},
    {{"Kc", "kc", "", "frameWidth", "frameHeight", false},
     {"Kp", "kp", "", "screenResX", "screenResY", false},
     "Rp",
     "Tp",
     "stereo_error"},
    {{"cam_int", "cam_dist", "img_shape", "", "", true},
     {"proj_int", "proj_dist", "", "", "", false},
     "roration",
     "translation",
     "rms"},
}};

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

Result<PictureSize> ReadSize(const cv::FileStorage& storage, const DeviceKeys& keys,
                             const PictureSize& given, const char* device,
                             const std::string& path) {
  PictureSize size;
  if (*keys.size != '\0') {
    const auto numbers = ReadNumbers(storage, keys.size, 2, path);
    if (!numbers) return Forward(numbers);
    size.width = static_cast<int>((*numbers)[keys.is_height_first ? 1 : 0]);
    size.height = static_cast<int>((*numbers)[keys.is_height_first ? 0 : 1]);
  } else if (*keys.width != '\0' && storage[keys.width].isInt() && storage[keys.height].isInt()) {
    size.width = static_cast<int>(storage[keys.width]);
    size.height = static_cast<int>(storage[keys.height]);
  }
  if (size.width == 0 && size.height == 0) size = given;
  if (size.width == 0 && size.height == 0) {
    return Fail("{}: does not state the size of the {}, give it", path, device);
  }
  const bool is_given = given.width != 0 || given.height != 0;
  if (is_given && (given.width != size.width || given.height != size.height)) {
    return Fail("{}: the {} has {} x {} pixels, not {} x {}", path, device, size.width, size.height,
                given.width, given.height);
  }
  return size;
}

Result<CameraModel> ReadDevice(const cv::FileStorage& storage, const DeviceKeys& keys,
                               const PictureSize& size, const std::string& path) {
  const auto matrix = ReadNumbers(storage, keys.matrix, 9, path);
  if (!matrix) return Forward(matrix);
  const auto distortion = ReadNumbers(storage, keys.distortion, 5, path);
  if (!distortion) return Forward(distortion);
  CameraModel model;
  model.width = size.width;
  model.height = size.height;
  model.fx = (*matrix)[0];
  model.cx = (*matrix)[2];
  model.fy = (*matrix)[4];
  model.cy = (*matrix)[5];
  std::copy(distortion->begin(), distortion->end(), model.distortion.begin());
  return model;
}

Result<Transform> ReadStereo(const cv::FileStorage& storage, const Layout& layout,
                             const std::string& path) {
  constexpr double kMillimetre = 1e-3;
  const auto R = ReadNumbers(storage, layout.R, 9, path);
  if (!R) return Forward(R);
  const auto T = ReadNumbers(storage, layout.T, 3, path);
  if (!T) return Forward(T);
  const Eigen::Matrix3d rotation =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R->data());
  const double error =
      (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error <= 1e-6) || !(rotation.determinant() > 0.0)) {
    return Fail("{}: {} is off by {} from orthonormal, limit 1e-6", path, layout.R, error);
  }
  const Result<Transform> transform = MakeTransform(
      kMillimetre * Eigen::Vector3d(T->data()), Eigen::Quaterniond(rotation).normalized().coeffs());
  if (!transform) return Fail("{}: {}", path, transform.error().message);
  return transform;
}

Result<CellCalibration> ReadStorage(const cv::FileStorage& storage, const Layout& layout,
                                    const std::array<PictureSize, 2>& given,
                                    const std::string& path) {
  CellCalibration calibration;
  const auto camera_size = ReadSize(storage, layout.camera, given[0], "camera", path);
  if (!camera_size) return Forward(camera_size);
  const auto camera = ReadDevice(storage, layout.camera, *camera_size, path);
  if (!camera) return Forward(camera);
  const auto projector_size = ReadSize(storage, layout.projector, given[1], "projector", path);
  if (!projector_size) return Forward(projector_size);
  const auto projector = ReadDevice(storage, layout.projector, *projector_size, path);
  if (!projector) return Forward(projector);
  const auto stereo = ReadStereo(storage, layout, path);
  if (!stereo) return Forward(stereo);
  calibration.camera = *camera;
  calibration.projector = *projector;
  calibration.T_projector_camera = *stereo;
  if (!storage[layout.rms].empty()) calibration.rms_px = storage[layout.rms].real();
  if (Status status = Validate(calibration, path); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return calibration;
}

/// The layout of which a file has most.
const Layout& LayoutOf(const cv::FileStorage& storage) {
  const Layout* best = kLayouts.data();
  int most = -1;
  for (const Layout& layout : kLayouts) {
    int num_keys = 0;
    for (const char* key : {layout.camera.matrix, layout.camera.distortion, layout.projector.matrix,
                            layout.projector.distortion, layout.R, layout.T}) {
      num_keys += storage[key].empty() ? 0 : 1;
    }
    if (num_keys <= most) continue;
    most = num_keys;
    best = &layout;
  }
  return *best;
}

Result<CellCalibration> Read(const std::string& path, const Layout* layout,
                             const std::array<PictureSize, 2>& given) {
  const Result<std::string> text = ReadFile(path);
  if (!text) return Forward(text);
  try {
    const cv::FileStorage storage(*text, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    if (!storage.isOpened()) return Fail("{}: not an OpenCV YAML or XML file", path);
    return ReadStorage(storage, layout != nullptr ? *layout : LayoutOf(storage), given, path);
  } catch (const cv::Exception& exception) {
    return Fail("{}: not an OpenCV YAML or XML file: {}", path, exception.err);
  }
}

}  // namespace

Result<CellCalibration> ReadSltkCalibration(const std::string& path) {
  return Read(path, kLayouts.data(), {});
}

Result<CellCalibration> ReadOpenCvCalibration(const std::string& path,
                                              const PictureSize& camera_size,
                                              const PictureSize& projector_size) {
  return Read(path, nullptr, {camera_size, projector_size});
}

}  // namespace fringe_fusion
