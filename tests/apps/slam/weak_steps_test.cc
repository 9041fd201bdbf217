#include "apps/slam/weak_steps.h"

#include <gtest/gtest.h>

#include <cmath>

#include "frontend/features/features.h"
#include "tutti/frontend/odometry_options.h"

namespace tutti {
namespace {

constexpr int kFramesOfAKeyframe = 10;

// A map without landmarks: `frames` frames at 30 Hz, the step to each of which has this length.
template <class StepTo>
Map StepsOf(int frames, const StepTo& step_to) {
  Map map(PyramidScales(OdometryOptions()));
  double x = 0;
  int newest = -1;
  for (int i = 0; i < frames; ++i) {
    x += step_to(i);
    const Pose T_world_camera({1, 0, 0, 0}, {x, 0, 0});
    if (i % kFramesOfAKeyframe == 0) {
      Keyframe keyframe;
      keyframe.frame_index = i;
      keyframe.stamp_s = i / 30.0;
      keyframe.T_world_camera = T_world_camera;
      keyframe.features = std::make_shared<FrameFeatures>();
      newest = map.AddKeyframe(keyframe);
    }
    map.AddFrame(i, i / 30.0, newest, T_world_camera.Inverse());
  }
  return map;
}

TEST(WeakSteps, ASlideIsFasterThanWhatIsAroundIt) {
  const auto sigmas = StepSigmas(StepsOf(100, [](int i) { return i > 52 && i <= 57 ? 0.03 : 0.003; }), -1, 1);
  ASSERT_EQ(sigmas.size(), 9u);
  for (const auto& [keyframe, sigma] : sigmas) {
    EXPECT_NEAR(sigma.translation_m, keyframe == 6 ? 5 * 0.027 : 0, 1e-6) << keyframe;
  }
}

TEST(WeakSteps, ACameraThatStartsOrStopsDoesNotSlide) {
  for (const auto& [keyframe, sigma] :
       StepSigmas(StepsOf(100, [](int i) { return i < 50 ? 0.002 : 0.03; }), -1, 1))
    EXPECT_EQ(sigma.translation_m, 0) << keyframe;
  for (const auto& [keyframe, sigma] :
       StepSigmas(StepsOf(100, [](int i) { return i < 50 ? 0.03 : 0.002; }), -1, 1))
    EXPECT_EQ(sigma.translation_m, 0) << keyframe;
}

TEST(WeakSteps, ThoseThatWereJudgedAreNotJudgedAgain) {
  const auto sigmas = StepSigmas(StepsOf(100, [](int) { return 0.01; }), 6, 1);
  ASSERT_EQ(sigmas.size(), 3u);
  EXPECT_EQ(sigmas.front().first, 7);
}

}  // namespace
}  // namespace tutti
