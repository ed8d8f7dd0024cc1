#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <limits>

#include "fringe_fusion/io/image_io.hpp"
#include "test/io/scan_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

PhaseMap SmallMap(float seed) {
  PhaseMap phase;
  phase.width = 40;
  phase.height = 30;
  for (Image<float>* layer :
       {&phase.u, &phase.v, &phase.sigma_u, &phase.sigma_v, &phase.offset, &phase.modulation}) {
    *layer = Image<float>(40, 30);
    for (std::size_t i = 0; i < layer->size(); ++i) {
      (*layer)[i] = seed / 3.0F + static_cast<float>(i) * 0.1F;
    }
    seed += 1.0F;
  }
  phase.u(3, 4) = std::numeric_limits<float>::quiet_NaN();
  phase.mask = Image<std::uint8_t>(40, 30);
  phase.mask(3, 4) = static_cast<std::uint8_t>(MaskReason::kShadow);
  phase.color = Image<Rgb8>(40, 30, Rgb8{9, 8, 7});
  return phase;
}

void ExpectSame(const Image<float>& a, const Image<float>& b) {
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(float)), 0);
}

class PhaseMapIoTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto scan = CreateScan(folder_ / "scan", AwkwardCalibration(), SmallSequence());
    ASSERT_TRUE(scan) << scan.error().message;
    scan_ = *scan;
    ASSERT_TRUE(
        WriteStack(scan_, NoiseStack(scan_.calibration, scan_.sequence, 8, 0), std::nullopt, {}));
  }
  [[nodiscard]] std::string InView(const std::string& name) const {
    return ViewFolder(scan_, 0) + "/" + name;
  }
  TempFolder folder_;
  ScanFolder scan_;
};

TEST_F(PhaseMapIoTest, SurvivesARoundTripBitByBit) {
  const PhaseMap phase = SmallMap(1.0F);
  ASSERT_TRUE(WritePhaseMap(scan_, 0, phase));
  const auto read = ReadPhaseMap(scan_, 0);
  ASSERT_TRUE(read) << read.error().message;
  ExpectSame(read->u, phase.u);
  ExpectSame(read->v, phase.v);
  ExpectSame(read->sigma_u, phase.sigma_u);
  ExpectSame(read->sigma_v, phase.sigma_v);
  ExpectSame(read->offset, phase.offset);
  ExpectSame(read->modulation, phase.modulation);
  EXPECT_EQ(read->mask(3, 4), static_cast<std::uint8_t>(MaskReason::kShadow));
  EXPECT_EQ(read->color(1, 1).r, 9);
  EXPECT_EQ(read->first_stamp_ns, 1700000000123456789LL);
  EXPECT_EQ(read->last_stamp_ns, 1700000000123456789LL + 17LL * 33333333);
  EXPECT_FALSE(std::filesystem::exists(InView(".phase.part")));
}

TEST_F(PhaseMapIoTest, RelativeCoordinatesStayRelative) {
  ASSERT_TRUE(WritePhaseMap(scan_, 0, SmallMap(1.0F)));
  PhaseMap phase = SmallMap(2.0F);
  phase.relative_v = true;
  phase.order_error = Image<float>(40, 30, 1e-9F);
  ASSERT_TRUE(WritePhaseMap(scan_, 0, phase));
  EXPECT_FALSE(std::filesystem::exists(InView("v.tiff")));
  const auto read = ReadPhaseMap(scan_, 0);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_FALSE(read->relative_u);
  EXPECT_TRUE(read->relative_v);
  ExpectSame(read->u, phase.u);
  ExpectSame(read->v, phase.v);
  ExpectSame(read->order_error, phase.order_error);
}

TEST_F(PhaseMapIoTest, AMapOfOneAxisRemovesTheOtherOfAnEarlierMap) {
  ASSERT_TRUE(WritePhaseMap(scan_, 0, SmallMap(1.0F)));
  PhaseMap one_axis = SmallMap(5.0F);
  one_axis.v = Image<float>();
  one_axis.sigma_v = Image<float>();
  ASSERT_TRUE(WritePhaseMap(scan_, 0, one_axis));
  const auto read = ReadPhaseMap(scan_, 0);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(read->v.empty());
  ExpectSame(read->u, one_axis.u);
}

TEST_F(PhaseMapIoTest, ABadMapLeavesTheEarlierOne) {
  const PhaseMap good = SmallMap(1.0F);
  ASSERT_TRUE(WritePhaseMap(scan_, 0, good));
  PhaseMap bad = SmallMap(2.0F);
  bad.modulation = Image<float>(3, 3);
  EXPECT_EQ(MessageOf(WritePhaseMap(scan_, 0, bad)),
            ViewFolder(scan_, 0) + ": modulation.tiff: is 3 x 3, but the phase map is 40 x 30");
  bad = SmallMap(2.0F);
  bad.u = Image<float>();
  EXPECT_EQ(MessageOf(WritePhaseMap(scan_, 0, bad)), ViewFolder(scan_, 0) + ": sigma_u without u");
  const auto read = ReadPhaseMap(scan_, 0);
  ASSERT_TRUE(read) << read.error().message;
  ExpectSame(read->u, good.u);
}

TEST_F(PhaseMapIoTest, NamesTheLayerThatIsMissingOrWrong) {
  EXPECT_EQ(MessageOf(ReadPhaseMap(scan_, 0)),
            InView("mask.png") + ": cannot be read: No such file or directory");
  ASSERT_TRUE(WritePhaseMap(scan_, 0, SmallMap(1.0F)));
  ASSERT_TRUE(WriteImage(Image<float>(39, 30), InView("v.tiff")));
  EXPECT_EQ(MessageOf(ReadPhaseMap(scan_, 0)),
            InView("v.tiff") + ": is 39 x 30, but the phase map is 40 x 30");
  ASSERT_TRUE(WritePhaseMap(scan_, 0, SmallMap(1.0F)));
  std::filesystem::remove(InView("modulation.tiff"));
  EXPECT_EQ(MessageOf(ReadPhaseMap(scan_, 0)),
            InView("modulation.tiff") + ": cannot be read: No such file or directory");
  ASSERT_TRUE(WritePhaseMap(scan_, 0, SmallMap(1.0F)));
  std::filesystem::remove(InView("sigma_v.tiff"));
  EXPECT_EQ(MessageOf(ReadPhaseMap(scan_, 0)), ViewFolder(scan_, 0) + ": v without sigma_v");
  ASSERT_TRUE(WritePhaseMap(scan_, 0, SmallMap(1.0F)));
  ASSERT_TRUE(WriteImage(Image<std::uint8_t>(40, 30, 200), InView("mask.png")));
  EXPECT_EQ(
      MessageOf(ReadPhaseMap(scan_, 0)),
      InView("mask.png") + fmt::format(": mask value 200 is outside [0, {}]", kNumMaskReasons - 1));
}

}  // namespace
}  // namespace fringe_fusion
