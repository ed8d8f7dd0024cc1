#include "fringe_fusion/inspection/compare.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/io/config_yaml.hpp"
#include "test/inspection/shapes.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

InspectionConfig Config(double max_m, double complete_m, double spacing_m) {
  InspectionConfig config;
  config.max_distance_m = max_m;
  config.complete_distance_m = complete_m;
  config.sample_spacing_m = spacing_m;
  return config;
}

TEST(InspectionConfig, FileHasTheDefaultsOfTheStruct) {
  const auto file =
      LoadConfigFile<InspectionConfig>(std::string(SOURCE_DIR) + "/config/inspection.yaml");
  ASSERT_TRUE(file) << file.error().message;
  const InspectionConfig defaults;
  EXPECT_EQ(file->max_distance_m, defaults.max_distance_m);
  EXPECT_EQ(file->complete_distance_m, defaults.complete_distance_m);
  EXPECT_EQ(file->sample_spacing_m, defaults.sample_spacing_m);
  EXPECT_EQ(file->ignore_filled, defaults.ignore_filled);
}

TEST(Compare, AShiftedPlateIsOffByItsShiftWithSign) {
  const Mesh reference = Plate(0.1F, 1, 0.0F);
  for (const float shift : {0.0003F, -0.0003F}) {
    const Mesh model = Plate(0.1F, 20, shift);
    const auto result = Compare(model, reference, Config(0.005, 0.0005, 0.001));
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_EQ(result->model_to_reference.count, 10000U);
    EXPECT_EQ(result->model_to_reference.num_far, 0U);
    EXPECT_NEAR(result->model_to_reference.mean_m, shift, 1e-9);
    EXPECT_NEAR(result->model_to_reference.rms_m, 0.0003, 1e-9);
    EXPECT_NEAR(result->model_to_reference.median_abs_m, 0.0003, 1e-9);
    EXPECT_NEAR(result->model_to_reference.p95_abs_m, 0.0003, 1e-9);
    EXPECT_NEAR(result->model_to_reference.max_abs_m, 0.0003, 1e-9);
    EXPECT_NEAR(result->reference_to_model.mean_m, -shift, 1e-9);
    EXPECT_EQ(result->completeness_ratio, 1.0);
    ASSERT_EQ(result->deviation_m.size(), model.vertices.size());
    EXPECT_NEAR(result->deviation_m[7], shift, 1e-9);
  }
}

TEST(Compare, ALargerSphereIsOutside) {
  const Mesh reference = Sphere(0.05F, 6);
  const Mesh model = Sphere(0.0502F, 6);
  const auto result = Compare(model, reference, Config(0.005, 0.0005, 0.001));
  ASSERT_TRUE(result) << result.error().message;
  // Facets of an edge angle of at most 1.5 (pi/2) / 2^6 sag by r (angle / sqrt 3)^2 / 2 = 11 um at
  // most, those of model and reference alike.
  EXPECT_NEAR(result->model_to_reference.mean_m, 0.0002, 6e-6);
  EXPECT_NEAR(result->reference_to_model.mean_m, -0.0002, 6e-6);
  for (const float deviation : result->deviation_m) EXPECT_NEAR(deviation, 0.0002F, 1.1e-5F);
}

TEST(Compare, CompletenessIsTheCoveredShareOfTheArea) {
  const Mesh reference = Plate(0.1F, 10, 0.0F);
  // Covers 60 % of the plate plus the strip that is within reach of its border.
  Mesh model = Plate(0.1F, 10, 0.0F);
  for (Eigen::Vector3f& vertex : model.vertices) vertex.x() *= 0.6F;
  const auto result = Compare(model, reference, Config(0.01, 0.001, 0.0005));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_NEAR(result->completeness_ratio, 0.61, 0.002);
  EXPECT_EQ(result->reference_to_model.count + result->reference_to_model.num_far, 40000U);
  EXPECT_NEAR(static_cast<double>(result->reference_to_model.count) / 40000.0, 0.70, 0.002);

  // Only the left half is visible, and there nothing is missing.
  std::vector<std::uint8_t> visible;
  for (const Eigen::Vector3i& face : reference.faces) {
    float x = 0.0F;
    for (const int vertex : face) x += reference.vertices[static_cast<std::size_t>(vertex)].x();
    visible.push_back(x / 3.0F < 0.05F ? 1 : 0);
  }
  const auto half = Compare(model, reference, Config(0.01, 0.001, 0.0005), visible);
  ASSERT_TRUE(half) << half.error().message;
  EXPECT_EQ(half->completeness_ratio, 1.0);
  EXPECT_EQ(half->reference_to_model.count, 20000U);
}

