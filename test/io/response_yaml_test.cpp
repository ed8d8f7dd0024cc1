#include "fringe_fusion/io/response_yaml.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using test_support::TempFolder;

TEST(ResponseYaml, SurvivesARoundTripBitByBit) {
  const TempFolder folder;
  ResponseCurve response = PowerResponse(2.2);
  response.gamma_residual = 1.0 / 3.0;
  response.sigma_gamma = 0.1 + 0.2;
  response.use = ResponseUse::kPhase;
  ASSERT_TRUE(WriteResponse(response, folder / "response.yaml"));
  const auto read = ReadResponse(folder / "response.yaml");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->light, response.light);
  EXPECT_EQ(read->gamma, response.gamma);
  EXPECT_EQ(read->sigma_gamma, response.sigma_gamma);
  EXPECT_EQ(read->gamma_residual, response.gamma_residual);
  EXPECT_EQ(read->use, ResponseUse::kPhase);
}

TEST(ResponseYaml, KnowsNoSigmaWhereNoneWasMeasured) {
  const TempFolder folder;
  ASSERT_TRUE(WriteResponse(PowerResponse(1.5), folder / "response.yaml"));
  const auto read = ReadResponse(folder / "response.yaml");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(std::isnan(read->sigma_gamma));
}

TEST(ResponseYaml, RefusesWhatIsNoRisingCurve) {
  const TempFolder folder;
  ResponseCurve falling = PowerResponse(1.0);
  falling.light[100] = 0.9;
  const Status fallen = WriteResponse(falling, folder / "falling.yaml");
  ASSERT_FALSE(fallen);
  EXPECT_NE(fallen.error().message.find("light of value 101"), std::string::npos)
      << fallen.error().message;
  ResponseCurve nan = PowerResponse(1.0);
  nan.light[7] = std::nan("");
  EXPECT_FALSE(WriteResponse(nan, folder / "nan.yaml"));
  std::ofstream(folder / "short.yaml") << "gamma: 1\ngamma_residual: 0\nlight: [0, 1]\n";
  const auto too_few = ReadResponse(folder / "short.yaml");
  ASSERT_FALSE(too_few);
  EXPECT_NE(too_few.error().message.find("256"), std::string::npos) << too_few.error().message;
  EXPECT_FALSE(ReadResponse(folder / "absent.yaml"));
  std::ofstream(folder / "camera.yaml") << "undo_in: camera\ngamma: 1\ngamma_residual: 0\n";
  const auto strange = ReadResponse(folder / "camera.yaml");
  ASSERT_FALSE(strange);
  EXPECT_NE(strange.error().message.find("undo_in is 'camera'"), std::string::npos)
      << strange.error().message;
}

}  // namespace
}  // namespace fringe_fusion
