#include "fringe_fusion/pose/self_calibration.hpp"

#include <gtest/gtest.h>

#include "test/pose/epipolar_scene.hpp"

namespace fringe_fusion {
namespace {

using testing::EpipolarScene;
using testing::MakeMatches;
using testing::PitchedScene;
using testing::SameSigma;

const IntrinsicsPrior kFreeFocal{kFree, 0.0, 0.0};

DevicePair Nominal(const DevicePair& truth, double anchor_factor, double observed_factor) {
  DevicePair nominal = truth;
  nominal.anchor.fx *= anchor_factor;
  nominal.anchor.fy *= anchor_factor;
  nominal.observed.fx *= observed_factor;
  nominal.observed.fy *= observed_factor;
  // The same map of pixels: k1 scales with the square of the focal length, p1 with it.
  const auto keep = [](CameraModel& model, double f) {
    model.distortion = {model.distortion[0] * f * f, model.distortion[1] * f * f * f * f,
                        model.distortion[2] * f, model.distortion[3] * f, 0.0};
  };
  keep(nominal.anchor, anchor_factor);
  keep(nominal.observed, observed_factor);
  return nominal;
}

TEST(FocalLengthsOf, AreExactWithoutNoise) {
  const EpipolarScene scene = PitchedScene(5.0);
  const auto K = [](const CameraModel& m) {
    Eigen::Matrix3d out;
    out << m.fx, 0.0, m.cx, 0.0, m.fy, m.cy, 0.0, 0.0, 1.0;
    return out;
  };
  const Transform& T = scene.T_projector_camera;
  const Eigen::Matrix3d F = K(scene.devices.observed).inverse().transpose() * Hat(T.translation()) *
                            T.linear() * K(scene.devices.anchor).inverse();
  const auto focal = FocalLengthsOf(F, {1223.5, 1023.5}, {639.5, 399.5});
  ASSERT_TRUE(focal) << focal.error().message;
  EXPECT_NEAR((*focal)[0], 5600.0, 1e-3);
  EXPECT_NEAR((*focal)[1], 2400.0, 1e-3);
  EXPECT_FALSE(FocalLengthsOf(Eigen::Matrix3d::Zero(), {0.0, 0.0}, {0.0, 0.0}));
}

TEST(SelfCalibratePair, FindsBothFocalLengthsFromAWrongStart) {
  const EpipolarScene scene = PitchedScene(5.0);
  const auto matches = MakeMatches(scene, 50, 50, SameSigma(0.08), 3);
  const auto result =
      SelfCalibratePair(matches, Nominal(scene.devices, 1.15, 0.88), kFreeFocal, kFreeFocal, {});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_LT(result->sigma_focal_anchor_ratio, 0.005);
  EXPECT_LT(result->sigma_focal_observed_ratio, 0.005);
  EXPECT_NEAR(result->devices.anchor.fx / 5600.0, 1.0, 4.0 * result->sigma_focal_anchor_ratio);
  EXPECT_NEAR(result->devices.observed.fy / 2400.0, 1.0, 4.0 * result->sigma_focal_observed_ratio);
  EXPECT_LT(LogRotation(result->pose.T_observed_anchor.linear().transpose() *
                        scene.T_projector_camera.linear())
                .norm(),
            0.002);
  EXPECT_GT(result->axes_out_of_plane_deg, 3.0);
}

TEST(SelfCalibratePair, PriorHoldsOneDevice) {
  const EpipolarScene scene = PitchedScene(5.0);
  const auto matches = MakeMatches(scene, 40, 40, SameSigma(0.08), 3);
  const auto held =
      SelfCalibratePair(matches, Nominal(scene.devices, 1.0, 0.9), {}, kFreeFocal, {});
  ASSERT_TRUE(held) << held.error().message;
  EXPECT_EQ(held->sigma_focal_anchor_ratio, 0.0);
  EXPECT_DOUBLE_EQ(held->devices.anchor.fx, 5600.0);
  EXPECT_NEAR(held->devices.observed.fx / 2400.0, 1.0, 4.0 * held->sigma_focal_observed_ratio);
}

TEST(SelfCalibratePair, RefusesSingularLayoutsWithTheCure) {
  const auto refusal = [](const EpipolarScene& scene, const IntrinsicsPrior& anchor) {
    const auto matches = MakeMatches(scene, 40, 40, SameSigma(0.08), 3);
    const auto result = SelfCalibratePair(matches, scene.devices, anchor, kFreeFocal, {});
    return result ? fmt::format("accepted: sigma {} {}", result->sigma_focal_anchor_ratio,
                                result->sigma_focal_observed_ratio)
                  : result.error().message;
  };
  const std::string coplanar = refusal(PitchedScene(0.0), kFreeFocal);
  EXPECT_NE(coplanar.find("coplanar"), std::string::npos) << coplanar;
  EXPECT_NE(coplanar.find("pitch the projector"), std::string::npos) << coplanar;
  const std::string flat = refusal(PitchedScene(5.0, 0.0), kFreeFocal);
  EXPECT_NE(flat.find("flat"), std::string::npos) << flat;
  IntrinsicsPrior principal = kFreeFocal;
  principal.principal_px = kFree;
  const std::string unknown = refusal(PitchedScene(5.0), principal);
  EXPECT_NE(unknown.find("principal point"), std::string::npos) << unknown;
  EXPECT_NE(unknown.find("stations"), std::string::npos) << unknown;
  EXPECT_NE(refusal(PitchedScene(5.0), {-1.0, 0.0, 0.0}).find("negative"), std::string::npos);
}

TEST(AxesOutOfPlane, IsThePitch) {
  EXPECT_NEAR(AxesOutOfPlaneDeg(PitchedScene(0.0).T_projector_camera), 0.0, 1e-9);
  EXPECT_NEAR(AxesOutOfPlaneDeg(PitchedScene(5.0).T_projector_camera), 5.0, 0.3);
}

}  // namespace
}  // namespace fringe_fusion
