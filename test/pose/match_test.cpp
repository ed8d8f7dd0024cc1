#include "fringe_fusion/pose/match.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "test/pose/epipolar_scene.hpp"
#include "test/triangulation/analytic_view.hpp"

namespace fringe_fusion {
namespace {

PhaseMap MakePhase() {
  return test::MakeView(test::MakeScanner(),
                        test::PlaneDepth(Eigen::Vector3d(0.1, 0.05, 1.0).normalized(), 0.5),
                        {0.05, 0.1}, 1)
      .phase;
}

TEST(SampleMatches, TakesTheSurestPixelOfEveryCell) {
  PhaseMap phase = MakePhase();
  phase.sigma_u(10, 10) = 0.01F;
  const auto all = SampleMatches(phase, 1000000);
  ASSERT_TRUE(all);
  EXPECT_EQ(all->size(), 160U * 120U);
  const auto few = SampleMatches(phase, 1000);
  ASSERT_TRUE(few);
  EXPECT_LE(few->size(), 1000U);
  EXPECT_GT(few->size(), 600U);
  const bool has_best = std::any_of(few->begin(), few->end(), [](const Match& match) {
    return match.anchor_px == Eigen::Vector2d(10.0, 10.0);
  });
  EXPECT_TRUE(has_best);
  EXPECT_DOUBLE_EQ(few->front().covariance_px2(1, 1), std::pow(static_cast<double>(0.1F), 2));
}

TEST(SampleMatches, LeavesOutWhatIsNotValid) {
  PhaseMap phase = MakePhase();
  phase.u(0, 0) = std::numeric_limits<float>::quiet_NaN();
  phase.sigma_v(1, 0) = std::numeric_limits<float>::quiet_NaN();
  phase.sigma_u(2, 0) = 0.0F;
  phase.mask(3, 0) = static_cast<std::uint8_t>(MaskReason::kEdge);
  const auto matches = SampleMatches(phase, 1000000);
  ASSERT_TRUE(matches);
  EXPECT_EQ(matches->size(), 160U * 120U - 4U);
}

TEST(SampleMatches, RefusesOneAxisAndNothing) {
  PhaseMap phase = MakePhase();
  phase.v = Image<float>();
  const auto one_axis = SampleMatches(phase, 100);
  ASSERT_FALSE(one_axis);
  EXPECT_EQ(one_axis.error().message,
            "pose: the phase map codes only the u axis; the epipolar constraint needs both");
  phase = MakePhase();
  for (float& u : phase.u) u = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(SampleMatches(phase, 100));
  phase = MakePhase();
  phase.sigma_v = Image<float>(3, 3, 1.0F);
  EXPECT_FALSE(SampleMatches(phase, 100));
}

// A rolled device turns the map, but does not mirror it.
TEST(FindOrientation, RollIsNoFault) {
  for (const double roll : {-1.5, -0.7, 0.0, 0.8, 1.57, 3.0}) {
    testing::EpipolarScene scene = testing::MakeEpipolarScene();
    scene.devices.observed.width = scene.devices.observed.height = 4000;
    scene.devices.observed.cx = scene.devices.observed.cy = 2000.0;
    Transform turn = Transform::Identity();
    turn.linear() = ExpRotation(Eigen::Vector3d(0.0, 0.0, roll));
    scene.T_projector_camera = turn * scene.T_projector_camera;
    const auto orientation =
        FindOrientation(testing::MakeMatches(scene, 30, 30, testing::SameSigma(0.1), 1));
    EXPECT_GT(orientation.num_patches, 20);
    EXPECT_EQ(orientation.mirrored_ratio, 0.0) << roll;
    EXPECT_EQ(orientation.fault, MapFault::kNone);
  }
}

}  // namespace
}  // namespace fringe_fusion
