// Real time without a real clock: how many frames are dropped is known exactly. Pauses of a recording.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "apps/run/frame_clock.h"
#include "apps/run/runner.h"
#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

/// Stands still while a frame is tracked, and then jumps by what a slow machine would have needed.
class SlowMachineClock : public FrameClock {
 public:
  explicit SlowMachineClock(double busy_s) : busy_s_(busy_s) {}
  double Now() override { return now_; }
  void WaitUntil(double now) override { now_ = std::max(now_, now) + busy_s_; }

 private:
  double busy_s_, now_ = 1000;
};

TEST(Playback, FramesAreDueByTheDistanceOfTheirStamps) {
  Playback playback(std::make_shared<SlowMachineClock>(0));
  EXPECT_FALSE(playback.Due(5.0));  // nothing is due before the play
  playback.Reach(5.0);
  EXPECT_TRUE(playback.Due(5.0));
  EXPECT_FALSE(playback.Due(5.1));
  playback.Reach(5.1);
  EXPECT_TRUE(playback.Due(5.1));
  EXPECT_FALSE(playback.Due(5.2));
}

RunRequest Request(const std::filesystem::path& folder, const char* out, double busy_s) {
  RunRequest request;
  request.config = testing::TinyConfig(folder);
  request.dataset = testing::TinyTown();
  request.out = folder / out;
  request.no_loops = true;
  request.quiet = true;
  request.end = 12;
  request.realtime = true;
  request.clock = std::make_shared<SlowMachineClock>(busy_s);
  return request;
}

TEST(Realtime, DropsNothingWhileItCanFollow) {
  const auto folder = testing::FreshFolder();
  RunRequest request = Request(folder, "realtime", 0.01);
  const RunResult played = RunSlam(request);
  EXPECT_EQ(played.frames_dropped, 0u);
  request.realtime = false;
  request.out = folder / "all";
  RunSlam(request);
  EXPECT_EQ(testing::ReadAll(folder / "realtime" / "trajectory.txt"),
            testing::ReadAll(folder / "all" / "trajectory.txt"));
}

TEST(Realtime, DropsWhatItCanNotFollowAndCountsIt) {
  const auto folder = testing::FreshFolder();
  const RunResult slow = RunSlam(Request(folder, "slow", 0.17));  // at 10 Hz
  EXPECT_GT(slow.frames_dropped, 2u);
  EXPECT_EQ(slow.frames_total, 12u);
  EXPECT_EQ(slow.frames_tracked + slow.frames_dropped, 12u);
  EXPECT_NE(testing::ReadAll(folder / "slow" / "summary.json")
                .find("\"dropped\": " + std::to_string(slow.frames_dropped)),
            std::string::npos);
  const RunResult again = RunSlam(Request(folder, "again", 0.17));  // the clock alone decides
  EXPECT_EQ(testing::ReadAll(folder / "slow" / "trajectory.txt"),
            testing::ReadAll(folder / "again" / "trajectory.txt"));
  EXPECT_EQ(again.frames_dropped, slow.frames_dropped);
}

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
