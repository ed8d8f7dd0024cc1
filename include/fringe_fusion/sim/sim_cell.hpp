#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/config.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/pose/view.hpp"
#include "fringe_fusion/sim/target_plate.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::sim {

/// Physics of the simulated devices. Every effect is off at the neutral value named with it.
struct SimConfig {
  int seed = 1;
  // Projector: picture -> radiance.
  double projector_gamma = 1.0;        ///< radiance = black + (1 - black) (value/255)^gamma; 1: off
  double projector_black_ratio = 0.0;  ///< light of a black pixel, share of white; 0: off
  double projector_blur_px = 0.0;      ///< Gaussian sigma at all depths [projector px]; 0: off
  double projector_focus_m = 0.0;      ///< focused distance; 0: no defocus
  double projector_defocus_px_m = 0.0;  ///< extra blur sigma [px] = this |1/z - 1/focus|
  double projector_ripple_ratio = 0.0;  ///< peak variation of its light within a frame; 0: off
  double projector_frame_hz = 60.0;     ///< an exposure of whole frames does not see the ripple
  double panel_scale = 1.0;  ///< panel px per picture px from the upper left corner; 1: off
  // Surface.
  double albedo = 0.7;
  double texture_contrast = 0.0;  ///< solid checker texture of the albedo; 0: uniform
  double texture_period_m = 0.01;
  double specular_ratio = 0.0;  ///< Blinn-Phong lobe, share of the albedo; 0: off
  double specular_exponent = 30.0;
  double ambient_ratio = 0.0;          ///< ambient radiance, share of a white projector; 0: off
  double ambient_flicker_ratio = 0.0;  ///< peak variation of the ambient light; 0: off
  double ambient_flicker_hz = 100.0;
  bool interreflection = false;  ///< one diffuse bounce
  // Camera: radiance -> grey value. exposure 1 brings a frontal white Lambert surface of albedo 1
  // at the nominal distance to `white_level_ratio` of full scale. Nominal distance: from the
  // projector to where its middle pixel's ray passes the camera's axis.
  double white_level_ratio = 0.8;
  double camera_blur_px = 0.0;         ///< Gaussian sigma [px]; 0: off
  double gain_dn = 0.0;                ///< shot noise variance per grey value [DN]; 0: off
  double read_noise_dn = 0.0;          ///< [DN]; 0: off
  int bit_depth = 8;                   ///< 8 or 12
  double exposure_reference_s = 0.02;  ///< exposure time that counts as 1
  double frame_period_s = 0.04;        ///< time from frame to frame, unless the exposure is longer
  // Motion: what tf does not know.
  double turntable_angle_sigma_deg = 0.0;
  double turntable_shift_sigma_mm = 0.0;
  double arm_rotation_sigma_deg = 0.0;
  double arm_translation_sigma_mm = 0.0;
  double vibration_mm = 0.0;  ///< sigma per axis of the object's shift in each frame; 0: off
  // Faults of the stream, probability per frame.
  double drop_probability = 0.0;
  double duplicate_probability = 0.0;
  double late_probability = 0.0;

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("seed", seed, 0, 2147483647);
    field("projector_gamma", projector_gamma, 0.2, 5.0);
    field("projector_black_ratio", projector_black_ratio, 0.0, 1.0);
    field("projector_blur_px", projector_blur_px, 0.0, 100.0);
    field("projector_focus_m", projector_focus_m, 0.0, 100.0);
    field("projector_defocus_px_m", projector_defocus_px_m, 0.0, 1000.0);
    field("projector_ripple_ratio", projector_ripple_ratio, 0.0, 1.0);
    field("projector_frame_hz", projector_frame_hz, 1e-3, 1e6);
    field("panel_scale", panel_scale, 0.1, 10.0);
    field("albedo", albedo, 0.0, 1.0);
    field("texture_contrast", texture_contrast, 0.0, 1.0);
    field("texture_period_m", texture_period_m, 1e-5, 10.0);
    field("specular_ratio", specular_ratio, 0.0, 100.0);
    field("specular_exponent", specular_exponent, 1.0, 10000.0);
    field("ambient_ratio", ambient_ratio, 0.0, 10.0);
    field("ambient_flicker_ratio", ambient_flicker_ratio, 0.0, 1.0);
    field("ambient_flicker_hz", ambient_flicker_hz, 1e-3, 1e6);
    field("interreflection", interreflection);
    field("white_level_ratio", white_level_ratio, 0.0, 100.0);
    field("camera_blur_px", camera_blur_px, 0.0, 100.0);
    field("gain_dn", gain_dn, 0.0, 1000.0);
    field("read_noise_dn", read_noise_dn, 0.0, 10000.0);
    field("bit_depth", bit_depth, 8, 12);
    field("exposure_reference_s", exposure_reference_s, 1e-6, 100.0);
    field("frame_period_s", frame_period_s, 1e-6, 100.0);
    field("turntable_angle_sigma_deg", turntable_angle_sigma_deg, 0.0, 180.0);
    field("turntable_shift_sigma_mm", turntable_shift_sigma_mm, 0.0, 1000.0);
    field("arm_rotation_sigma_deg", arm_rotation_sigma_deg, 0.0, 180.0);
    field("arm_translation_sigma_mm", arm_translation_sigma_mm, 0.0, 1000.0);
    field("vibration_mm", vibration_mm, 0.0, 1000.0);
    field("drop_probability", drop_probability, 0.0, 1.0);
    field("duplicate_probability", duplicate_probability, 0.0, 1.0);
    field("late_probability", late_probability, 0.0, 1.0);
  }
};

