#include "fringe_fusion/inspection/picture.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "embree_scene.hpp"
#include "fringe_fusion/common/parallel.hpp"

namespace fringe_fusion {
namespace {

constexpr int kSubpixels = 2;  // per axis, for smooth edges
const Eigen::Vector3f kFrontColor(205.0F, 205.0F, 205.0F);
const Eigen::Vector3f kBackColor(120.0F, 145.0F, 215.0F);

// Orthographic view that fits a mesh.
struct Camera {
  Eigen::Vector3f right = Eigen::Vector3f::UnitX();
  Eigen::Vector3f up = Eigen::Vector3f::UnitY();
  Eigen::Vector3f to_eye = Eigen::Vector3f::UnitZ();
  Eigen::Vector3f eye_center = Eigen::Vector3f::Zero();  // in front of the mesh
  float pixel_m = 1.0F;
};

Camera FitCamera(const Mesh& mesh, const Eigen::Vector3f& direction, int width, int height) {
  Camera camera;
  camera.to_eye = direction.normalized();
  // z of `object` points up in the picture unless one looks along it.
  const Eigen::Vector3f hint =
      std::abs(camera.to_eye.z()) > 0.99F ? Eigen::Vector3f::UnitY() : Eigen::Vector3f::UnitZ();
  camera.right = hint.cross(camera.to_eye).normalized();
  camera.up = camera.to_eye.cross(camera.right);
  Eigen::Matrix3f R_view_object;
  R_view_object << camera.right.transpose(), camera.up.transpose(), camera.to_eye.transpose();
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max());
  Eigen::Vector3f high = -low;
  for (const Eigen::Vector3i& face : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3f p = R_view_object * mesh.vertices[static_cast<std::size_t>(face[k])];
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
  }
  const Eigen::Vector3f size = high - low;
  constexpr float kMargin = 1.08F;
  camera.pixel_m = kMargin * std::max(size.x() / static_cast<float>(width),
                                      size.y() / static_cast<float>(height));
  if (!(camera.pixel_m > 0.0F)) camera.pixel_m = 1.0F;
  Eigen::Vector3f center = 0.5F * (low + high);
  center.z() = high.z() + 0.1F * size.norm() + camera.pixel_m;
  camera.eye_center = R_view_object.transpose() * center;
  return camera;
}

RTCRayHit MakeRay(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) {
  RTCRayHit ray;
  ray.ray.org_x = origin.x();
  ray.ray.org_y = origin.y();
  ray.ray.org_z = origin.z();
  ray.ray.dir_x = direction.x();
  ray.ray.dir_y = direction.y();
  ray.ray.dir_z = direction.z();
  ray.ray.tnear = 0.0F;
  ray.ray.tfar = std::numeric_limits<float>::infinity();
  ray.ray.time = 0.0F;
  ray.ray.mask = 0xffffffffU;
  ray.ray.id = 0;
  ray.ray.flags = 0;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return ray;
}

class Painter {
 public:
  Painter(const Mesh& mesh, const std::vector<Eigen::Vector3f>& normals, const Camera& camera,
          bool use_colors)
      : mesh_(mesh), normals_(normals), camera_(camera), use_colors_(use_colors) {}

  // Colour seen along one ray, 0..255 per channel; white where there is nothing.
  [[nodiscard]] Eigen::Vector3f Trace(RTCScene scene, const Eigen::Vector3f& origin) const {
    RTCRayHit ray = MakeRay(origin, -camera_.to_eye);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene, &context, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return Eigen::Vector3f::Constant(255.0F);
    const Eigen::Vector3f weights(1.0F - ray.hit.u - ray.hit.v, ray.hit.u, ray.hit.v);
    return Shade(mesh_.faces[ray.hit.primID], weights);
  }

 private:
  [[nodiscard]] Eigen::Vector3f Shade(const Eigen::Vector3i& face,
                                      const Eigen::Vector3f& weights) const {
    const std::array<std::size_t, 3> corner = {static_cast<std::size_t>(face[0]),
                                               static_cast<std::size_t>(face[1]),
                                               static_cast<std::size_t>(face[2])};
    const Eigen::Vector3f flat = (mesh_.vertices[corner[1]] - mesh_.vertices[corner[0]])
                                     .cross(mesh_.vertices[corner[2]] - mesh_.vertices[corner[0]])
                                     .normalized();
    Eigen::Vector3f smooth = Eigen::Vector3f::Zero();
    Eigen::Vector3f color = Eigen::Vector3f::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
      const float weight = weights[static_cast<Eigen::Index>(k)];
      smooth += weight * normals_[corner[k]];
      if (use_colors_) {
        const Rgb8& vertex = mesh_.colors[corner[k]];
        color += weight * Eigen::Vector3f(vertex.r, vertex.g, vertex.b);
      }
    }
    smooth.normalize();
    // Across a sharp edge of a coarse mesh the vertex normals fit neither side.
    constexpr float kSharp = 0.85F;
    const Eigen::Vector3f normal = smooth.dot(flat) > kSharp ? smooth : flat;
    const bool front = flat.dot(camera_.to_eye) >= 0.0F;
    // The lamp is near the eye, a little to the upper left, so that shapes stand out.
    const Eigen::Vector3f to_lamp =
        (camera_.to_eye + 0.35F * camera_.up - 0.25F * camera_.right).normalized();
    const float lambert = std::abs(normal.dot(to_lamp));
    if (!front) return (0.35F + 0.65F * lambert) * kBackColor;
    // Colours carry figures: shade them less than bare grey.
    if (use_colors_) return (0.5F + 0.5F * lambert) * color;
    return (0.2F + 0.8F * lambert) * kFrontColor;
  }

