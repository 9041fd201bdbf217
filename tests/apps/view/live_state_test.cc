#include "apps/view/live_state.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace tutti::view
