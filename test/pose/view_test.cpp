#include "fringe_fusion/pose/view.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <set>

namespace fringe_fusion {
namespace {

View GoodView() {
  View view;
  view.id = 3;
  view.name = "003";
  view.range = MakeRangeImage(4, 3);
  view.range.points(1, 1) = Eigen::Vector3f(0.0F, 0.0F, 0.5F);
  view.pose.source = PoseSource::kTf;
  view.pose.covariance = PoseCovariance(1e-3, 1e-4);
  return view;
}

TEST(View, PoseCovarianceOrdersRotationFirst) {
  const Matrix6d covariance = PoseCovariance(2e-3, 1e-4);
  EXPECT_DOUBLE_EQ(covariance(0, 0), 4e-6);
  EXPECT_DOUBLE_EQ(covariance(2, 2), 4e-6);
  EXPECT_DOUBLE_EQ(covariance(3, 3), 1e-8);
  EXPECT_DOUBLE_EQ(covariance(5, 5), 1e-8);
  EXPECT_DOUBLE_EQ(covariance.squaredNorm(), covariance.diagonal().squaredNorm());
}

TEST(View, SourceNamesDiffer) {
  std::set<std::string> names;
  for (const PoseSource source : {PoseSource::kNone, PoseSource::kFile, PoseSource::kTf,
                                  PoseSource::kEpipolar, PoseSource::kRegistration}) {
    names.insert(PoseSourceName(source));
  }
  EXPECT_EQ(names.size(), 5U);
}

TEST(View, AcceptsExactAndSingularPriors) {
  View view = GoodView();
  EXPECT_TRUE(Validate(view));
  view.pose.covariance.setZero();
  EXPECT_TRUE(Validate(view));
  // A turntable errs along three of six directions only.
  const Vector6d direction = (Vector6d() << 1.0, 2.0, 3.0, 0.1, 0.2, 0.3).finished();
  view.pose.covariance = 1e-6 * direction * direction.transpose();
  EXPECT_TRUE(Validate(view));
}

TEST(View, RefusalNamesTheView) {
  View view = GoodView();
  view.pose.source = PoseSource::kNone;
  const Status status = Validate(view);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().message, "view 3 (003): no pose");
}

TEST(View, RefusesBadPoses) {
  View view = GoodView();
  view.pose.T_object_camera.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(Validate(view));
  view = GoodView();
  view.pose.T_object_camera.linear() *= 1.01;
  EXPECT_FALSE(Validate(view));
  view = GoodView();
  view.pose.T_object_camera.linear().col(0) *= -1.0;  // a mirror
  EXPECT_FALSE(Validate(view));
  view = GoodView();
  view.pose.covariance(2, 2) = -1e-3;
  EXPECT_FALSE(Validate(view));
  view = GoodView();
  view.pose.covariance(0, 5) = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(Validate(view));
}

TEST(View, RefusesAnEmptyRangeImage) {
  View view = GoodView();
  view.range = MakeRangeImage(4, 3);
  EXPECT_FALSE(Validate(view));
}

}  // namespace
}  // namespace fringe_fusion
