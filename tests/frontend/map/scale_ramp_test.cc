#include "frontend/map/scale_ramp.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tutti {
namespace {

// Keyframes 1 m apart, on a line.
Map Line(int count) {
  Map map({1.0f});
  for (int id = 0; id < count; ++id) {
    Keyframe k;
    k.features = std::make_shared<FrameFeatures>();
    k.T_world_camera.translation = {0, 0, double(id)};
    map.AddKeyframe(k);
  }
  return map;
}

TEST(ScaleRamp, GrowsAlongTheWay) {
  const auto moved = ScaleRamp(Line(12), 1, 11, 0.1);
  ASSERT_EQ(moved.size(), 10u) << "keyframe 1, and all before it, stay";
  double before = 1;
  for (const auto& [id, S] : moved) {
    EXPECT_NEAR(std::log(S.scale), 0.01 * (id - 1), 1e-12);
    EXPECT_NEAR(S.translation.z() - before, S.scale, 1e-12) << "each step is as much longer";
    before = S.translation.z();
  }
}

TEST(ScaleRamp, LeavesOtherPiecesAloneAndWhatWasReplaced) {
  Map map = Line(6);
  map.keyframe(2).piece = 1;
  map.keyframe(4).replaced_by = 3;
  const auto moved = ScaleRamp(map, 0, 5, -0.1);
  EXPECT_EQ(moved.count(2) + moved.count(4), 0u);
  EXPECT_NEAR(std::log(moved.at(5).scale), -0.1, 1e-12);
}

TEST(ScaleRamp, IsNoneWithoutAWay) {
  EXPECT_TRUE(ScaleRamp(Line(3), 2, 2, 0.1).empty());
  Map still = Line(2);
  still.keyframe(1).T_world_camera.translation.setZero();
  EXPECT_TRUE(ScaleRamp(still, 0, 1, 0.1).empty());
}

}  // namespace
}  // namespace tutti
