#include "src/io/yaml_fields.hpp"

#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <random>

#include "test/support/temp_folder.hpp"

namespace fringe_fusion::internal {
namespace {

// Reads {n: int, x: double, l: [a, b]} and tells the complaint, "" if there is none.
std::string Complaint(const std::string& yaml) {
  YamlFields fields(YAML::Load(yaml), "file.yaml: part");
  int n = 0;
  double x = 7.0;
  std::array<double, 2> list{};
  fields.Required("n", n);
  fields.Optional("x", x);
  fields.Optional("l", list);
  const Status status = fields.Finish();
  return status ? std::string() : status.error().message;
}

TEST(YamlFields, AcceptsWhatIsAskedFor) {
  EXPECT_EQ(Complaint("{n: 3, x: 1.5, l: [1, 2]}"), "");
  EXPECT_EQ(Complaint("{n: 3}"), "");
}

TEST(YamlFields, NamesOwnerKeyAndValueOfEveryFault) {
  EXPECT_EQ(Complaint("{x: 1}"), "file.yaml: part: required key 'n' is missing");
  EXPECT_EQ(Complaint("{n: 3, m: 4}"), "file.yaml: part: unknown key 'm'");
  EXPECT_EQ(Complaint("{n: 3, n: 4}"), "file.yaml: part: the key 'n' occurs twice");
  EXPECT_EQ(Complaint("{n: 3.5}"), "file.yaml: part: n = 3.5 must be a whole number");
  EXPECT_EQ(Complaint("{n: 3, x: hello}"), "file.yaml: part: x = hello must be a number");
  EXPECT_EQ(Complaint("{n: 3, x: .nan}"), "file.yaml: part: x = .nan must be finite");
  EXPECT_EQ(Complaint("{n: 3, l: [1, .inf]}"), "file.yaml: part: l = [1, .inf] must be finite");
  EXPECT_EQ(Complaint("{n: 3, l: [1]}"), "file.yaml: part: l = [1] must be a list of 2 numbers");
  EXPECT_EQ(Complaint("[1, 2]"), "file.yaml: part: must be a map of keys and values, not '[1, 2]'");
  EXPECT_EQ(Complaint(""), "file.yaml: part: required key 'n' is missing");
}

TEST(LoadYaml, NamesFileAndLineOfASyntaxError) {
  const test_support::TempFolder folder;
  std::ofstream(folder / "a.yaml") << "a: 1\nb: [1, 2\nc: 3\n";
  const auto root = LoadYaml(folder / "a.yaml");
  ASSERT_FALSE(root);
  EXPECT_EQ(root.error().message.rfind((folder / "a.yaml") + ": line 3", 0), 0U)
      << root.error().message;
  EXPECT_FALSE(LoadYaml(folder / "none.yaml"));
}

Result<Transform> Parse(const std::string& yaml) {
  YamlFields fields(YAML::Load(yaml), "T");
  Transform T = Transform::Identity();
  ReadTransform(fields, T);
  if (const Status status = fields.Finish(); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return T;
}

TEST(TransformYaml, SurvivesARoundTripBitByBit) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 200; ++i) {
    Vector6d xi;
    for (int k = 0; k < 6; ++k) xi[k] = normal(random);
    const Transform T = Exp(xi) * Exp(0.3 * xi);
    const auto read = Parse(TransformYaml(T));
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->matrix(), T.matrix());
  }
}

TEST(TransformYaml, RefusesContradictionAndScaledQuaternion) {
  const auto contradiction = Parse(
      "{translation_m: [0, 0, 0], quaternion_xyzw: [0, 0, 0, 1], "
      "rotation_row_major: [0, -1, 0, 1, 0, 0, 0, 0, 1]}");
  ASSERT_FALSE(contradiction);
  EXPECT_NE(contradiction.error().message.find("is off by 1 from quaternion_xyzw, limit 1e-9"),
            std::string::npos);
  const auto scaled = Parse("{translation_m: [0, 0, 0], quaternion_xyzw: [0, 0, 0, 2]}");
  ASSERT_FALSE(scaled);
  EXPECT_EQ(scaled.error().message, "T: quaternion has length 2, must be 1 within 0.001");
}

TEST(QuotedYaml, KeepsAwkwardText) {
  const std::string text = "a \"b\" \\ : #\n[é]";
  EXPECT_EQ(YAML::Load(QuotedYaml(text)).as<std::string>(), text);
}

}  // namespace
}  // namespace fringe_fusion::internal
