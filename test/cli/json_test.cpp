#include "src/cli/json.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "fringe_program.hpp"

namespace fringe_fusion::cli {
namespace {

TEST(Json, KeepsTheOrderOfItsKeys) {
  const Json json = Json().Set("b", 1).Set("a", true).Set("c", 0.25);
  EXPECT_EQ(json.Text(), "{\n  \"b\": 1,\n  \"a\": true,\n  \"c\": 0.25\n}");
}

TEST(Json, ReplacesAValue) {
  EXPECT_EQ(Json().Set("a", 1).Set("b", 2).Set("a", 3).Text(), "{\n  \"a\": 3,\n  \"b\": 2\n}");
}

TEST(Json, WritesNullForWhatIsNoNumber) {
  const Json json = Json()
                        .Set("nan", std::numeric_limits<double>::quiet_NaN())
                        .Set("inf", std::numeric_limits<float>::infinity());
  EXPECT_EQ(json.Text(), "{\n  \"nan\": null,\n  \"inf\": null\n}");
}

TEST(Json, EscapesText) {
  EXPECT_EQ(Json().Set("a\"b", "c\\d\n").Text(), "{\n  \"a\\\"b\": \"c\\\\d\\u000a\"\n}");
}

TEST(Json, NestsAndIndents) {
  const Json inner = Json().Set("x", 1);
  EXPECT_EQ(Json().Set("list", std::vector<Json>{inner, inner}).Set("none", Json()).Text(),
            "{\n  \"list\": [\n    {\n      \"x\": 1\n    },\n    {\n      \"x\": 1\n    }\n  ],\n"
            "  \"none\": {}\n}");
  EXPECT_EQ(Json().Set("empty", std::vector<Json>{}).Text(), "{\n  \"empty\": []\n}");
}

TEST(Json, ReadsBackEveryDigit) {
  const std::string text = Json().Set("a", 0.1 + 0.2).Text();
  EXPECT_NE(text.find("0.30000000000000004"), std::string::npos) << text;
}

TEST(Json, NamesAFileThatCannotBeWritten) {
  const TemporaryFolder folder("fringe_json");
  EXPECT_TRUE(WriteJson(Json(), (folder / "a.json").string()));
  EXPECT_EQ(ReadBytes(folder / "a.json"), "{}\n");
  const Status status = WriteJson(Json(), (folder / "nowhere/a.json").string());
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("nowhere"), std::string::npos);
}

}  // namespace
}  // namespace fringe_fusion::cli
