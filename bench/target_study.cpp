// Detection of targets against exact truth and beside OpenCV: target_study [FOLDER of real data]
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "fringe_fusion/calibration/detect_target.hpp"
#include "fringe_fusion/calibration/sighting_from_scan.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "src/calibration/target_homography.hpp"
#include "test/calibration/target_picture.hpp"

namespace fringe_fusion {
namespace {

using Pixels = std::vector<cv::Point2f>;

constexpr double kPi = 3.14159265358979323846;
constexpr int kWidth = 640;
constexpr int kHeight = 480;
constexpr double kSoftness_m = 2.5e-4;  // of DrawTarget's print
constexpr double kContrast_dn = 190.0;  // likewise, white less black

cv::Mat EightBit(const Image<float>& picture) {
  const cv::Mat values(picture.height(), picture.width(), CV_32F,
                       const_cast<float*>(picture.data()));  // cv::Mat has no view of const
  cv::Mat bytes;
  values.convertTo(bytes, CV_8U);
  return bytes;
}

CalibrationTarget Board(int columns, int rows, double pitch_m) {
  CalibrationTarget target;
  target.num_columns = columns;
  target.num_rows = rows;
  target.pitch_m = pitch_m;
  return target;
}

Pixels PixelsOf(const TargetSighting& sighting) {
  Pixels pixels;
  for (const PointSighting& point : sighting.points) {
    pixels.emplace_back(static_cast<float>(point.pixel_camera.x()),
                        static_cast<float>(point.pixel_camera.y()));
  }
  return pixels;
}

/// One way to find the corners of a board, in the order of its points or reversed.
using Finder = std::optional<Pixels> (*)(const Image<float>&, const CalibrationTarget&);

std::optional<Pixels> Ours(const Image<float>& picture, const CalibrationTarget& target) {
  const auto sighting = DetectTarget(picture, target, {});
  if (!sighting || sighting->points.size() != TargetPoints(target).size()) return std::nullopt;
  return PixelsOf(*sighting);
}

std::optional<Pixels> SubPix(const Image<float>& picture, const CalibrationTarget& target) {
  const cv::Mat bytes = EightBit(picture);
  Pixels pixels;
  if (!cv::findChessboardCorners(bytes, {target.num_columns, target.num_rows}, pixels)) {
    return std::nullopt;
  }
  cv::cornerSubPix(bytes, pixels, {5, 5}, {-1, -1},
                   {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-5});
  return pixels;
}

std::optional<Pixels> Sectors(const Image<float>& picture, const CalibrationTarget& target) {
  Pixels pixels;
  const int flags = cv::CALIB_CB_ACCURACY | cv::CALIB_CB_NORMALIZE_IMAGE;
  if (!cv::findChessboardCornersSB(EightBit(picture), {target.num_columns, target.num_rows}, pixels,
                                   flags)) {
    return std::nullopt;
  }
  return pixels;
}

constexpr std::array<std::pair<const char*, Finder>, 3> kFinders = {
    {{"DetectTarget", Ours},
     {"findChessboardCorners + cornerSubPix", SubPix},
     {"findChessboardCornersSB", Sectors}}};

/// Rms per axis of pixels that may run from either end [px].
double RmsPerAxis(const Pixels& found, const std::vector<Eigen::Vector2d>& truth) {
  double least = 1e9;
  for (const bool is_reversed : {false, true}) {
    double squares = 0.0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const auto& p = found[is_reversed ? found.size() - 1 - i : i];
      squares += (Eigen::Vector2d(p.x, p.y) - truth[i]).squaredNorm();
    }
    least = std::min(least, std::sqrt(squares / (2.0 * static_cast<double>(found.size()))));
  }
  return least;
}

struct Scene {
  Image<float> picture;
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();  ///< target [m] to pixels
};

/// A target at a random tilt of up to 40 degrees, with noise, rounded to whole grey values.
Scene MakeScene(const CalibrationTarget& target, double blur_px, double noise_dn,
                std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Scene scene;
  const Transform view = sim::TargetView(MakeTargetPrint(target), 0.5, 0.7 * uniform(random),
                                         0.5 * uniform(random), 0.5 * uniform(random));
  scene.H = test_support::TargetToPixel(kWidth, kHeight, 1000.0, view);
  scene.picture = test_support::DrawTarget(target, scene.H, kWidth, kHeight, false, blur_px);
  std::normal_distribution<float> normal(0.0F, static_cast<float>(noise_dn));
  for (float& value : scene.picture) {
    value = std::clamp(std::round(value + normal(random)), 0.0F, 255.0F);
  }
  return scene;
}

void StudyCorners() {
  const CalibrationTarget target = Board(8, 7, 0.02);
  const auto points = TargetPoints(target);
  fmt::print("corners, rms per axis over 12 poses [px]\n");
  for (const double blur_px : {0.6, 1.2}) {
    for (const double noise_dn : {1.0, 4.0}) {
      std::array<double, 3> squares{};
      std::array<int, 3> found{};
      std::mt19937 random(1);
      for (int pose = 0; pose < 12; ++pose) {
        const Scene scene = MakeScene(target, blur_px, noise_dn, random);
        std::vector<Eigen::Vector2d> truth;
        for (const Eigen::Vector3d& p : points) {
          truth.emplace_back((scene.H * Eigen::Vector3d(p.x(), p.y(), 1.0)).hnormalized());
        }
        for (std::size_t k = 0; k < kFinders.size(); ++k) {
          const auto pixels = kFinders[k].second(scene.picture, target);
          const double rms_px = pixels ? RmsPerAxis(*pixels, truth) : 1e9;
          if (rms_px > 5.0) continue;  // another order, or another board
          squares[k] += rms_px * rms_px;
          ++found[k];
        }
      }
      for (std::size_t k = 0; k < kFinders.size(); ++k) {
        fmt::print("  blur {:.1f} px, noise {:.0f} DN, {}: {:.4f}, {} of 12 poses\n", blur_px,
                   noise_dn, kFinders[k].first, std::sqrt(squares[k] / std::max(1, found[k])),
                   found[k]);
      }
    }
  }
}

CalibrationTarget Dots(TargetKind kind, double radius_m) {
  CalibrationTarget target = Board(8, 7, 0.02);
  target.kind = kind;
  target.dot_radius_m = radius_m;
  if (kind == TargetKind::kRingDots) {
    target.ring_radius_m = 0.0095;
    target.print_ratio = 0.45;
  }
  if (kind == TargetKind::kShiftedDots) target.num_shifts = 4;
  return target;
}

/// Science 1.2: sigma >= (sigma_n / A) sqrt(2 s / (sqrt(pi) r)), with the geometric mean radius.
double DotBound(const CalibrationTarget& target, const internal::Homography& homography,
                const Eigen::Vector2d& point, double blur_px, double noise_dn) {
  const double px_per_m = std::sqrt(std::abs(homography.Jacobian(point).determinant()));
  const double softness_px = kSoftness_m * px_per_m;
  // Softness and blur of the drawing, then the pixel of a sensor: here the print is averaged over
  // it beforehand.
  const double s = std::sqrt(blur_px * blur_px + 1.0 / 12.0 + softness_px * softness_px);
  const double noise = std::sqrt(noise_dn * noise_dn + 1.0 / 12.0);
  const double contrast = kContrast_dn * (1.0 - target.print_ratio);
  return noise / contrast * std::sqrt(2.0 * s / (std::sqrt(kPi) * px_per_m * target.dot_radius_m));
}

void StudyDots() {
  fmt::print("dots, error of the ellipse's centre over 12 poses\n");
  for (const TargetKind kind :
       {TargetKind::kCircles, TargetKind::kRingDots, TargetKind::kShiftedDots}) {
    for (const double radius_m : {0.003, 0.006}) {
      const CalibrationTarget target = Dots(kind, radius_m);
      const auto points = TargetPoints(target);
      std::mt19937 random(2);
      double squares = 0.0;
      double bound = 0.0;
      double normalised = 0.0;
      double count = 0.0;
      for (int pose = 0; pose < 12; ++pose) {
        const Scene scene = MakeScene(target, 0.7, 2.0, random);
        DetectConfig config;
        config.read_noise_dn = 2.0;
        config.gain_dn = 0.0;
        const auto sighting = DetectTarget(scene.picture, target, config);
        if (!sighting) {
          fmt::print("  {}\n", sighting.error().message);
          continue;
        }
        const internal::Homography homography{scene.H};
        for (const PointSighting& seen : sighting->points) {
          // An unmarked lattice may be numbered from its other end.
          const auto at = [&](std::size_t point) {
            return internal::EllipseCentre(homography, points[point].head<2>(), radius_m);
          };
          const auto index = static_cast<std::size_t>(seen.point);
          const std::size_t other = points.size() - 1 - index;
          const bool is_turned =
              (at(other) - seen.pixel_camera).norm() < (at(index) - seen.pixel_camera).norm();
          const Eigen::Vector2d error = seen.pixel_camera - at(is_turned ? other : index);
          squares += error.squaredNorm();
          normalised += error.dot(seen.covariance_camera_px2.inverse() * error);
          bound +=
              2.0 * std::pow(DotBound(target, homography, points[index].head<2>(), 0.7, 2.0), 2);
          count += 2.0;
        }
      }
      fmt::print(
          "  {}, radius {:.0f} px: rms {:.4f} px, {:.3f} of the bound, squared over stated "
          "{:.2f}\n",
          TargetKindName(kind), radius_m * 2000.0, std::sqrt(squares / count),
          std::sqrt(squares / bound), normalised / count);
    }
  }
}

Image<float> Mean(const std::vector<std::string>& files) {
  Image<float> mean;
  for (const std::string& file : files) {
    const auto pixels = ReadGrayImage(file);
    if (!pixels) throw std::runtime_error(pixels.error().message);
    const Image<float> grey = GreyPicture(*pixels);
    if (mean.empty()) mean = Image<float>(grey.width(), grey.height());
    for (std::size_t i = 0; i < grey.size(); ++i) {
      mean[i] += grey[i] / static_cast<float>(files.size());
    }
  }
  return mean;
}

/// What is left when OpenCV calibrates the camera with the points of each finder.
void StudyReal(const std::string& name, const std::vector<Image<float>>& pictures,
               const CalibrationTarget& target) {
  std::vector<cv::Point3f> board;
  for (const Eigen::Vector3d& p : TargetPoints(target)) {
    board.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()), 0.0F);
  }
  for (const auto& [finder_name, finder] : kFinders) {
    std::vector<Pixels> pixels;
    for (const Image<float>& picture : pictures) {
      auto found = finder(picture, target);
      if (found) pixels.push_back(std::move(*found));
    }
    if (pixels.size() < 3) {
      fmt::print("{}: {}: {} of {} poses\n", name, finder_name, pixels.size(), pictures.size());
      continue;
    }
    cv::Mat K;
    cv::Mat distortion;
    std::vector<cv::Mat> rotations;
    std::vector<cv::Mat> translations;
    const double rms = cv::calibrateCamera(
        std::vector<std::vector<cv::Point3f>>(pixels.size(), board), pixels,
        {pictures[0].width(), pictures[0].height()}, K, distortion, rotations, translations);
    fmt::print("{}: {}: {} of {} poses, calibrateCamera leaves {:.4f} px, fx {:.2f}\n", name,
               finder_name, pixels.size(), pictures.size(), rms, K.at<double>(0, 0));
  }
}

void StudyRealData(const std::string& folder) {
  std::vector<Image<float>> slstudio;
  for (const int pose : {1, 3, 4, 5, 6}) {
    std::vector<std::string> files;
    for (int i = 0; i < 12; ++i) {
      files.push_back(
          fmt::format("{}/slstudio/calibration/calseq{}/frameSeq_{:02d}.png", folder, pose, i));
    }
    slstudio.push_back(Mean(files));
  }
  StudyReal("slstudio", slstudio, Board(13, 9, 0.01));
  std::vector<Image<float>> kamino;
  for (int pose = 0; pose < 4; ++pose) {
    kamino.push_back(
        Mean({fmt::format("{}/kamino_procam/capture_{}/graycode_40.png", folder, pose)}));
  }
  StudyReal("kamino_procam", kamino, Board(7, 9, 0.075));
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  if (argc > 1) {
    fringe_fusion::StudyRealData(argv[1]);
  } else {
    fringe_fusion::StudyCorners();
    fringe_fusion::StudyDots();
  }
  return 0;
}
