// A node that cannot start says why in one line and exits with a status that is not zero.
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <sstream>
#include <string>
#include <vector>

namespace fringe_fusion {
namespace {

struct Outcome {
  int exit_status = -1;
  std::vector<std::string> lines;
};

// Runs a command to its end; a node that does not end within 60 s counts as hanging, status 124.
Outcome RunCommand(const std::string& command) {
  Outcome outcome;
  const std::string bounded = "timeout -k 5 60 " + command + " 2>&1";
  FILE* pipe = popen(bounded.c_str(), "r");
  if (pipe == nullptr) return outcome;
  std::string text;
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) text += buffer.data();
  const int status = pclose(pipe);
  if (WIFEXITED(status)) outcome.exit_status = WEXITSTATUS(status);
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    if (!line.empty()) outcome.lines.push_back(line);
  }
  return outcome;
}

Outcome RunNode(const std::string& node) {
  return RunCommand(std::string(NODE_DIR) + "/" + node + " __name:=" + node);
}

std::vector<std::string> AllNodes() {
  std::vector<std::string> nodes;
  std::istringstream stream(NODES);
  for (std::string node; std::getline(stream, node, ' ');) nodes.push_back(node);
  return nodes;
}

class NodeStart : public ::testing::TestWithParam<std::string> {};

TEST_P(NodeStart, NamesTheMissingParameter) {
  const Outcome outcome = RunNode(GetParam());
  EXPECT_EQ(outcome.exit_status, 1);
  ASSERT_EQ(outcome.lines.size(), 1U) << ::testing::PrintToString(outcome.lines);
  const std::string expected = "required parameter /" + GetParam() + "/";
  EXPECT_NE(outcome.lines[0].find(expected), std::string::npos) << outcome.lines[0];
  EXPECT_NE(outcome.lines[0].find("is missing"), std::string::npos) << outcome.lines[0];
}

INSTANTIATE_TEST_SUITE_P(Nodes, NodeStart, ::testing::ValuesIn(AllNodes()),
                         [](const auto& node) { return node.param; });

TEST(Nodelet, DoesNotLoadWithoutItsParameters) {
  const Outcome outcome = RunCommand(
      "rosrun nodelet nodelet standalone fringe_fusion/motion_node __name:=motion_nodelet");
  EXPECT_NE(outcome.exit_status, 0);
  bool named = false;
  for (const std::string& line : outcome.lines) {
    named = named || line.find("required parameter /motion_nodelet/") != std::string::npos;
  }
  EXPECT_TRUE(named) << ::testing::PrintToString(outcome.lines);
}

void SetMotionParameters() {
  ros::param::set("motion_node/backend", "sim");
  ros::param::set("motion_node/rate_hz", 50.0);
  ros::param::set("motion_node/timeout_s", 30.0);
  ros::param::set("motion_node/joint_names", std::vector<std::string>{"a", "b"});
  ros::param::set("motion_node/initial_positions", std::vector<double>{0.0, 0.0});
  ros::param::set("motion_node/sim/speed_rad_s", 1.0);
  ros::param::set("motion_node/sim/acceleration_rad_s2", 1.0);
  ros::param::set("motion_node/sim/settle_s", 0.1);
}

void ExpectRefusal(const std::string& words) {
  const Outcome outcome = RunNode("motion_node");
  EXPECT_EQ(outcome.exit_status, 1);
  ASSERT_EQ(outcome.lines.size(), 1U) << ::testing::PrintToString(outcome.lines);
  EXPECT_NE(outcome.lines[0].find(words), std::string::npos) << outcome.lines[0];
}

TEST(Parameters, AreRefusedWithNameValueAndLimit) {
  SetMotionParameters();
  ros::param::set("motion_node/rate_hz", 0.5);
  ExpectRefusal("rate_hz = 0.5 is outside [1, 1000]");
  SetMotionParameters();
  ros::param::set("motion_node/rate_hz", "fast");
  ExpectRefusal("parameter /motion_node/rate_hz has a value of the wrong type");
  SetMotionParameters();
  ros::param::set("motion_node/backend", "laser");
  ExpectRefusal("parameter /motion_node/backend is 'laser', must be sim");
  SetMotionParameters();
  ros::param::set("motion_node/initial_positions", std::vector<double>{0.0});
  ExpectRefusal("/motion_node/initial_positions has 1 values, must have one per joint, 2");
  ros::param::del("motion_node");
}

TEST(Parameters, AMisspeltOneIsNamed) {
  SetMotionParameters();
  ros::param::set("motion_node/replay/scan", "");  // Of the backend that is not chosen: known.
  ros::param::set("motion_node/sim/settel_s", 0.1);
  const Outcome outcome = RunNode("motion_node");
  EXPECT_EQ(outcome.exit_status, 1);
  const auto says = [](const std::string& line) {
    return line.find("parameter /motion_node/sim/settel_s is unknown") != std::string::npos;
  };
  EXPECT_EQ(std::count_if(outcome.lines.begin(), outcome.lines.end(), says), 1)
      << ::testing::PrintToString(outcome.lines);
  ros::param::del("motion_node");
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "node_start_test");
  const ros::NodeHandle nh;
  return RUN_ALL_TESTS();
}
