#include "fringe_fusion/fusion/model_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "fringe_fusion/io/file.hpp"
#include "test/fusion/synthetic_views.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

std::vector<View> Views() {
  testing::ViewSettings settings;
  settings.sigma_range_m = 1e-4;
  std::vector<View> views = testing::CastAround(testing::SphereScene(0.008), 0.12, settings);
  views[1].pose.covariance = PoseCovariance(1e-4, 1e-4);
  return views;
}

ImplicitModel FuseByDefault(const std::vector<View>& views) {
  Result<ImplicitModel> model = ImplicitModel::Create(FusionConfig{});
  EXPECT_TRUE(model && model->AddViews(views));
  return std::move(*model);
}

TEST(ModelFile, ComesBackAsItWas) {
  const test_support::TempFolder folder;
  const std::string path = folder / "model.vdb";
  std::vector<View> views = Views();
  const View late = views.back();
  views.pop_back();
  ImplicitModel model = FuseByDefault(views);
  ASSERT_TRUE(SaveModel(model, path, {"part 7", 3}));
  Result<SavedModel> saved = LoadModel(path);
  ASSERT_TRUE(saved) << saved.error().message;
  EXPECT_EQ(saved->origin.scan_id, "part 7");
  EXPECT_EQ(saved->origin.pose_revision, 3U);
  ImplicitModel* loaded = &saved->model;
  EXPECT_EQ(loaded->ViewIds(), model.ViewIds());
  EXPECT_EQ(testing::Dump(*loaded), testing::Dump(model));
  // Work goes on where it stopped.
  ASSERT_TRUE(model.AddView(late) && model.RemoveView(2));
  ASSERT_TRUE(loaded->AddView(late) && loaded->RemoveView(2));
  EXPECT_EQ(testing::Dump(*loaded), testing::Dump(model));
}

TEST(ModelFile, WantsItsSuffix) {
  const test_support::TempFolder folder;
  const Status status = SaveModel(FuseByDefault({Views()[0]}), folder / "model");
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("must end in .vdb"), std::string::npos);
}

TEST(ModelFile, AnEmptyModelComesBackToo) {
  const test_support::TempFolder folder;
  const std::string path = folder / "empty.vdb";
  FusionConfig config;
  config.voxel_m = 2e-3;
  const Result<ImplicitModel> model = ImplicitModel::Create(config);
  ASSERT_TRUE(model && SaveModel(*model, path));
  const Result<SavedModel> loaded = LoadModel(path);
  ASSERT_TRUE(loaded) << loaded.error().message;
  EXPECT_EQ(loaded->model.NumBlocks(), 0U);
  EXPECT_EQ(loaded->model.config().voxel_m, 2e-3);
}

TEST(ModelFile, RefusesWhatIsNoWholeModel) {
  const test_support::TempFolder folder;
  const std::string path = folder / "model.vdb";
  EXPECT_FALSE(LoadModel(path));  // not there
  std::vector<View> views = Views();
  views.resize(2);
  ASSERT_TRUE(SaveModel(FuseByDefault(views), path));
  const Result<std::string> bytes = ReadFile(path);
  ASSERT_TRUE(bytes);
  const auto load = [&](const std::string& content) {
    std::ofstream(path, std::ios::binary) << content;
    return LoadModel(path);
  };
  EXPECT_FALSE(load(""));
  EXPECT_FALSE(load("no vdb at all"));
  EXPECT_FALSE(load(bytes->substr(0, bytes->size() / 3)));
  std::string changed = *bytes;
  // Well inside the samples of the first view.
  changed[changed.size() / 4] = static_cast<char>(changed[changed.size() / 4] ^ 1);
  const Result<SavedModel> damaged = load(changed);
  ASSERT_FALSE(damaged);
  EXPECT_NE(damaged.error().message.find("model.vdb"), std::string::npos);
}

TEST(ModelFile, SaysWhereItCannotWrite) {
  const Status status = SaveModel(FuseByDefault({Views()[0]}), "/nowhere/at/all/model.vdb");
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("/nowhere/at/all"), std::string::npos);
  const test_support::TempFolder folder;
  std::filesystem::create_symlink("/dev/full", folder / "full.vdb");
  const Status full = SaveModel(FuseByDefault({Views()[0]}), folder / "full.vdb");
  ASSERT_FALSE(full);
  EXPECT_NE(full.error().message.find("No space left"), std::string::npos) << full.error().message;
}

}  // namespace
}  // namespace fringe_fusion
