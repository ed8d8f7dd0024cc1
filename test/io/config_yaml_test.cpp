#include "fringe_fusion/io/config_yaml.hpp"

#include <gtest/gtest.h>

#include "test/io/scan_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using test_support::MessageOf;
using test_support::Spit;
using test_support::TempFolder;

struct ExampleConfig {
  int steps = 4;
  double limit_px = 0.5;

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("steps", steps, 3, 64);
    field("limit_px", limit_px, 0.0, 2.0);
  }
};

TEST(LoadConfigFile, EveryKeyIsRequiredUnlessDefaultsAreAskedFor) {
  const TempFolder folder;
  const std::string path = folder / "example.yaml";
  Spit(path, "limit_px: 1.5\n");
  EXPECT_EQ(MessageOf(LoadConfigFile<ExampleConfig>(path)),
            path + ": required key 'steps' is missing");
  const auto partial = LoadConfigFile<ExampleConfig>(path, MissingKeys::kTakeDefaults);
  ASSERT_TRUE(partial) << partial.error().message;
  EXPECT_EQ(partial->steps, 4);
  EXPECT_EQ(partial->limit_px, 1.5);
  Spit(path, "# nothing\n");
  const auto empty = LoadConfigFile<ExampleConfig>(path, MissingKeys::kTakeDefaults);
  ASSERT_TRUE(empty) << empty.error().message;
  EXPECT_EQ(empty->limit_px, 0.5);
  EXPECT_EQ(MessageOf(LoadConfigFile<ExampleConfig>(path)), path + ": not a YAML map");
}

TEST(LoadConfigFile, PartialFilesAreCheckedLikeWholeOnes) {
  const TempFolder folder;
  const std::string path = folder / "example.yaml";
  const auto complaint = [&path](const std::string& text) {
    Spit(path, text);
    return MessageOf(LoadConfigFile<ExampleConfig>(path, MissingKeys::kTakeDefaults));
  };
  EXPECT_EQ(complaint("limit: 1.5\n"), path + ": unknown key 'limit'");
  EXPECT_EQ(complaint("steps: 2\n"), path + ": steps = 2 is outside [3, 64]");
  EXPECT_EQ(complaint("steps: many\n"),
            path + ": key 'steps' has the value 'many', must be a whole number");
  EXPECT_EQ(complaint("steps: 4\nsteps: 5\n"), path + ": the key 'steps' occurs twice");
}

}  // namespace
}  // namespace fringe_fusion
