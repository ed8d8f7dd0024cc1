#include "src/cli/staged_folder.hpp"

#include <gtest/gtest.h>

#include "fringe_program.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

TEST(StagedFolder, ReplacesFilesAndWholeFolders) {
  const TemporaryFolder target("staged");
  WriteBytes(target / "mesh.ply", "old");
  WriteBytes(target / "views/007/range.ply", "old");
  WriteBytes(target / "notes.txt", "mine");
  auto staged = StagedFolder::Create(target.path().string());
  ASSERT_TRUE(staged) << staged.error().message;
  WriteBytes(fs::path(staged->path()) / "mesh.ply", "new");
  WriteBytes(fs::path(staged->path()) / "views/000/range.ply", "new");
  EXPECT_EQ(ReadBytes(target / "mesh.ply"), "old");
  const Status status = staged->Commit();
  ASSERT_TRUE(status) << status.error().message;
  EXPECT_EQ(ListFiles(target.path()),
            (std::vector<std::string>{"mesh.ply", "notes.txt", "views/000/range.ply"}));
  EXPECT_EQ(ReadBytes(target / "mesh.ply"), "new");
  EXPECT_EQ(ReadBytes(target / "notes.txt"), "mine");
}

TEST(StagedFolder, LeavesNothingWithoutCommit) {
  const TemporaryFolder target("staged");
  WriteBytes(target / "mesh.ply", "old");
  {
    auto staged = StagedFolder::Create(target.path().string());
    ASSERT_TRUE(staged) << staged.error().message;
    WriteBytes(fs::path(staged->path()) / "mesh.ply", "new");
  }
  EXPECT_EQ(ListFiles(target.path()), std::vector<std::string>{"mesh.ply"});
  EXPECT_EQ(ReadBytes(target / "mesh.ply"), "old");
}

TEST(StagedFolder, TakesTheFoldersThatItCreatedAwayWithoutCommit) {
  const TemporaryFolder target("staged");
  {
    auto staged = StagedFolder::Create((target / "a/b/").string());
    ASSERT_TRUE(staged) << staged.error().message;
    WriteBytes(fs::path(staged->path()) / "mesh.ply", "new");
  }
  EXPECT_TRUE(fs::is_directory(target.path()));
  EXPECT_FALSE(fs::exists(target / "a"));
  {
    auto staged = StagedFolder::Create((target / "a/b").string());
    ASSERT_TRUE(staged) << staged.error().message;
    WriteBytes(target / "a/notes.txt", "mine");
  }
  EXPECT_EQ(ListFiles(target.path()), std::vector<std::string>{"a/notes.txt"});
  EXPECT_FALSE(fs::exists(target / "a/b"));
}

TEST(StagedFolder, NamesAFolderThatCannotBeMade) {
  const auto staged = StagedFolder::Create("/proc/staged");
  ASSERT_FALSE(staged);
  EXPECT_NE(staged.error().message.find("/proc/staged"), std::string::npos);
}

TEST(StagedFolder, ReportsWhatWasLostBeforeCommit) {
  const TemporaryFolder target("staged");
  auto staged = StagedFolder::Create(target.path().string());
  ASSERT_TRUE(staged) << staged.error().message;
  fs::remove_all(staged->path());
  EXPECT_FALSE(staged->Commit());
}

}  // namespace
}  // namespace fringe_fusion::cli
