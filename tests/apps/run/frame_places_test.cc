// Frames of a run by their stamps, those of earlier recordings by their numbers.
#include "apps/run/outputs.h"

#include <gtest/gtest.h>

#include "apps/run/run_observer.h"

namespace tutti {
namespace {

Pose At(double x) {
  Pose pose;
  pose.translation.x() = x;
  return pose;
}

TEST(FramePlaces, OwnFramesAreFoundByStampAndThoseOfEarlierRecordingsByNumber) {
  RunResult result;
  result.trajectory = {{0.5, At(3)}};
  result.map = MapGoneOn{"map.tutti", std::vector<MapSession>(2), {}, {{7, At(5)}}};
  result.map->sessions.back().frame_offset = 100000;
  Similarity twice;
  twice.scale = 2;
  const FramePlaces places(result, twice);
  EXPECT_EQ(places.At(0.5)->x(), 6);
  EXPECT_FALSE(places.At(0.6));
  EXPECT_EQ(places.AtEnd(100003, 0.5)->x(), 6);
  EXPECT_EQ(places.AtEnd(7, 0.5)->x(), 10);  // whose stamp is of the other recording
  EXPECT_FALSE(places.AtEnd(8, 0.5));
}

TEST(FramePlaces, WithoutAMapAllFramesAreOwn) {
  RunResult result;
  result.trajectory = {{0.5, At(3)}};
  EXPECT_EQ(FramePlaces(result, {}).AtEnd(7, 0.5)->x(), 3);
}

TEST(RunState, AFrameIsOfTheRecordingWhoseNumbersItLiesIn) {
  const std::vector<LoopRecord> loops;
  RunState state = {nullptr, loops};
  EXPECT_EQ(state.SessionOf(0), 0u);
  EXPECT_EQ(state.SessionOf(123456), 0u);
  state.sessions = {0, 100000, 300000};
  EXPECT_EQ(state.FirstFrame(), 300000);
  EXPECT_EQ(state.SessionOf(99999), 0u);
  EXPECT_EQ(state.SessionOf(100000), 1u);
  EXPECT_EQ(state.SessionOf(300007), 2u);
}

}  // namespace
}  // namespace tutti
