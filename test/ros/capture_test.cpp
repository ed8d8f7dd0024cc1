// What is wrong with a capture reaches the user: in the action's result, on /diagnostics, in the
// masks; and the capture assistant answers by test exposures of its own.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <fringe_fusion/SuggestSettings.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>

#include <algorithm>
#include <mutex>

#include "fringe_fusion/inspection/mask_picture.hpp"
#include "test/ros/cell_support.hpp"

namespace fringe_fusion {
namespace {

/// The last status of one name on /diagnostics.
class Diagnostics {
 public:
  explicit Diagnostics(std::string name) : name_(std::move(name)) {
    ros::NodeHandle nh;
    subscriber_ = nh.subscribe<diagnostic_msgs::DiagnosticArray>(
        "/diagnostics", 100, [this](const diagnostic_msgs::DiagnosticArray::ConstPtr& message) {
          const std::lock_guard<std::mutex> lock(mutex_);
          for (const auto& status : message->status) {
            if (status.name == name_) last_ = status;
          }
        });
  }
  [[nodiscard]] diagnostic_msgs::DiagnosticStatus Last() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return last_;
  }
  /// Waits until the status speaks of a view of this scan.
  [[nodiscard]] bool SpeaksOf(const std::string& scan_id) {
    return test::WaitFor(
        [&] {
          for (const auto& value : Last().values) {
            if (value.key == "view" && value.value.find(scan_id) != std::string::npos) return true;
          }
          return false;
        },
        10.0);
  }

 private:
  std::string name_;
  std::mutex mutex_;
  diagnostic_msgs::DiagnosticStatus last_;
  ros::Subscriber subscriber_;
};

/// The last picture of a topic.
class Picture {
 public:
  explicit Picture(const std::string& topic) {
    ros::NodeHandle nh;
    subscriber_ = nh.subscribe<sensor_msgs::Image>(
        topic, 2, [this](const sensor_msgs::Image::ConstPtr& message) {
          const std::lock_guard<std::mutex> lock(mutex_);
          last_ = message;
        });
  }
  [[nodiscard]] sensor_msgs::Image::ConstPtr Last() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return last_;
  }
  [[nodiscard]] bool Connected() const { return subscriber_.getNumPublishers() > 0; }

 private:
  std::mutex mutex_;
  sensor_msgs::Image::ConstPtr last_;
  ros::Subscriber subscriber_;
};

ScanViewResult Scan(const std::string& action, const std::string& scan_id) {
  EXPECT_TRUE(test::WaitForCell(60.0));
  test::ScanViewClient client(action, true);
  EXPECT_TRUE(test::WaitFor([&] { return client.isServerConnected(); }, 30.0));
  ScanViewGoal goal;
  goal.scan_id = scan_id;
  client.sendGoal(goal);
  EXPECT_EQ(test::WaitForEnd(client, 120.0), "SUCCEEDED");
  return client.getResult() ? *client.getResult() : ScanViewResult();
}

std::string Names(const std::vector<CaptureFinding>& findings) {
  std::string names;
  for (const CaptureFinding& finding : findings) {
    names += finding.name + ": " + finding.evidence + "\n";
  }
  return names;
}

TEST(Capture, CleanViewHasNoFindingAndShowsItsMask) {
  Diagnostics diagnostics("scanner_node: capture");
  Picture mask("mask/image");
  Picture mask_color("mask/image_color");
  Picture legend("mask/legend");
  ASSERT_TRUE(test::WaitFor([&] { return mask.Connected() && mask_color.Connected(); }, 60.0));
  const ScanViewResult result = Scan("scan_view", "clean");
  EXPECT_TRUE(result.findings.empty()) << Names(result.findings);
  ASSERT_TRUE(diagnostics.SpeaksOf("clean"));
  EXPECT_EQ(diagnostics.Last().level, diagnostic_msgs::DiagnosticStatus::OK);
  EXPECT_GE(diagnostics.Last().values.size(), 10U) << "every quantity is stated";

  ASSERT_TRUE(
      test::WaitFor([&] { return mask.Last() && mask_color.Last() && legend.Last(); }, 60.0));
  EXPECT_EQ(mask.Last()->encoding, "mono8");
  EXPECT_EQ(mask.Last()->width, 320U);
  const auto num_valid = std::count(mask.Last()->data.begin(), mask.Last()->data.end(), 0);
  EXPECT_GT(num_valid, 1000);
  const std::size_t pixel = static_cast<std::size_t>(
      std::find(mask.Last()->data.begin(), mask.Last()->data.end(), 0) - mask.Last()->data.begin());
  EXPECT_EQ(mask_color.Last()->encoding, "rgb8");
  EXPECT_EQ(mask_color.Last()->data.at(3 * pixel), MaskColor(MaskReason::kValid).r);
  EXPECT_EQ(static_cast<int>(legend.Last()->height), MaskLegend().height());
}

TEST(Capture, TooShortExposureIsNamedWithWhatToDo) {
  Diagnostics diagnostics("dim/scanner_node: capture");
  const ScanViewResult result = Scan("/dim/scan_view", "dim");
  ASSERT_FALSE(result.findings.empty());
  const CaptureFinding& cause = result.findings.front();
  EXPECT_EQ(cause.name, "too_little_light") << Names(result.findings);
  EXPECT_LT(cause.value, cause.limit);
  EXPECT_NE(cause.advice.find("expose longer"), std::string::npos) << cause.advice;
  ASSERT_TRUE(diagnostics.SpeaksOf("dim"));
  const diagnostic_msgs::DiagnosticStatus status = diagnostics.Last();
  EXPECT_EQ(status.level, diagnostic_msgs::DiagnosticStatus::WARN);
  EXPECT_EQ(status.message.rfind("too_little_light: ", 0), 0U) << status.message;
  bool advised = false;
  for (const auto& value : status.values) {
    advised = advised || (value.key == "too_little_light: advice" && !value.value.empty());
  }
  EXPECT_TRUE(advised);
}

TEST(Capture, AssistantSuggestsSettingsForABudget) {
  ASSERT_TRUE(test::WaitForCell(60.0));
  ros::NodeHandle nh;
  auto service = nh.serviceClient<SuggestSettings>("scanner_node/suggest_settings");
  ASSERT_TRUE(service.waitForExistence(ros::Duration(30.0)));
  SuggestSettings call;
  call.request.frames = 20;
  call.request.max_exposure = 0.05;
  ASSERT_TRUE(service.call(call));
  ASSERT_TRUE(call.response.success) << call.response.message;
  EXPECT_LE(call.response.num_frames, 20U);
  EXPECT_GE(call.response.steps, 3U);
  EXPECT_GE(call.response.fringes.size(), 2U);
  ASSERT_FALSE(call.response.exposures.empty());
  EXPECT_LE(call.response.exposures.back(), 0.0501);
  EXPECT_GT(call.response.sigma_depth, 1e-6);
  EXPECT_LT(call.response.sigma_depth, 1e-3);

  SuggestSettings without;
  ASSERT_TRUE(service.call(without));
  EXPECT_FALSE(without.response.success);
  EXPECT_NE(without.response.message.find("exactly one must be positive"), std::string::npos)
      << without.response.message;
}

}  // namespace
}  // namespace fringe_fusion

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "capture_test");
  const ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
