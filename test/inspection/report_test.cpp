#include "fringe_fusion/inspection/report.hpp"

#include <gtest/gtest.h>

#include "fringe_fusion/io/file.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using test_support::TempFolder;

Report SmallReport() {
  Report report;
  report.title = "Scan of <part> & \"more\"";
  report.paragraphs = {"12 views, a < b"};
  report.tables = {{"Deviation", {"way", "rms [mm]"}, {{"model to truth", "0.031"}}}};
  report.pictures = {{"The <mesh>", "mesh 1#.png"}};
  return report;
}

TEST(WriteReport, HoldsTitleTablesAndPicturesEscaped) {
  const TempFolder folder;
  ASSERT_TRUE(WriteReport(SmallReport(), folder / "r.html"));
  const std::string page = *ReadFile(folder / "r.html");
  const auto has = [&](const std::string& text) { return page.find(text) != std::string::npos; };
  EXPECT_EQ(page.rfind("<!DOCTYPE html>", 0), 0U);
  EXPECT_TRUE(has("<h1>Scan of &lt;part&gt; &amp; &quot;more&quot;</h1>"));
  EXPECT_TRUE(has("<p>12 views, a &lt; b</p>"));
  EXPECT_TRUE(has("<h2>Deviation</h2>"));
  EXPECT_TRUE(has("<tr><th>way</th><th>rms [mm]</th></tr>"));
  EXPECT_TRUE(has("<tr><td>model to truth</td><td>0.031</td></tr>"));
  EXPECT_TRUE(has("<img src=\"mesh%201%23.png\" alt=\"The &lt;mesh&gt;\">"));
  EXPECT_FALSE(has("<part>"));
  EXPECT_FALSE(has("<script"));
  EXPECT_FALSE(has("http://")) << "the page needs nothing from elsewhere";
}

TEST(WriteReport, NamesThePathThatCannotBeWritten) {
  const TempFolder folder;
  const Status status = WriteReport(SmallReport(), folder / "none/r.html");
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().message,
            (folder / "none/r.html") + ": cannot write: No such file or directory");
}

}  // namespace
}  // namespace fringe_fusion