  const Mesh& mesh_;
  const std::vector<Eigen::Vector3f>& normals_;
  const Camera& camera_;
  bool use_colors_;
};

std::uint8_t ToByte(float value) {
  return static_cast<std::uint8_t>(std::lround(std::min(255.0F, std::max(0.0F, value))));
}

Rgb8 ToRgb(const Eigen::Vector3f& color) {
  return {ToByte(color.x()), ToByte(color.y()), ToByte(color.z())};
}

Status CheckInput(const Mesh& mesh, const Eigen::Vector3f& direction, int width, int height,
                  bool use_colors) {
  if (width < 1 || height < 1) return Fail("picture: size {} x {} must be positive", width, height);
  if (!direction.allFinite() || !(direction.norm() > 0.0F)) {
    return Fail("picture: the direction must be finite and not zero");
  }
  if (mesh.faces.empty()) return Fail("picture: the mesh has no faces");
  if (use_colors && mesh.colors.size() != mesh.vertices.size()) {
    return Fail("picture: {} colours for {} vertices", mesh.colors.size(), mesh.vertices.size());
  }
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const Eigen::Vector3i& face = mesh.faces[i];
    if (face.minCoeff() < 0 || static_cast<std::size_t>(face.maxCoeff()) >= mesh.vertices.size()) {
      return Fail("picture: face {} names a vertex outside [0, {})", i, mesh.vertices.size());
    }
    for (int k = 0; k < 3; ++k) {
      if (!mesh.vertices[static_cast<std::size_t>(face[k])].allFinite()) {
        return Fail("picture: vertex {} is not finite", face[k]);
      }
    }
  }
  return {};
}

// The colour scale of deviations: blue, cyan, green, yellow, red over [-1, 1].
Rgb8 DeviationColor(float ratio) {
  const float t = std::min(1.0F, std::max(-1.0F, ratio));
  const float rising = std::min(1.0F, 2.0F * std::abs(t));
  const float falling = std::min(1.0F, 2.0F * (1.0F - std::abs(t)));
  if (t < 0.0F) return ToRgb(255.0F * Eigen::Vector3f(0.0F, falling, rising));
  return ToRgb(255.0F * Eigen::Vector3f(rising, falling, 0.0F));
}

}  // namespace

Result<Image<Rgb8>> RenderMesh(const Mesh& mesh, const Eigen::Vector3f& direction, int width,
                               int height, bool use_colors) {
  const bool colored = use_colors && !mesh.colors.empty();
  if (Status status = CheckInput(mesh, direction, width, height, colored); !status) {
    return tl::unexpected<Error>(status.error());
  }
  const Result<internal::EmbreeScene> scene =
      internal::EmbreeScene::Create(mesh.vertices, mesh.faces);
  if (!scene) return Forward(scene);
  const std::vector<Eigen::Vector3f> normals =
      mesh.normals.size() == mesh.vertices.size() ? mesh.normals : ComputeNormals(mesh);
  const Camera camera = FitCamera(mesh, direction, width, height);
  const Painter painter(mesh, normals, camera, colored);
  Image<Rgb8> picture(width, height);
  ParallelFor(height, 8, [&](int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < width; ++x) {
        Eigen::Vector3f sum = Eigen::Vector3f::Zero();
        for (int sub = 0; sub < kSubpixels * kSubpixels; ++sub) {
          const auto offset = [](int i) {
            return (static_cast<float>(i) + 0.5F) / static_cast<float>(kSubpixels) - 0.5F;
          };
          const float right = static_cast<float>(x) - 0.5F * static_cast<float>(width - 1) +
                              offset(sub % kSubpixels);
          const float down = static_cast<float>(y) - 0.5F * static_cast<float>(height - 1) +
                             offset(sub / kSubpixels);
          sum += painter.Trace(
              scene->scene(),
              camera.eye_center + camera.pixel_m * (right * camera.right - down * camera.up));
        }
        picture(x, y) = ToRgb(sum / static_cast<float>(kSubpixels * kSubpixels));
      }
    }
  });
  return picture;
}

