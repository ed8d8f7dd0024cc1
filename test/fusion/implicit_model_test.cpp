#include "fringe_fusion/fusion/implicit_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "fringe_fusion/common/parallel.hpp"
#include "test/fusion/synthetic_views.hpp"
#include "test/support/draws.hpp"

namespace fringe_fusion {
namespace {

using testing::CastAround;
using testing::CastView;
using testing::Dump;
using testing::SphereScene;
using testing::ViewSettings;

constexpr double kSphereRadius = 0.01;

FusionConfig Config(double voxel_m) {
  FusionConfig config;
  config.voxel_m = voxel_m;
  return config;
}

ImplicitModel Fuse(const std::vector<View>& views, const FusionConfig& config) {
  Result<ImplicitModel> model = ImplicitModel::Create(config);
  EXPECT_TRUE(model.has_value());
  const Status status = model->AddViews(views);
  EXPECT_TRUE(status.has_value()) << (status ? "" : status.error().message);
  return std::move(*model);
}

// Top at z = 10 mm.
testing::Scene FlatScene() { return testing::BoxScene({0.015, 0.015, 0.01}); }

std::vector<View> FlatViews(const ViewSettings& settings) {
  std::vector<View> views;
  for (const auto& [x, y] : {std::pair(0.0, 0.0), {0.08, 0.0}, {-0.05, 0.06}, {0.02, -0.09}}) {
    views.push_back(CastView(static_cast<int>(views.size()), FlatScene(), {x, y, 0.16}, settings));
  }
  return views;
}

std::vector<View> SphereViews(double sigma_range_m = 0.0) {
  ViewSettings settings;
  settings.sigma_range_m = sigma_range_m;
  return CastAround(SphereScene(kSphereRadius), 0.12, settings);
}

TEST(ImplicitModel, PlaneLiesAtTheTruthWithoutNoise) {
  const ImplicitModel model = Fuse(FlatViews({}), Config(5e-4));
  for (double x = -0.009; x <= 0.009; x += 0.0013) {
    for (const double off : {-4e-4, 0.0, 6e-4}) {
      const FieldSample at = model.Query({x, 0.3 * x, 0.01 + off});
      ASSERT_TRUE(at.supported) << x;
      EXPECT_NEAR(at.distance, off, 1e-7);
      EXPECT_NEAR(at.gradient.z(), 1.0F, 1e-3F);
      EXPECT_EQ(at.num_views, 4);
      EXPECT_NEAR(at.color.r, 200, 1);
    }
  }
}

// A view that is off by its sigma and ends half way: the surface must not step where it ends.
TEST(ImplicitModel, NoStepWhereAViewEnds) {
  const ViewSettings settings;
  std::vector<View> views{CastView(0, FlatScene(), {0.0, 0.0, 0.16}, settings),
                          CastView(1, FlatScene(), {0.0, 0.0, 0.16}, settings)};
  const double sigma = settings.stated_sigma_m;
  for (Eigen::Vector3f& point : views[1].range.points) {
    if ((views[1].pose.T_object_camera * point.cast<double>()).x() > 0.0) {
      point.setConstant(std::nanf(""));
    }
  }
  views[1].pose.T_object_camera.translation().z() += sigma;
  const ImplicitModel model = Fuse(views, Config(5e-4));
  double step = 0.0;
  for (int x = -18; x < 18; ++x) {
    const FieldSample a = model.AtVoxel({x, 0, 20});
    const FieldSample b = model.AtVoxel({x + 1, 0, 20});
    ASSERT_TRUE(a.supported && b.supported) << x;
    step = std::max(step, std::abs(static_cast<double>(b.distance - a.distance)));
  }
  EXPECT_NEAR(model.AtVoxel({-18, 0, 20}).distance, -0.5 * sigma, 0.05 * sigma);
  EXPECT_NEAR(model.AtVoxel({18, 0, 20}).distance, 0.0, 0.05 * sigma);
  EXPECT_LT(step, 0.2 * sigma);
  RecordProperty("seam_step_over_sigma", std::to_string(step / sigma));
}

// Root mean square of error over stated sigma on the flat top of the box.
double ErrorOverSigma(const FusionConfig& config) {
  ViewSettings settings;
  settings.sigma_range_m = 1e-4;
  double sum = 0.0;
  int count = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    settings.seed = seed * 1000;
    std::vector<View> views = FlatViews(settings);
    if (config.normal_radius_px > 0) {
      for (View& view : views) view.range = EstimateNormals(view.range, TriangulationConfig{});
    }
    const ImplicitModel model = Fuse(views, config);
    for (int x = -18; x <= 18; x += 2) {
      for (int y = -18; y <= 18; y += 2) {
        const FieldSample at = model.AtVoxel({x, y, 20});  // z = 10 mm
        EXPECT_TRUE(at.supported);
        sum += std::pow(at.distance / at.sigma, 2);
        ++count;
      }
    }
  }
  return std::sqrt(sum / count);
}

// CastView gives the true normals, EstimateNormals noisy ones.
TEST(ImplicitModel, StatedSigmaIsTheErrorOnFlatParts) {
  struct Case {
    int order, normal_radius_px, num_levels;
  };
  for (const Case& c :
       test_support::Cases<Case>({{2, 2, 1}, {0, 0, 1}, {0, 2, 1}, {2, 0, 1}, {2, 2, 3}})) {
    FusionConfig config = Config(5e-4);
    config.order = c.order;
    config.normal_radius_px = c.normal_radius_px;
    config.num_levels = c.num_levels;
    const double ratio = ErrorOverSigma(config);
    const auto name =
        fmt::format("order{}_normals{}_levels{}", c.order, c.normal_radius_px, c.num_levels);
    // The widest kernel leaves some 30 independent places, whose rms scatters by an eighth.
    const double window = c.num_levels == 1 ? 0.1 : 0.2;
    EXPECT_NEAR(ratio, 1.0, window) << name;
    RecordProperty(name, std::to_string(ratio));
  }
}

// Inverse variance, not equal weights: a view ten times as noisy must hardly count.
TEST(ImplicitModel, NoisyViewHardlyCounts) {
  ViewSettings good;
  good.stated_sigma_m = 2e-5;
  ViewSettings bad;
  bad.stated_sigma_m = 2e-4;
  std::vector<View> views{CastView(0, FlatScene(), {0.0, 0.0, 0.16}, good)};
  views.push_back(CastView(1, FlatScene(), {0.0, 0.0, 0.16}, bad));
  // The bad view is 0.05 mm off: the mean weighs it 1 : 100.
  views[1].pose.T_object_camera.translation().z() += 5e-5;
  const ImplicitModel model = Fuse(views, Config(5e-4));
  const FieldSample at = model.Query({0.001, 0.002, 0.01});
  ASSERT_TRUE(at.supported);
  EXPECT_NEAR(at.distance, -5e-5 / 101.0, 2e-8);
}

TEST(ImplicitModel, PoseCovarianceIsSharedByTheWholeView) {
  View view = CastView(0, FlatScene(), {0.0, 0.0, 0.16}, {});
  view.pose.covariance = PoseCovariance(0.0, 1e-4);
  const ImplicitModel one = Fuse({view}, Config(5e-4));
  // No averaging within the view can reduce what all its points have in common.
  EXPECT_NEAR(one.Query({0.001, 0.002, 0.01}).sigma, 1e-4, 2e-6);
  View second = view;
  second.id = 1;
  const ImplicitModel two = Fuse({view, second}, Config(5e-4));
  EXPECT_NEAR(two.Query({0.001, 0.002, 0.01}).sigma, 1e-4 / std::sqrt(2.0), 2e-6);
}

TEST(ImplicitModel, SphereBiasIsThatOfTheKernel) {
  FusionConfig config = Config(4e-4);
  config.order = 0;
  const ImplicitModel order0 = Fuse(SphereViews(), config);
  config.order = 2;
  const ImplicitModel order2 = Fuse(SphereViews(), config);
  double bias0 = 0.0;
  double bias2 = 0.0;
  int count = 0;
  // At the voxels themselves: between them the trilinear mean has a bias of its own.
  const int reach = static_cast<int>(kSphereRadius / config.voxel_m) + 1;
  for (int i = 0; i < (2 * reach + 1) * (2 * reach + 1) * (2 * reach + 1); ++i) {
    const int side = 2 * reach + 1;
    const std::array<int, 3> voxel{i % side - reach, i / side % side - reach,
                                   i / side / side - reach};
    const Eigen::Vector3d point = config.voxel_m * Eigen::Vector3d(voxel[0], voxel[1], voxel[2]);
    const double truth = point.norm() - kSphereRadius;
    if (std::abs(truth) > config.voxel_m) continue;
    const FieldSample at0 = order0.AtVoxel(voxel);
    const FieldSample at2 = order2.AtVoxel(voxel);
    ASSERT_TRUE(at0.supported && at2.supported);
    bias0 += at0.distance - truth;
    bias2 += at2.distance - truth;
    EXPECT_NEAR(at2.distance, truth, 2e-6);
    ++count;
  }
  // Order 0 lies outside by <r^2> / (2 R), at most h^2 / R with h = 3 voxels / 2.5.
  const double h = 3.0 * config.voxel_m / 2.5;
  EXPECT_LT(bias0 / count, 0.0);
  EXPECT_GT(bias0 / count, -h * h / kSphereRadius);
  EXPECT_LT(std::abs(bias2 / count), 0.1 * std::abs(bias0 / count));
}

TEST(ImplicitModel, SameBytesInAnyOrderOfViews) {
  std::vector<View> views = SphereViews(1e-4);
  const std::vector<std::uint32_t> expected = Dump(Fuse(views, Config(1e-3)));
  std::reverse(views.begin(), views.end());
  std::swap(views[2], views[5]);
  Result<ImplicitModel> one_by_one = ImplicitModel::Create(Config(1e-3));
  ASSERT_TRUE(one_by_one);
  for (const View& view : views) ASSERT_TRUE(one_by_one->AddView(view));
  EXPECT_EQ(Dump(*one_by_one), expected);
}

TEST(ImplicitModel, RemovedViewWasNeverThere) {
  std::vector<View> views = SphereViews(1e-4);
  ImplicitModel model = Fuse(views, Config(1e-3));
  const std::size_t memory_before = model.MemoryBytes();
  ASSERT_TRUE(model.RemoveView(3));
  ASSERT_TRUE(model.RemoveView(7));
  EXPECT_LT(model.MemoryBytes(), memory_before);
  views.erase(views.begin() + 7);
  views.erase(views.begin() + 3);
  const ImplicitModel expected = Fuse(views, Config(1e-3));
  EXPECT_EQ(model.Blocks(), expected.Blocks());
  EXPECT_EQ(Dump(model), Dump(expected));
  EXPECT_EQ(model.ViewIds(), expected.ViewIds());
}

TEST(ImplicitModel, SameBytesOnAnyNumberOfThreads) {
  const std::vector<View> views = SphereViews(1e-4);
  std::vector<std::vector<std::uint32_t>> dumps;
  for (const int threads : {1, 2, 3}) {
    const ThreadLimit limit(threads);
    dumps.push_back(Dump(Fuse(views, Config(1e-3))));
  }
  EXPECT_EQ(dumps[0], dumps[1]);
  EXPECT_EQ(dumps[0], dumps[2]);
}

TEST(ImplicitModel, ThinSlabKeepsItsTwoSides) {
  constexpr double kHalf = 0.00075;
  const testing::Scene slab = testing::BoxScene({0.009, 0.009, kHalf});
  std::vector<View> views;
  for (const double side : {1.0, -1.0}) {
    for (const double x : {0.0, 0.06, -0.06}) {
      views.push_back(
          CastView(static_cast<int>(views.size()), slab, {x, 0.01, 0.09 * side}, ViewSettings{}));
    }
  }
  for (const double voxel_m : {5e-4, 7.5e-4, 1e-3}) {
    const ImplicitModel model = Fuse(views, Config(voxel_m));
    const int reach = static_cast<int>(0.004 / voxel_m);
    for (int x = -reach; x <= reach; ++x) {
      for (int z = -3; z <= 3; ++z) {
        const FieldSample at = model.AtVoxel({x, 1, z});
        if (std::abs(z) * voxel_m - kHalf > 2.0 * voxel_m) continue;
        ASSERT_TRUE(at.supported) << x << " " << z << " voxel " << voxel_m;
        EXPECT_NEAR(at.distance, std::abs(z) * voxel_m - kHalf, 2e-5) << x << " " << z;
      }
    }
  }
}

TEST(ImplicitModel, NothingIsKnownAwayFromThePoints) {
  const ImplicitModel model = Fuse(FlatViews({}), Config(5e-4));
  EXPECT_FALSE(model.Query({0.0, 0.0, 0.05}).supported);
  EXPECT_FALSE(model.Query({0.025, 0.0, 0.01}).supported);
  EXPECT_TRUE(std::isnan(model.Query({0.0, 0.0, 0.05}).distance));
  EXPECT_FALSE(model.Query({std::nan(""), 0.0, 0.0}).supported);
  EXPECT_FALSE(model.Query({1e9, 0.0, 0.0}).supported);
  EXPECT_FALSE(model.AtVoxel({2000000000, 0, 0}).supported);
  // Beyond the rim of what was measured at most one voxel is extrapolated.
  EXPECT_FALSE(model.Query({0.0, 0.0165, 0.01}).supported);
}

std::string ErrorOf(const Status& status) { return status ? "" : status.error().message; }

TEST(ImplicitModel, RefusesWhatCannotBeFused) {
  Result<ImplicitModel> model = ImplicitModel::Create(Config(1e-3));
  ASSERT_TRUE(model);
  const View good = CastView(0, SphereScene(kSphereRadius), {0.0, 0.0, 0.12}, {});
  ASSERT_TRUE(model->AddView(good));
  const std::vector<std::uint32_t> before = Dump(*model);

  EXPECT_NE(ErrorOf(model->AddView(good)).find("already"), std::string::npos);
  View view = good;
  view.id = 1;
  view.pose.source = PoseSource::kNone;
  EXPECT_NE(ErrorOf(model->AddView(view)).find("no pose"), std::string::npos);
  view = good;
  view.id = 1;
  view.pose.T_object_camera.translation().x() = std::nan("");
  EXPECT_FALSE(model->AddView(view));
  view = good;
  view.id = 1;
  view.range = MakeRangeImage(20, 20);
  EXPECT_NE(ErrorOf(model->AddView(view)).find("no valid point"), std::string::npos);
  view = good;
  view.id = 1;
  view.range.sigma_range = Image<float>(160, 120, std::nanf(""));
  EXPECT_NE(ErrorOf(model->AddView(view)).find("none of its"), std::string::npos);
  view = good;
  view.id = 1;
  view.range.normals = Image<Eigen::Vector3f>();
  EXPECT_FALSE(model->AddView(view));
  view = good;
  view.id = 1;
  view.pose.T_object_camera.translation().x() = 1e4;
  EXPECT_NE(ErrorOf(model->AddView(view)).find("voxel_m >="), std::string::npos);
  EXPECT_FALSE(model->RemoveView(5));
  EXPECT_EQ(Dump(*model), before);
  EXPECT_EQ(model->ViewIds(), std::vector<int>{0});
}

TEST(ImplicitModel, RefusesAbsurdSettings) {
  EXPECT_FALSE(ImplicitModel::Create(Config(0.0)));
  EXPECT_FALSE(ImplicitModel::Create(Config(std::nan(""))));
  FusionConfig config = Config(1e-3);
  config.order = 1;
  EXPECT_FALSE(ImplicitModel::Create(config));

  const View view = CastView(0, SphereScene(kSphereRadius), {0.0, 0.0, 0.12}, {});
  Result<ImplicitModel> fine = ImplicitModel::Create(Config(2e-6));
  ASSERT_TRUE(fine);
  EXPECT_NE(ErrorOf(fine->AddView(view)).find("use voxel_m >="), std::string::npos);

  config = Config(1e-4);
  config.max_memory_gb = 0.01;
  Result<ImplicitModel> small = ImplicitModel::Create(config);
  ASSERT_TRUE(small);
  const std::string message = ErrorOf(small->AddView(view));
  EXPECT_NE(message.find("max_memory_gb = 0.01"), std::string::npos) << message;
  EXPECT_NE(message.find("use voxel_m >="), std::string::npos) << message;
  EXPECT_EQ(small->NumBlocks(), 0U);
}

TEST(ImplicitModel, CancelLeavesTheModelAsItWas) {
  std::vector<View> views = SphereViews();
  Result<ImplicitModel> model = ImplicitModel::Create(Config(1e-3));
  ASSERT_TRUE(model);
  ASSERT_TRUE(model->AddView(views[0]));
  const std::vector<std::uint32_t> before = Dump(*model);
  const Progress cancel = [](const std::string& stage, double fraction) {
    return !(stage == "integrate" && fraction > 0.0);
  };
  EXPECT_EQ(ErrorOf(model->AddView(views[1], cancel)), kCancelled);
  EXPECT_EQ(Dump(*model), before);
  ASSERT_TRUE(model->AddView(views[1]));
}

}  // namespace
}  // namespace fringe_fusion
