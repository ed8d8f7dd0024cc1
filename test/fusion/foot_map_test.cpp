#include "fringe_fusion/fusion/foot_map.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "fringe_fusion/fusion/implicit_model.hpp"
#include "test/fusion/synthetic_views.hpp"
#include "test/support/draws.hpp"

namespace fringe_fusion {
namespace {

constexpr double kFootRadius = 0.01;
constexpr double kReach = 1e-3;

struct Feet {
  std::vector<std::unique_ptr<FootMap>> owned;
  std::vector<const FootMap*> maps;
};

Feet MakeFeet(const std::vector<View>& views, FootRule rule) {
  Feet feet;
  for (const View& view : views) {
    Result<std::unique_ptr<FootMap>> map = MakeFootMap(view, rule, kReach);
    EXPECT_TRUE(map) << map.error().message;
    if (!map) continue;
    feet.maps.push_back(map->get());
    feet.owned.push_back(std::move(*map));
  }
  return feet;
}

// Evenly spread over the sphere by the golden angle.
std::vector<Eigen::Vector3d> Directions(int count) {
  std::vector<Eigen::Vector3d> directions;
  for (int i = 0; i < count; ++i) {
    const double z = -1.0 + 2.0 * (i + 0.5) / count;
    const double r = std::sqrt(1.0 - z * z);
    directions.emplace_back(r * std::cos(2.399963 * i), r * std::sin(2.399963 * i), z);
  }
  return directions;
}

constexpr std::array<FootRule, 4> kRules{FootRule::kLineOfSight, FootRule::kNearestPoint,
                                         FootRule::kNormalFoot, FootRule::kVariational};

TEST(DistanceByFeet, IsTheSameForEveryRule) {
  testing::ViewSettings settings;
  settings.stated_sigma_m = 1e-4;
  const std::vector<View> views =
      testing::CastAround(testing::SphereScene(kFootRadius), 0.12, settings);
  for (const FootRule rule : kRules) {
    if (test_support::Sanitized() && rule != kRules[0]) continue;
    const Feet feet = MakeFeet(views, rule);
    int count = 0;
    for (const Eigen::Vector3d& n : Directions(test_support::Draws(60, 3))) {
      for (const double d : {-1e-4, 0.0, 1e-4}) {
        const ConsensusDistance at = DistanceByFeet(feet.maps, (kFootRadius + d) * n);
        if (!at.field.supported) continue;
        ++count;
        // kappa d^2 tan^2 / 2 of the steepest view, and what a pixel spans of the sphere.
        EXPECT_NEAR(static_cast<double>(at.field.distance), d, 1.2e-5) << static_cast<int>(rule);
        EXPECT_GT(at.field.gradient.cast<double>().dot(n), 0.99);
        EXPECT_EQ(at.view_ids.size(), static_cast<std::size_t>(at.field.num_views));
      }
    }
    EXPECT_GT(count, test_support::Draws(170, 0)) << static_cast<int>(rule);
  }
}

TEST(DistanceByFeet, IsWhatTheAdditiveFormSums) {
  testing::ViewSettings settings;
  settings.stated_sigma_m = 1e-4;
  const std::vector<View> views =
      testing::CastAround(testing::SphereScene(kFootRadius), 0.12, settings);
  FusionConfig config;
  config.voxel_m = 5e-4;
  config.normal_radius_px = 0;
  Result<ImplicitModel> model = ImplicitModel::Create(config);
  ASSERT_TRUE(model && model->AddViews(views));
  const Feet feet = MakeFeet(views, FootRule::kNormalFoot);
  for (const Eigen::Vector3d& n : Directions(100)) {
    const Eigen::Vector3d point = (kFootRadius + 5e-5) * n;
    const ConsensusDistance at = DistanceByFeet(feet.maps, point);
    ASSERT_TRUE(at.field.supported);
    EXPECT_NEAR(at.field.distance, model->Query(point).distance, 1.2e-5F);
  }
}

TEST(DistanceByFeet, WeighsByNoiseAndOutvotesADisplacedView) {
  testing::ViewSettings settings;
  settings.stated_sigma_m = 1e-5;
  std::vector<View> views;
  for (int id = 0; id < 4; ++id) {
    views.push_back(
        testing::CastView(id, testing::SphereScene(kFootRadius), {0.01 * id, 0.0, 0.12}, settings));
  }
  const Eigen::Vector3d point(0.0, 0.0, kFootRadius);
  const Feet equal = MakeFeet(views, FootRule::kNormalFoot);
  const ConsensusDistance all = DistanceByFeet(equal.maps, point);
  EXPECT_EQ(all.view_ids, (std::vector<int>{0, 1, 2, 3}));
  EXPECT_NEAR(all.field.sigma, 0.5e-5F, 2e-7F);

  views[2].pose.T_object_camera.translation().z() += 5e-4;
  const Feet moved = MakeFeet(views, FootRule::kNormalFoot);
  const ConsensusDistance rest = DistanceByFeet(moved.maps, point);
  EXPECT_EQ(rest.view_ids, (std::vector<int>{0, 1, 3}));
  EXPECT_NEAR(rest.field.distance, 0.0F, 5e-6F);
  // A covariance that allows for the displacement takes part, and hardly counts.
  views[2].pose.covariance = PoseCovariance(0.0, 5e-4);
  const Feet known = MakeFeet(views, FootRule::kNormalFoot);
  const ConsensusDistance weighed = DistanceByFeet(known.maps, point);
  EXPECT_EQ(weighed.view_ids.size(), 4U);
  EXPECT_NEAR(weighed.field.distance, 0.0F, 5e-6F);
}

TEST(DistanceByFeet, KnowsNothingFarAway) {
  const std::vector<View> views{
      testing::CastView(0, testing::SphereScene(kFootRadius), {0.0, 0.0, 0.12}, {})};
  for (const FootRule rule : kRules) {
    const Feet feet = MakeFeet(views, rule);
    for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.0, 0.0, 0.05), Eigen::Vector3d(1, 0, 0),
                                         Eigen::Vector3d(std::nan(""), 0.0, 0.0)}) {
      const ConsensusDistance at = DistanceByFeet(feet.maps, point);
      EXPECT_FALSE(at.field.supported);
      EXPECT_TRUE(at.view_ids.empty());
    }
  }
  EXPECT_FALSE(DistanceByFeet({}, Eigen::Vector3d::Zero()).field.supported);
}

TEST(MakeFootMap, SaysWhatIsWrong) {
  View view = testing::CastView(3, testing::SphereScene(kFootRadius), {0.0, 0.0, 0.12}, {});
  EXPECT_FALSE(MakeFootMap(view, FootRule::kNormalFoot, 0.0));
  EXPECT_FALSE(MakeFootMap(view, FootRule::kNormalFoot, std::nan("")));
  view.range.sigma_range = Image<float>(view.range.width, view.range.height, std::nanf(""));
  const auto refused = MakeFootMap(view, FootRule::kNormalFoot, kReach);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("view 3"), std::string::npos) << refused.error().message;
}

}  // namespace
}  // namespace fringe_fusion
