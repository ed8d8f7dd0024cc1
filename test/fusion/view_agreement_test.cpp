#include "fringe_fusion/fusion/view_agreement.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "test/fusion/synthetic_views.hpp"

namespace fringe_fusion {
namespace {

constexpr double kSmallRadius = 0.01;
constexpr double kFineVoxel = 6e-4;
constexpr double kSigma = 5e-5;  // of one point [m]

std::vector<View> NoisySphereViews() {
  testing::ViewSettings settings;
  settings.sigma_range_m = kSigma;
  return testing::CastAround(testing::SphereScene(kSmallRadius), 0.12, settings);
}

ImplicitModel FuseFine(const std::vector<View>& views) {
  FusionConfig config;
  config.voxel_m = kFineVoxel;
  config.num_levels = 1;
  config.normal_radius_px = 0;
  Result<ImplicitModel> model = ImplicitModel::Create(config);
  EXPECT_TRUE(model && model->AddViews(views));
  return std::move(*model);
}

TEST(CompareViews, AllAreInTheirPlaces) {
  const std::vector<View> views = NoisySphereViews();
  const std::vector<ViewAgreement> agreements = CompareViews(FuseFine(views));
  ASSERT_EQ(agreements.size(), views.size());
  for (const ViewAgreement& agreement : agreements) {
    EXPECT_FALSE(agreement.displaced) << agreement.view_id;
    EXPECT_GT(agreement.num_points, 100);
    EXPECT_GT(agreement.ratio, 0.7) << agreement.view_id;
    EXPECT_LT(agreement.ratio, 1.4) << agreement.view_id;
    EXPECT_LT(agreement.shift_m.norm(), 3e-5);
  }
}

TEST(CompareViews, NamesTheDisplacedViewAndItsShift) {
  std::vector<View> views = NoisySphereViews();
  const Eigen::Vector3d displacement(6e-4, -7e-4, 4e-4);  // 1 mm
  views[4].pose.T_object_camera.translation() += displacement;
  const std::vector<ViewAgreement> agreements = CompareViews(FuseFine(views));
  for (const ViewAgreement& agreement : agreements) {
    EXPECT_EQ(agreement.displaced, agreement.view_id == 4) << agreement.view_id;
  }
  EXPECT_GT(agreements[4].ratio, 5.0);
  EXPECT_LT((agreements[4].shift_m + displacement).norm(), 1e-4);
  // Without it, the others agree as before.
  EXPECT_LT(agreements[5].ratio, 1.4);
}

TEST(CompareViews, OfTwoViewsNoneIsNamed) {
  std::vector<View> views = NoisySphereViews();
  views.resize(2);
  views[1].pose.T_object_camera.translation() += Eigen::Vector3d(0.0, 0.0, 1e-3);
  const std::vector<ViewAgreement> agreements = CompareViews(FuseFine(views));
  EXPECT_FALSE(agreements[0].displaced || agreements[1].displaced);
  views.resize(1);
  const std::vector<ViewAgreement> alone = CompareViews(FuseFine(views));
  ASSERT_EQ(alone.size(), 1U);
  EXPECT_EQ(alone[0].num_points, 0);
  EXPECT_TRUE(std::isnan(alone[0].ratio));
}

TEST(SupportingViews, AreThoseThatSeeThePoint) {
  const ImplicitModel model = FuseFine(NoisySphereViews());
  const Eigen::Vector3d point(0.0, 0.0, kSmallRadius);
  const std::vector<int> ids = model.SupportingViews(point);
  EXPECT_GE(static_cast<int>(ids.size()), model.Query(point).num_views);
  for (const View& view : NoisySphereViews()) {
    const bool sees = view.pose.T_object_camera.translation().z() > 2.0 * kSmallRadius;
    const bool named = std::find(ids.begin(), ids.end(), view.id) != ids.end();
    EXPECT_EQ(named, sees) << view.id;
  }
  EXPECT_TRUE(model.SupportingViews({0.0, 0.0, 0.05}).empty());
  EXPECT_TRUE(model.SupportingViews({std::nan(""), 0.0, 0.0}).empty());
}

struct FieldError {
  int count = 0;  // voxels that the field places within a voxel of the surface
  int far = 0;    // of them, those that lie three voxels and more from it
  double rms_m = 0.0;
};
FieldError FieldErrorOf(const ImplicitModel& model) {
  FieldError error;
  for (const ImplicitModel::BlockIndex& block : model.Blocks()) {
    for (int i = 0; i < 512; ++i) {
      const std::array<int, 3> voxel{block[0] * 8 + i % 8, block[1] * 8 + i / 8 % 8,
                                     block[2] * 8 + i / 64};
      const FieldSample at = model.AtVoxel(voxel);
      if (!at.supported || !(std::abs(at.distance) < kFineVoxel)) continue;
      const double truth =
          kFineVoxel * Eigen::Vector3d(voxel[0], voxel[1], voxel[2]).norm() - kSmallRadius;
      ++error.count;
      if (std::abs(truth) > 3.0 * kFineVoxel) {
        ++error.far;
      } else {
        error.rms_m += std::pow(at.distance - truth, 2);
      }
    }
  }
  error.rms_m = std::sqrt(error.rms_m / error.count);
  return error;
}

TEST(GrossOutliers, MakeNoSurfaceAndHardlyBendIt) {
  std::vector<View> views = NoisySphereViews();
  const FieldError clean = FieldErrorOf(FuseFine(views));
  std::mt19937 random(11);
  std::bernoulli_distribution is_outlier(0.05);
  std::uniform_real_distribution<float> factor(0.85F, 1.15F);  // of the range: up to 18 mm
  for (View& view : views) {
    for (Eigen::Vector3f& point : view.range.points) {
      if (is_outlier(random)) point *= factor(random);
    }
  }
  const FieldError error = FieldErrorOf(FuseFine(views));
  EXPECT_EQ(clean.far, 0);
  EXPECT_GT(error.count, clean.count * 95 / 100);
  EXPECT_LT(error.far, error.count / 500);
  // Outliers of less than a voxel stay: they may not cost more than the noise of a single point.
  EXPECT_LT(error.rms_m, kSigma) << "clean " << clean.rms_m;
}

TEST(FlippedNormals, AreRefusedByName) {
  std::vector<View> views = NoisySphereViews();
  for (Eigen::Vector3f& normal : views[2].range.normals) normal = -normal;
  Result<ImplicitModel> model = ImplicitModel::Create(FusionConfig{});
  ASSERT_TRUE(model);
  const Status status = model->AddViews(views);
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("view 2"), std::string::npos) << status.error().message;
}

TEST(DuplicateView, ChangesNothingButTheSigma) {
  std::vector<View> views = NoisySphereViews();
  const ImplicitModel once = FuseFine(views);
  View copy = views[3];
  copy.id = 99;
  views.push_back(copy);
  const ImplicitModel twice = FuseFine(views);
  const Eigen::Vector3d point =
      views[3].pose.T_object_camera.translation().normalized() * kSmallRadius;
  EXPECT_NEAR(twice.Query(point).distance, once.Query(point).distance, 2e-5F);
  EXPECT_LT(twice.Query(point).sigma, once.Query(point).sigma);
}

}  // namespace
}  // namespace fringe_fusion