TEST(Compare, LeavesOutFacesThatCloseHoles) {
  const Mesh reference = Plate(0.1F, 1, 0.0F);
  Mesh model = Plate(0.1F, 10, 0.0F);
  // A stray part far above is only a filling.
  const Mesh stray = Plate(0.1F, 1, 0.003F);
  const int offset = static_cast<int>(model.vertices.size());
  model.filled_faces.assign(model.faces.size(), 0);
  model.vertices.insert(model.vertices.end(), stray.vertices.begin(), stray.vertices.end());
  for (const Eigen::Vector3i& face : stray.faces) {
    model.faces.push_back(face.array() + offset);
    model.filled_faces.push_back(1);
  }
  InspectionConfig config = Config(0.005, 0.0005, 0.001);
  const auto ignored = Compare(model, reference, config);
  ASSERT_TRUE(ignored) << ignored.error().message;
  EXPECT_NEAR(ignored->model_to_reference.max_abs_m, 0.0, 1e-9);
  EXPECT_TRUE(std::isnan(ignored->deviation_m.back()));
  config.ignore_filled = false;
  const auto counted = Compare(model, reference, config);
  ASSERT_TRUE(counted) << counted.error().message;
  EXPECT_NEAR(counted->model_to_reference.rms_m, 0.003 / std::sqrt(2.0), 1e-6);
  EXPECT_NEAR(counted->deviation_m.back(), 0.003F, 1e-8F);
  model.filled_faces.assign(model.faces.size(), 1);
  config.ignore_filled = true;
  EXPECT_EQ(Compare(model, reference, config).error().message,
            "inspection: all 202 faces of the model close holes");
}

TEST(Compare, CloudsAreMeasuredPointByPoint) {
  const Mesh reference = Plate(0.1F, 1, 0.0F);
  Mesh cloud = Plate(0.1F, 50, 0.0002F);
  cloud.faces.clear();
  cloud.vertices.emplace_back(0.05F, 0.05F, 1.0F);  // stray
  const auto result = Compare(cloud, reference, Config(0.005, 0.002, 0.001));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->model_to_reference.count, 51U * 51U);
  EXPECT_EQ(result->model_to_reference.num_far, 1U);
  EXPECT_TRUE(std::isnan(result->deviation_m.back()));
  EXPECT_NEAR(result->model_to_reference.mean_m, 0.0002, 1e-9);
  EXPECT_EQ(result->completeness_ratio, 1.0);
  // Points 2 mm apart: a sample is 0 to 1.41 mm beside the nearest and always positive.
  EXPECT_GT(result->reference_to_model.mean_m, 0.0006);
  EXPECT_LT(result->reference_to_model.max_abs_m, std::hypot(0.0002, 0.0015));
}

TEST(Compare, GivesTheSameBytesOnAnyNumberOfThreads) {
  const Mesh reference = Sphere(0.05F, 4);
  const Mesh model = Sphere(0.0501F, 5);
  std::vector<InspectionResult> results;
  for (const int threads : {1, 2, 3}) {
    const ThreadLimit limit(threads);
    auto result = Compare(model, reference, Config(0.005, 0.0005, 0.0005));
    ASSERT_TRUE(result);
    results.push_back(*result);
  }
  for (const InspectionResult& result : results) {
    EXPECT_EQ(std::memcmp(&result.model_to_reference, &results[0].model_to_reference,
                          sizeof(DistanceStatistics)),
              0);
    EXPECT_EQ(std::memcmp(&result.reference_to_model, &results[0].reference_to_model,
                          sizeof(DistanceStatistics)),
              0);
    EXPECT_EQ(result.deviation_m, results[0].deviation_m);
  }
}

TEST(Compare, CanBeCancelled) {
  int calls = 0;
  const auto result =
      Compare(Sphere(0.05F, 3), Sphere(0.05F, 3), Config(0.005, 0.0005, 0.001), std::nullopt,
              [&](const std::string&, double) { return ++calls < 5; });
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().message, kCancelled);
  EXPECT_EQ(calls, 5);
}

TEST(Compare, RefusesMeshesOutOfReachOfEachOther) {
  const Mesh metres = Plate(0.1F, 2, 0.0F);
  Mesh millimetres = metres;
  for (Eigen::Vector3f& vertex : millimetres.vertices) {
    vertex = 1e-3F * vertex + Eigen::Vector3f(0, 0, 0.02F);
  }
  const auto result = Compare(metres, millimetres, Config(0.005, 0.0005, 0.0001));
  ASSERT_FALSE(result);
  for (const char* word :
       {"no sample of the model", "max_distance_m = 0.005", "0.1414 m", "0.0001414 m", "unit"}) {
    EXPECT_NE(result.error().message.find(word), std::string::npos) << result.error().message;
  }
}

TEST(Compare, NamesWhatIsWrongWithItsInput) {
  const Mesh good = Plate(0.1F, 2, 0.0F);
  const auto message = [&](const Mesh& model, const Mesh& reference, const InspectionConfig& config,
                           const std::optional<std::vector<std::uint8_t>>& visible = std::nullopt) {
    const auto result = Compare(model, reference, config, visible);
    return result ? std::string() : result.error().message;
  };
  const InspectionConfig config = Config(0.005, 0.0005, 0.001);
  EXPECT_EQ(message(Mesh(), good, config), "inspection: the model has no vertices");
  Mesh cloud = good;
  cloud.faces.clear();
  EXPECT_EQ(message(good, cloud, config), "inspection: the reference has no faces");
  Mesh nan = good;
  nan.vertices[3].z() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(message(nan, good, config), "inspection: model: vertex 3 is not finite");
  EXPECT_EQ(message(good, nan, config), "inspection: reference: vertex 3 is not finite");
  EXPECT_EQ(message(good, good, config, std::vector<std::uint8_t>(3, 1)),
            "inspection: 3 visibility flags for 8 faces of the reference");
  EXPECT_EQ(message(good, good, config, std::vector<std::uint8_t>(8, 0)),
            "inspection: reference: no face to be sampled has an area");
  EXPECT_NE(message(good, good, Config(std::nan(""), 0.0005, 0.001)).find("max_distance_m = nan"),
            std::string::npos);
}

}  // namespace
}  // namespace fringe_fusion
