// A bag of frames, CameraInfo and tf becomes the scan folder that it was made from.
#include <fringe_fusion/Frame.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <sensor_msgs/PointCloud2.h>
#include <sensor_msgs/point_cloud2_iterator.h>
#include <tf2_msgs/TFMessage.h>

#include <cstdint>
#include <memory>

#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/ros_io/bag_reader.hpp"
#include "fringe_fusion/ros_io/cloud_messages.hpp"
#include "fringe_fusion/ros_io/frame_messages.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"
#include "fringe_program.hpp"

namespace fringe_fusion::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCameraFrame = "camera_optical_frame";
constexpr const char* kProjectorFrame = "projector_optical_frame";

geometry_msgs::TransformStamped MakeTf(const std::string& parent, const std::string& child,
                                       const Transform& T_parent_child, const ros::Time& stamp) {
  geometry_msgs::TransformStamped message;
  message.header.frame_id = parent;
  message.header.stamp = stamp;
  message.child_frame_id = child;
  message.transform = ros_io::ToTransformMessage(T_parent_child);
  return message;
}

tf2_msgs::TFMessage Wrap(const geometry_msgs::TransformStamped& transform) {
  tf2_msgs::TFMessage message;
  message.transforms.push_back(transform);
  return message;
}

void WriteDevices(rosbag::Bag& bag, const ScanFolder& scan, const ros::Time& stamp) {
  sensor_msgs::CameraInfo camera = ros_io::ToMessage(scan.calibration.camera);
  camera.header.frame_id = kCameraFrame;
  bag.write("/camera_info", stamp, camera);
  sensor_msgs::CameraInfo projector = ros_io::ToMessage(scan.calibration.projector);
  projector.header.frame_id = kProjectorFrame;
  bag.write("/projector_info", stamp, projector);
  const Transform T_camera_projector = scan.calibration.T_projector_camera.inverse();
  bag.write("/tf_static", stamp,
            Wrap(MakeTf(kCameraFrame, kProjectorFrame, T_camera_projector, stamp)));
}

/// Records a scan folder as the nodes would. @param num_left_out last frames that were lost.
/// @param scan_id "": that of the scan; else under this id behind what the bag has already.
void WriteBag(const ScanFolder& scan, const std::string& path, std::size_t num_left_out,
              const std::string& scan_id = "") {
  rosbag::Bag bag(path, scan_id.empty() ? rosbag::bagmode::Write : rosbag::bagmode::Append);
  bool is_first = true;
  for (const int id : scan.view_ids) {
    auto stack = ReadStack(scan, id);
    ASSERT_TRUE(stack) << stack.error().message;
    if (!scan_id.empty()) stack->scan_id = scan_id;
    const auto description = ReadViewDescription(scan, id);
    ASSERT_TRUE(description && description->prior);
    const ros::Time stamp = ros_io::ToRosTime(stack->frames.front().stamp_ns);
    if (is_first) WriteDevices(bag, scan, stamp);
    is_first = false;
    bag.write("/tf", stamp,
              Wrap(MakeTf("object", kCameraFrame, description->prior->T_object_camera, stamp)));
    for (std::size_t i = 0; i + num_left_out < stack->frames.size(); ++i) {
      bag.write("/frames", ros_io::ToRosTime(stack->frames[i].stamp_ns),
                ros_io::ToMessage(*stack, i, kCameraFrame));
    }
  }
}

class Import : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>("fringe_import");
    WriteSmallCellConfig(*folder_ / "config");
    const Outcome outcome = RunFringe({"simulate", "--config", (*folder_ / "config").string(),
                                       "--views", "2", "--out", (*folder_ / "scan").string()});
    ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static std::string Path(const std::string& name) { return (*folder_ / name).string(); }

  static std::unique_ptr<TemporaryFolder> folder_;
};

std::unique_ptr<TemporaryFolder> Import::folder_;

