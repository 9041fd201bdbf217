#include "tests/support/rendered_world.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "tests/data/small_world.h"

namespace tutti {
namespace {

bool SameBytes(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && (a.empty() || cv::norm(a, b, cv::NORM_INF) == 0);
}

TEST(RenderedWorld, KeptFramesAreThoseThatTheWorldRenders) {
  for (const SyntheticSensor sensor :
       {SyntheticSensor::kMono, SyntheticSensor::kStereo, SyntheticSensor::kRgbd}) {
    SyntheticOptions options = testing::SmallWorld(SyntheticScene::kRoom, sensor);
    options.supersample = 1;
    const SyntheticWorld world(options);
    for (int time = 0; time < 2; ++time) {  // rendered unless an earlier run did; then read
      const testing::RenderedWorld kept(options);
      EXPECT_EQ(kept.Size(), world.Size());
      EXPECT_EQ(kept.FramesPerLap(), world.FramesPerLap());
      EXPECT_EQ(kept.Camera().Matrix(), world.Camera().Matrix());
      EXPECT_EQ(kept.Options().rate_hz, world.Options().rate_hz);
      const SyntheticFrame a = kept.Render(3), b = world.Render(3);
      EXPECT_EQ(a.stamp_s, b.stamp_s);
      EXPECT_EQ(a.T_world_camera.Matrix(), b.T_world_camera.Matrix());
      EXPECT_TRUE(SameBytes(a.image, b.image) && SameBytes(a.right, b.right) &&
                  SameBytes(a.depth_m, b.depth_m));
    }
  }
}

TEST(RenderedWorld, EveryOptionMakesAnotherWorld) {
  const SyntheticOptions plain;
  SyntheticOptions other;
  other.kinect_noise = true;
  EXPECT_NE(testing::TextOf(other), testing::TextOf(plain));
  other = plain;
  other.laps += 1e-12;
  EXPECT_NE(testing::TextOf(other), testing::TextOf(plain));
  EXPECT_EQ(testing::TextOf(plain), testing::TextOf(SyntheticOptions()));
}

}  // namespace
}  // namespace tutti
