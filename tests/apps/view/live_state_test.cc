#include "apps/view/live_state.h"

#include <gtest/gtest.h>

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
  const std::vector<LoopRecord> loops;
  InputFrame frame;
  frame.index = 12;
  state.SetFrame(frame, {}, {nullptr, loops});
  LiveCursor cursor;
  LiveNews news;
  ASSERT_TRUE(state.WaitForNews(&cursor, 0, &news));
  EXPECT_EQ(news.frame.index, 12);
  EXPECT_EQ(news.frame.state, "appearance only");
  EXPECT_TRUE(news.places->empty());
  EXPECT_TRUE(news.spots.empty());
  EXPECT_EQ(news.sessions, 1u);
}

}  // namespace
}  // namespace tutti::view
