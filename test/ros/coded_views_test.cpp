// Codes of views on their way to the epipolar services.
#include "nodes/coded_views.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "fringe_fusion/ros_io/phase_messages.hpp"

namespace fringe_fusion {
namespace {

CellCalibration SomeCell() {
  CellCalibration cell;
  cell.camera = {4, 3, 50.0, 51.0, 1.5, 1.0, {0.1, 0.0, 0.0, 0.0, 0.0}};
  cell.projector = {128, 80, 200.0, 200.0, 64.0, 40.0, {0.0, 0.0, 0.0, 0.0, 0.0}};
  cell.T_projector_camera.translation() = Eigen::Vector3d(0.2, 0.0, 0.01);
  return cell;
}

ros_io::DecodedCodes SomeCodes() {
  ros_io::DecodedCodes codes;
  codes.scan_id = "a";
  codes.view_id = 7;
  codes.camera_frame = "camera";
  codes.projector_frame = "projector";
  codes.calibration = SomeCell();
  codes.phase.width = 4;
  codes.phase.height = 3;
  codes.phase.u = Image<float>(4, 3, 12.5F);
  codes.phase.u(2, 1) = std::nanf("");
  codes.phase.sigma_u = Image<float>(4, 3, 0.05F);
  codes.phase.first_stamp_ns = 1700000000123456789;
  codes.phase.last_stamp_ns = 1700000001000000001;
  return codes;
}

TEST(DecodedView, KeepsWhatItCarries) {
  const ros_io::DecodedCodes codes = SomeCodes();
  const auto back = ros_io::FromMessage(ros_io::ToMessage(codes.phase, codes));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->scan_id, "a");
  EXPECT_EQ(back->view_id, 7);
  EXPECT_EQ(back->projector_frame, "projector");
  EXPECT_EQ(CalibrationId(back->calibration), CalibrationId(codes.calibration));
  EXPECT_EQ(back->phase.u(3, 2), 12.5F);
  EXPECT_TRUE(std::isnan(back->phase.u(2, 1)));
  EXPECT_EQ(back->phase.sigma_u(0, 0), 0.05F);
  EXPECT_TRUE(back->phase.v.empty());
  EXPECT_EQ(back->phase.last_stamp_ns, codes.phase.last_stamp_ns);
}

TEST(DecodedView, RefusesWhatDoesNotFit) {
  const ros_io::DecodedCodes codes = SomeCodes();
  const DecodedView good = ros_io::ToMessage(codes.phase, codes);
  const auto words = [](const DecodedView& message) {
    const auto back = ros_io::FromMessage(message);
    return back ? std::string("accepted") : back.error().message;
  };
  DecodedView bad = good;
  bad.u.data.pop_back();
  EXPECT_NE(words(bad).find("view 7 of scan 'a': u: 47 bytes"), std::string::npos) << words(bad);
  bad = good;
  bad.u.encoding = "mono8";
  EXPECT_NE(words(bad).find("must be 32FC1"), std::string::npos) << words(bad);
  bad = good;
  bad.sigma_u = sensor_msgs::Image();
  EXPECT_NE(words(bad).find("codes without sigmas"), std::string::npos) << words(bad);
  bad = good;
  bad.projector_camera.rotation.w = 0.5;
  EXPECT_NE(words(bad).find("quaternion"), std::string::npos) << words(bad);
  bad = good;
  bad.camera.width = 5;
  EXPECT_NE(words(bad).find("u is 4 x 3 px, but the camera 5 x 3"), std::string::npos)
      << words(bad);
}

nodes::CodedView Coded(const std::string& scan_id, int view_id) {
  nodes::CodedView view;
  view.scan_id = scan_id;
  view.view_id = view_id;
  view.calibration = SomeCell();
  return view;
}

TEST(CodedViews, FindsByScanAndViewAndForgetsTheOldest) {
  nodes::CodedViews views(3);
  EXPECT_FALSE(views.Wait({}, 0.0));
  views.Add(Coded("a", 1));
  views.Add(Coded("b", 5));
  views.Add(Coded("b", 2));
  const auto last = views.Wait({}, 0.0);
  ASSERT_TRUE(last) << last.error().message;
  ASSERT_EQ(last->size(), 2U) << "the scan of the last view";
  EXPECT_EQ((*last)[0]->view_id, 2);
  EXPECT_TRUE(views.Wait({"a", {1}}, 0.0));
  views.Add(Coded("b", 5));  // Again: replaced.
  EXPECT_TRUE(views.Wait({"a", {}}, 0.0));
  views.Add(Coded("b", 6));
  const auto gone = views.Wait({"a", {}}, 0.0);
  ASSERT_FALSE(gone);
  EXPECT_EQ(gone.error().message, "no codes of scan 'a' among the 3 views kept");
  const auto missing = views.Wait({"b", {6, 9}}, 0.0);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().message, "no codes of view 9 of scan 'b' among the 3 views kept");
  views.Clear();
  EXPECT_FALSE(views.Wait({}, 0.0));
}

TEST(CodedViews, WaitsForAViewOnItsWay) {
  nodes::CodedViews views(3);
  std::thread later([&views] {
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    views.Add(Coded("a", 1));
  });
  EXPECT_TRUE(views.Wait({"a", {1}}, 20.0));
  later.join();
}

TEST(CodedViews, DoesNotMixCalibrations) {
  nodes::CodedViews views(3);
  views.Add(Coded("a", 1));
  nodes::CodedView other = Coded("a", 2);
  other.calibration.camera.fx += 1.0;
  views.Add(other);
  const auto both = views.Wait({"a", {}}, 0.0);
  ASSERT_FALSE(both);
  EXPECT_NE(both.error().message.find("views 1 and 2 of scan 'a'"), std::string::npos);
  EXPECT_TRUE(views.Wait({"a", {2}}, 0.0));
}

}  // namespace
}  // namespace fringe_fusion
