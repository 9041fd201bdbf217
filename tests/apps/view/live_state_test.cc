#include "apps/view/live_state.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <thread>

namespace tutti::view {
namespace {

TEST(LiveState, ThatTheRunIsDoneIsStillSaidWhenItIsClosedAtOnce) {
  LiveState state;
  LiveCursor cursor;
  LiveNews news;
  state.Log("begun");
  ASSERT_TRUE(state.WaitForNews(&cursor, 0, &news));
  state.Finish();
  state.Close();
  ASSERT_TRUE(state.WaitForNews(&cursor, 0, &news));
  EXPECT_TRUE(news.finished);
  EXPECT_FALSE(state.WaitForNews(&cursor, 0, &news));
  EXPECT_TRUE(state.Closed());
}

TEST(LiveState, WithoutPosesThereAreFramesButNoPlaces) {
  LiveState state;
  const std::vector<Loop> loops;
  InputFrame frame;
  frame.index = 12;
  state.OnFrame(frame, {}, {nullptr, loops});
  LiveCursor cursor;
  LiveNews news;
  ASSERT_TRUE(state.WaitForNews(&cursor, 0, &news));
  EXPECT_EQ(news.frame.index, 12);
  EXPECT_EQ(news.frame.state, "appearance only");
  EXPECT_TRUE(news.places->empty());
  EXPECT_TRUE(news.spots.empty());
  EXPECT_EQ(news.sessions, 1u);
}

TEST(LiveState, APauseThatIsAskedForStandsWhenTheFrameThatWasBegunIsDone) {
  LiveState state;
  LiveCursor cursor;
  LiveNews news;
  const auto take_news = [&] { ASSERT_TRUE(state.WaitForNews(&cursor, 60, &news)); };
  state.Pause(true);
  take_news();
  EXPECT_TRUE(news.paused);
  EXPECT_FALSE(news.standing);
  std::thread run([&] {
    state.WaitWhilePaused(60);
    state.Log("one frame more");
    state.WaitWhilePaused(60);
  });
  take_news();
  EXPECT_TRUE(news.standing);
  state.Step();
  take_news();
  ASSERT_EQ(news.events.size(), 1u);
  if (!news.standing) take_news();  // the run may be back before the news is taken
  EXPECT_TRUE(news.standing);
  state.Pause(false);
  run.join();
  state.Log("it goes on");
  take_news();
  EXPECT_FALSE(news.paused || news.standing);
}

// A wall before a camera at 2 m, seen by a sensor.
InputFrame WallSeenBy(Sensor sensor, CameraRig* rig) {
  rig->sensor = sensor;
  rig->camera.width = 640, rig->camera.height = 480;
  rig->camera.fx = rig->camera.fy = 400, rig->camera.cx = 320, rig->camera.cy = 240;
  rig->baseline_m = 0.1;
  InputFrame frame;
  cv::Mat texture(480, 640 + 20, CV_8UC1);
  cv::theRNG().state = 7;
  cv::randu(texture, 0, 255);
  cv::GaussianBlur(texture, texture, {}, 3);
  cv::normalize(texture, texture, 0, 255, cv::NORM_MINMAX);
  frame.image = texture(cv::Rect(0, 0, 640, 480)).clone();
  if (sensor == Sensor::kRgbd) frame.depth_m = cv::Mat(480, 640, CV_32FC1, cv::Scalar(2));
  if (sensor == Sensor::kStereo) frame.right = texture(cv::Rect(20, 0, 640, 480)).clone();  // fx b / z
  return frame;
}

TEST(LiveSurface, IsWhatTheDepthOfEitherSensorShows) {
  for (const Sensor sensor : {Sensor::kRgbd, Sensor::kStereo, Sensor::kMono}) {
    CameraRig rig;
    const InputFrame frame = WallSeenBy(sensor, &rig);
    LivePoints points;
    SeeSurface(frame, rig, &points);
    ASSERT_EQ(points.surface.size(), points.greys.size());
    EXPECT_LE(points.surface.size(), LiveState::kSurfacePerKeyframe);
    if (sensor == Sensor::kMono) {
      EXPECT_TRUE(points.surface.empty());
      continue;
    }
    EXPECT_GT(points.surface.size(), LiveState::kSurfacePerKeyframe / 2);
    for (std::size_t i = 0; i < points.surface.size(); ++i) {
      const Eigen::Vector3d at = points.surface[i].cast<double>();
      EXPECT_NEAR(at.z(), 2, sensor == Sensor::kRgbd ? 1e-6 : 0.1);
      const int u = static_cast<int>(std::lround(400 * at.x() / at.z() + 320)),
                v = static_cast<int>(std::lround(400 * at.y() / at.z() + 240));
      EXPECT_EQ(points.greys[i], frame.image.at<std::uint8_t>(v, u));
    }
  }
}

}  // namespace
}  // namespace tutti::view
