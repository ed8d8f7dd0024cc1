#include "fringe_fusion/io/file.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using test_support::TempFolder;

std::function<Status(std::ostream&)> Text(const std::string& text) {
  return [text](std::ostream& stream) -> Status {
    stream << text;
    return {};
  };
}

int NumFiles(const std::string& folder) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) count += entry.exists();
  return count;
}

TEST(WriteAtomically, ReplacesTheEarlierFileAndLeavesNothingElse) {
  const TempFolder folder;
  ASSERT_TRUE(WriteAtomically(folder / "a.txt", Text("one")));
  ASSERT_TRUE(WriteAtomically(folder / "a.txt", Text("two")));
  EXPECT_EQ(*ReadFile(folder / "a.txt"), "two");
  EXPECT_EQ(NumFiles(folder.path()), 1);
}

TEST(WriteAtomically, KeepsTheEarlierFileWhenTheWriterFails) {
  const TempFolder folder;
  ASSERT_TRUE(WriteAtomically(folder / "a.txt", Text("one")));
  const Status status = WriteAtomically(folder / "a.txt", [](std::ostream& stream) -> Status {
    stream << "half";
    return Fail("out of ideas");
  });
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().message, "out of ideas");
  EXPECT_EQ(*ReadFile(folder / "a.txt"), "one");
  EXPECT_EQ(NumFiles(folder.path()), 1);
}

TEST(WriteAtomically, RemovesTheTemporaryFileWhenTheWriterThrows) {
  const TempFolder folder;
  EXPECT_THROW((void)WriteAtomically(folder / "a.txt",
                                     [](std::ostream&) -> Status { throw std::bad_alloc(); }),
               std::bad_alloc);
  EXPECT_EQ(NumFiles(folder.path()), 0);
}

TEST(WriteAtomically, ReportsADiskThatIsFullFromTheStart) {
  const Status small = WriteAtomically("/dev/full", Text("x"));
  ASSERT_FALSE(small);
  EXPECT_EQ(small.error().message, "/dev/full: cannot write: No space left on device");
  const Status large = WriteAtomically("/dev/full", Text(std::string(1 << 20, 'x')));
  ASSERT_FALSE(large);
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST(WriteAtomically, ReportsADiskThatFillsUpAndKeepsTheEarlierFile) {
  const TempFolder folder;
  ASSERT_TRUE(WriteAtomically(folder / "a.txt", Text("one")));
  // A limit on the file size fails a write in the middle of the file as a full disk does.
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto old_handler = signal(SIGXFSZ, SIG_IGN);
  const rlimit limited{100000, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limited), 0);
  const Status status = WriteAtomically(folder / "a.txt", [](std::ostream& stream) -> Status {
    for (int i = 0; i < 100000; ++i) stream << "0123456789";
    return {};
  });
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, old_handler);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().message, (folder / "a.txt") + ": cannot write: File too large");
  EXPECT_EQ(*ReadFile(folder / "a.txt"), "one");
  EXPECT_EQ(NumFiles(folder.path()), 1);
}

TEST(WriteAtomically, NamesTheFolderThatIsMissingOrUnwritable) {
  const TempFolder folder;
  const Status missing = WriteAtomically(folder / "no/a.txt", Text("x"));
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().message,
            (folder / "no/a.txt") + ": cannot write: No such file or directory");
  EXPECT_FALSE(WriteAtomically(folder.path(), Text("x")));
  EXPECT_FALSE(WriteAtomically("", Text("x")));
  if (::geteuid() == 0) return;  // root may write everywhere
  std::filesystem::permissions(
      folder.path(), std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  const Status denied = WriteAtomically(folder / "a.txt", Text("x"));
  std::filesystem::permissions(folder.path(), std::filesystem::perms::owner_all);
  ASSERT_FALSE(denied);
  EXPECT_EQ(denied.error().message, (folder / "a.txt") + ": cannot write: Permission denied");
}

TEST(WriteAtomically, FollowsALink) {
  const TempFolder folder;
  ASSERT_TRUE(WriteAtomically(folder / "a.txt", Text("one")));
  std::filesystem::create_symlink(folder / "a.txt", folder / "link.txt");
  ASSERT_TRUE(WriteAtomically(folder / "link.txt", Text("two")));
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.txt"));
  EXPECT_EQ(*ReadFile(folder / "a.txt"), "two");
}

TEST(WriteAtomically, ServesTwoThreadsThatWriteTheSameName) {
  const TempFolder folder;
  const std::string a(300000, 'a');
  const std::string b(300000, 'b');
  const auto write = [&](const std::string& text) {
    for (int i = 0; i < 10; ++i) ASSERT_TRUE(WriteAtomically(folder / "f", Text(text)));
  };
  std::thread other(write, a);
  write(b);
  other.join();
  const std::string content = *ReadFile(folder / "f");
  EXPECT_TRUE(content == a || content == b);
  EXPECT_EQ(NumFiles(folder.path()), 1);
}

TEST(ReadFile, ReturnsBytesUnchangedAndNamesAMissingFile) {
  const TempFolder folder;
  const std::string bytes("a\0\r\n\xff", 5);
  ASSERT_TRUE(WriteAtomically(folder / "b", Text(bytes)));
  EXPECT_EQ(*ReadFile(folder / "b"), bytes);
  ASSERT_TRUE(WriteAtomically(folder / "empty", Text("")));
  EXPECT_EQ(*ReadFile(folder / "empty"), "");
  const auto missing = ReadFile(folder / "none");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().message,
            (folder / "none") + ": cannot be read: No such file or directory");
  EXPECT_FALSE(ReadFile(folder.path()));
}

TEST(MakeFolder, CreatesParentsAndRefusesAFile) {
  const TempFolder folder;
  EXPECT_TRUE(MakeFolder(folder / "a/b/c"));
  EXPECT_TRUE(MakeFolder(folder / "a/b/c"));
  EXPECT_TRUE(std::filesystem::is_directory(folder / "a/b/c"));
  ASSERT_TRUE(WriteAtomically(folder / "file", Text("x")));
  EXPECT_FALSE(MakeFolder(folder / "file"));
  const Status below = MakeFolder(folder / "file/sub");
  ASSERT_FALSE(below);
  EXPECT_NE(below.error().message.find(folder / "file/sub"), std::string::npos);
  EXPECT_FALSE(MakeFolder(""));
}

}  // namespace
}  // namespace fringe_fusion