TEST_F(Import, GivesBackTheRecordedScan) {
  const auto scan = OpenScan(Path("scan"));
  ASSERT_TRUE(scan) << scan.error().message;
  WriteBag(*scan, Path("scan.bag"), 0);
  const Outcome outcome = RunFringe({"import", "--bag", Path("scan.bag"), "--out", Path("back")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;

  const auto back = OpenScan(Path("back"));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->view_ids, scan->view_ids);
  EXPECT_EQ(back->calibration.camera.fx, scan->calibration.camera.fx);
  EXPECT_EQ(back->calibration.projector.cy, scan->calibration.projector.cy);
  EXPECT_TRUE(
      back->calibration.T_projector_camera.isApprox(scan->calibration.T_projector_camera, 1e-12));
  for (const int id : scan->view_ids) {
    const auto truth = ReadViewDescription(*scan, id);
    const auto found = ReadViewDescription(*back, id);
    ASSERT_TRUE(truth && found);
    EXPECT_EQ(found->stamps_ns, truth->stamps_ns);
    ASSERT_TRUE(found->prior.has_value());
    EXPECT_TRUE(found->prior->T_object_camera.isApprox(truth->prior->T_object_camera, 1e-12));
    EXPECT_EQ(found->prior->source, PoseSource::kTf);
    for (const std::string& file : truth->frame_files) {
      EXPECT_TRUE(ReadBytes(fs::path(ViewFolder(*back, id)) / file) ==
                  ReadBytes(fs::path(ViewFolder(*scan, id)) / file))
          << file;
    }
  }
}

TEST_F(Import, RefusesAViewThatLacksFrames) {
  const auto scan = OpenScan(Path("scan"));
  ASSERT_TRUE(scan) << scan.error().message;
  WriteBag(*scan, Path("short.bag"), 1);
  const Outcome outcome =
      RunFringe({"import", "--bag", Path("short.bag"), "--out", Path("short"), "--quiet"});
  EXPECT_EQ(outcome.exit_status, 1);
  const std::size_t count = scan->sequence.frames.size();
  const std::string words = fmt::format("view 0 has {} of {} frames", count - 1, count);
  EXPECT_NE(outcome.err.find(words), std::string::npos) << outcome.err;
  EXPECT_FALSE(fs::exists(Path("short")));
}

TEST_F(Import, TakesTheScanThatIsNamed) {
  auto scan = OpenScan(Path("scan"));
  ASSERT_TRUE(scan) << scan.error().message;
  WriteBag(*scan, Path("two.bag"), 0);
  const std::string first_id = ReadStack(*scan, 0)->scan_id;
  scan->view_ids = {1};
  WriteBag(*scan, Path("two.bag"), 0, "second scan");
  const auto import = [](const std::vector<std::string>& more) {
    std::vector<std::string> call = {"import", "--bag", Path("two.bag"), "--out", Path("two")};
    call.insert(call.end(), more.begin(), more.end());
    return RunFringe(call);
  };
  for (const auto& choice : {std::vector<std::string>{}, {"--scan-id", "third"}}) {
    const Outcome refused = import(choice);
    EXPECT_EQ(refused.exit_status, 1);
    for (const std::string& word : {std::string("two.bag"), first_id, std::string("second scan")}) {
      EXPECT_NE(refused.err.find(word), std::string::npos) << refused.err;
    }
  }
  const Outcome outcome = import({"--scan-id", "second scan"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto imported = OpenScan(Path("two"));
  ASSERT_TRUE(imported) << imported.error().message;
  EXPECT_EQ(imported->view_ids, std::vector<int>{1});
  EXPECT_EQ(ReadStack(*imported, 1)->scan_id, "second scan");
}

TEST_F(Import, LeavesThePriorOutWhereTfDoesNotKnowTheObject) {
  const auto scan = OpenScan(Path("scan"));
  ASSERT_TRUE(scan) << scan.error().message;
  WriteBag(*scan, Path("other.bag"), 0);
  const Outcome outcome = RunFringe(
      {"import", "--bag", Path("other.bag"), "--out", Path("other"), "--object-frame", "part"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("2 views, 0 with a prior pose"), std::string::npos) << outcome.out;
}

sensor_msgs::PointCloud2 MakeCloud() {
  sensor_msgs::PointCloud2 message;
  message.height = 1;
  sensor_msgs::PointCloud2Modifier modifier(message);
  modifier.setPointCloud2FieldsByString(2, "xyz", "rgb");
  modifier.resize(3);
  sensor_msgs::PointCloud2Iterator<float> x(message, "x");
  sensor_msgs::PointCloud2Iterator<float> y(message, "y");
  sensor_msgs::PointCloud2Iterator<float> z(message, "z");
  sensor_msgs::PointCloud2Iterator<std::uint8_t> red(message, "r");
  for (int i = 0; i < 3; ++i, ++x, ++y, ++z, ++red) {
    *x = static_cast<float>(i);
    *y = 0.5F;
    *z = i == 1 ? std::numeric_limits<float>::quiet_NaN() : 2.0F;
    *red = static_cast<std::uint8_t>(100 + i);
  }
  return message;
}

TEST_F(Import, WritesTheFinitePointsOfACloud) {
  {
    rosbag::Bag bag(Path("cloud.bag"), rosbag::bagmode::Write);
    bag.write("/points", ros::Time(5.0), MakeCloud());
  }
  const Outcome outcome = RunFringe(
      {"import", "--bag", Path("cloud.bag"), "--cloud", "/points", "--out", Path("cloud.ply")});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto cloud = ReadMesh(Path("cloud.ply"));
  ASSERT_TRUE(cloud) << cloud.error().message;
  ASSERT_EQ(cloud->vertices.size(), 2U);
  EXPECT_EQ(cloud->vertices[1], Eigen::Vector3f(2.0F, 0.5F, 2.0F));
  ASSERT_EQ(cloud->colors.size(), 2U);
  EXPECT_EQ(cloud->colors[1].r, 102);
}

TEST(CloudMessages, RefuseLyingSizes) {
  sensor_msgs::PointCloud2 message = MakeCloud();
  message.width = 4000000000U;
  EXPECT_FALSE(ros_io::ToCloud(message));
  message = MakeCloud();
  message.row_step = 1;
  EXPECT_FALSE(ros_io::ToCloud(message));
  message = MakeCloud();
  message.fields[2].offset = message.point_step - 1;
  const auto field = ros_io::ToCloud(message);
  ASSERT_FALSE(field);
  EXPECT_EQ(field.error().message, "has no float field 'z'");
}

TEST(BagReader, RefusesATopicOfAnotherType) {
  auto bag = ros_io::BagReader::Open(SOURCE_DIR "/test/data/tf_only.bag");
  ASSERT_TRUE(bag) << bag.error().message;
  EXPECT_EQ(bag->Topics(), std::vector<std::string>{"/tf (tf2_msgs/TFMessage)"});
  EXPECT_TRUE(bag->HasFrame("object"));
  EXPECT_FALSE(bag->HasFrame("camera"));
  const auto cloud = bag->ReadCloud("/tf");
  ASSERT_FALSE(cloud);
  EXPECT_NE(cloud.error().message.find("must be sensor_msgs/PointCloud2"), std::string::npos);
}

}  // namespace
}  // namespace fringe_fusion::cli
