#include "apps/run/frame_clock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tutti {
namespace {

TEST(StampPauses, OnlyWhereTheRecordingStops) {
  StampPauses pauses;
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(pauses.Next(i, 0.1 * i));
  EXPECT_FALSE(pauses.Next(100, 19));  // 9 s: frames that can't be read
  const auto said = pauses.Next(101, 19 + 86400);
  ASSERT_TRUE(said.has_value());
  EXPECT_THAT(*said, ::testing::HasSubstr("frame 101 comes 86400 s after the one before it"));
  EXPECT_FALSE(pauses.Next(102, 19.1 + 86400));
}

TEST(StampPauses, AFrameAMinuteIsNoPause) {
  StampPauses pauses;
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(pauses.Next(i, 60.0 * i));
  EXPECT_TRUE(pauses.Next(100, 60.0 * 100 + 3600));
}

}  // namespace
}  // namespace tutti