/// Exact answers for one pose, per camera pixel; NaN / 0 where the ray hits nothing.
struct ViewTruth {
  Transform T_object_camera = Transform::Identity();  ///< with the pose error
  Image<float> u;  ///< projector coordinates of the hit, also in shadow [px]
  Image<float> v;
  Image<Eigen::Vector3f> points;           ///< camera frame [m]
  Image<Eigen::Vector3f> normals;          ///< camera frame, towards the camera
  Image<std::uint8_t> lit;                 ///< 1: the projector sees the point and covers it
  Image<std::uint8_t> on_part;             ///< 1: the part, 0: background (turntable plate)
  std::vector<std::uint8_t> face_visible;  ///< per face of the part: seen by camera and projector
};

/// The simulated scanner before one object. Rays are cast once per pose, every picture reuses them.
/// Deterministic: seed, pose index and frame index fix every random number on any thread count.
class SimCell {
 public:
  /// @param calibration true geometry of both devices.
  /// @param object the part, in `object` [m]. @param background e.g. the turntable plate, or empty.
  /// @param print on the part, e.g. of a calibration target on its plate.
  [[nodiscard]] static Result<SimCell> Create(
      const SimConfig& config, const CellCalibration& calibration, const Mesh& object,
      const Mesh& background, const std::optional<SurfacePrint>& print = std::nullopt);
  SimCell(SimCell&&) noexcept;
  SimCell& operator=(SimCell&&) noexcept;
  ~SimCell();

  /// Moves to a commanded pose (what tf says) and adds the seeded pose error of this pose index:
  /// the turntable's about and across the z axis of `object`, the arm's in the camera frame.
  /// @param pose_index at least 0.
  [[nodiscard]] Status MoveTo(const Transform& T_object_camera_commanded, int pose_index);

  /// Takes one picture of the scene lit by an 8-bit picture of the projector's size.
  /// A duplicated frame repeats the pixels of the frame exposed before it; a late one is stamped
  /// 1.5 frame periods after its time.
  /// @param frame_index selects noise, vibration and faults of this frame.
  /// @return error when the frame was dropped, no pose was set, or size or exposure is wrong.
  [[nodiscard]] Result<CapturedFrame> Expose(const Image<std::uint8_t>& projected,
                                             double exposure_s, int frame_index);

  /// Exact answers for the present pose.
  [[nodiscard]] ViewTruth Truth() const;
  [[nodiscard]] const CellCalibration& calibration() const;
  [[nodiscard]] const SimConfig& config() const;

 private:
  struct Impl;
  explicit SimCell(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Captures a whole sequence at the present pose.
[[nodiscard]] Result<ImageStack> CaptureStack(SimCell& cell, const PatternSequence& sequence,
                                              double gamma_correction, double exposure_s,
                                              int view_id);

/// Captures a sequence whose pictures come at the wrong time: frame i shows pattern shown[i].
/// A shown pattern of -1 is black. Noise, vibration and light are those of frame i.
/// @param shown one entry per frame.
[[nodiscard]] Result<ImageStack> CaptureMisordered(SimCell& cell, const PatternSequence& sequence,
                                                   const std::vector<int>& shown, double exposure_s,
                                                   int view_id);

/// Covariance of the pose errors of `config` as that of the right perturbation of a pose: what an
/// honest prior of the commanded pose states.
[[nodiscard]] Matrix6d PoseErrorCovariance(const SimConfig& config,
                                           const Transform& T_object_camera);

/// Default scanner: 800x600 camera, 1280x800 projector, 0.5 m away, 0.2 m baseline.
[[nodiscard]] CellCalibration DefaultCalibration();

/// Commanded pose of stop k of n on a turntable: the object turns about its z axis by 2 pi k / n
/// before a camera at `distance_m` that looks at `target_object` from `elevation_deg` above.
[[nodiscard]] Transform TurntablePose(int k, int n, double distance_m, double elevation_deg,
                                      const Eigen::Vector3d& target_object);

}  // namespace fringe_fusion::sim
