#include "src/inspection/embree_scene.hpp"

#include <gtest/gtest.h>

#include <utility>

#include "test/inspection/shapes.hpp"

namespace fringe_fusion::internal {
namespace {

TEST(EmbreeScene, SurvivesMovesAndHoldsTheTriangles) {
  const Mesh box = test_support::Box({-1, -2, -3}, {1, 2, 3});
  auto created = EmbreeScene::Create(box.vertices, box.faces);
  ASSERT_TRUE(created) << created.error().message;
  EmbreeScene moved = std::move(*created);
  auto other = EmbreeScene::Create(box.vertices, {box.faces[0]});
  ASSERT_TRUE(other);
  moved = std::move(*other);
  moved = std::move(*EmbreeScene::Create(box.vertices, box.faces));
  RTCBounds bounds;
  rtcGetSceneBounds(moved.scene(), &bounds);
  EXPECT_EQ(bounds.lower_x, -1.0F);
  EXPECT_EQ(bounds.upper_z, 3.0F);
}

}  // namespace
}  // namespace fringe_fusion::internal