std::vector<Rgb8> DeviationColors(const std::vector<float>& deviation_m, double limit_m) {
  if (!(limit_m > 0.0)) {
    throw std::invalid_argument(fmt::format("DeviationColors: limit {} m", limit_m));
  }
  std::vector<Rgb8> colors;
  colors.reserve(deviation_m.size());
  for (const float deviation : deviation_m) {
    const bool known = std::isfinite(deviation);
    colors.push_back(known ? DeviationColor(static_cast<float>(deviation / limit_m))
                           : Rgb8{128, 128, 128});
  }
  return colors;
}

namespace {

/// One end of a colour bar to the other: the colour at [0, 1] from the bottom, and the labels from
/// the top, evenly spaced.
Image<Rgb8> AddBar(const Image<Rgb8>& picture, const std::function<Rgb8(float)>& color_at,
                   const std::vector<std::string>& labels) {
  constexpr int kBarWidth = 24;
  constexpr int kExtraWidth = 140;
  const int height = picture.height();
  Image<Rgb8> result(picture.width() + kExtraWidth, height, Rgb8{255, 255, 255});
  for (int y = 0; y < height; ++y) {
    std::copy(picture.row(y), picture.row(y) + picture.width(), result.row(y));
  }
  const int top = height / 10;
  const int length = std::max(1, height - 2 * top);
  const int left = picture.width() + 12;
  for (int i = 0; i < length; ++i) {
    const Rgb8 color = color_at(1.0F - (static_cast<float>(i) + 0.5F) / static_cast<float>(length));
    for (int x = 0; x < kBarWidth && top + i < height; ++x) result(left + x, top + i) = color;
  }
  cv::Mat mat(height, result.width(), CV_8UC3, result.data());
  const int num_steps = static_cast<int>(labels.size()) - 1;
  for (int i = 0; i <= num_steps; ++i) {
    cv::putText(mat, labels[static_cast<std::size_t>(i)],
                cv::Point(left + kBarWidth + 6, top + length * i / num_steps + 5),
                cv::FONT_HERSHEY_SIMPLEX, 0.45, cv::Scalar(30, 30, 30), 1, cv::LINE_AA);
  }
  return result;
}

constexpr int kNumLabels = 5;

}  // namespace

Image<Rgb8> RenderScalar(const Image<float>& image, const std::string& unit) {
  Image<Rgb8> picture(image.width(), image.height());
  std::vector<float> values;
  for (const float value : image) {
    if (std::isfinite(value)) values.push_back(value);
  }
  if (values.empty()) return picture;
  const auto quantile = [&](double rank) {
    const auto at = static_cast<std::ptrdiff_t>(rank * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), values.begin() + at, values.end());
    return values[static_cast<std::size_t>(at)];
  };
  const float low = quantile(0.01);
  const float high = quantile(0.99);
  cv::Mat ramp(1, 256, CV_8UC1);
  for (int i = 0; i < 256; ++i) ramp.at<std::uint8_t>(0, i) = static_cast<std::uint8_t>(i);
  cv::Mat table;
  cv::applyColorMap(ramp, table, cv::COLORMAP_TURBO);
  const auto color_at = [&table](float ratio) {
    const auto bgr = table.at<cv::Vec3b>(0, ToByte(255.0F * ratio));
    return Rgb8{bgr[2], bgr[1], bgr[0]};
  };
  for (std::size_t i = 0; i < image.size(); ++i) {
    if (!std::isfinite(image[i])) continue;
    picture[i] = color_at(high > low ? (image[i] - low) / (high - low) : 0.5F);
  }
  if (unit.empty()) return picture;
  std::vector<std::string> labels;
  for (int label = 0; label < kNumLabels; ++label) {
    const double ratio = 1.0 - static_cast<double>(label) / (kNumLabels - 1);
    const double value = static_cast<double>(low) + ratio * static_cast<double>(high - low);
    labels.push_back(fmt::format("{:.4g} {}", value, unit));
  }
  return AddBar(picture, color_at, labels);
}

Image<Rgb8> WithColorBar(const Image<Rgb8>& picture, double limit_mm) {
  if (!(limit_mm > 0.0)) {
    throw std::invalid_argument(fmt::format("WithColorBar: limit {} mm", limit_mm));
  }
  std::vector<std::string> labels;
  for (int label = 0; label < kNumLabels; ++label) {
    const double value = limit_mm * (1.0 - 2.0 * label / (kNumLabels - 1));
    labels.push_back(value == 0.0 ? "0 mm" : fmt::format("{:+.3g} mm", value));
  }
  return AddBar(
      picture, [](float ratio) { return DeviationColor(2.0F * ratio - 1.0F); }, labels);
}

}  // namespace fringe_fusion
