// trajectory_live.txt and loops_live.csv grow line by line.
#include "apps/run/live_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/apps/tutti/executable.h"
#include "tests/support/full_disk.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using testing::ReadAll;

TEST(LiveFiles, EveryLineIsThereAtOnce) {
  const auto folder = testing::FreshFolder();
  CameraRig rig;
  rig.calibrated = true;
  LiveFiles live(folder, rig, RunConfig());
  std::vector<Loop> loops;
  const RunState state = {nullptr, loops, 0};
  TrackResult track;
  live.Add(0.5, track, state);  // it has no pose yet
  const std::string header = "# timestamp tx ty tz qx qy qz qw\n";
  EXPECT_EQ(ReadAll(folder / kLiveTrajectory), header);
  track.state = TrackingState::kTracking;
  track.T_world_camera.translation.x() = 2;
  loops.emplace_back();
  loops.back().query = 7;
  live.Add(1, track, state);
  EXPECT_EQ(ReadAll(folder / kLiveTrajectory), header +
                                                   "1.000000000 2.000000000 0.000000000 0.000000000 "
                                                   "0.000000000 0.000000000 0.000000000 1.000000000\n");
  EXPECT_THAT(ReadAll(folder / kLiveLoops), HasSubstr("\n7,-1,"));
  const std::string before = ReadAll(folder / kLiveLoops);
  live.Add(2, track, state);
  EXPECT_EQ(ReadAll(folder / kLiveLoops), before);  // each loop once
  EXPECT_THAT(ReadAll(folder / kLiveTrajectory), EndsWith("1.000000000\n"));
  EXPECT_EQ(live.trajectory().size(), 2u);
  EXPECT_TRUE(live.TakeProblems().empty());
}

// cp -l, and a folder of a stranger.
TEST(GrowingFile, WhatAnotherFolderSharesStaysAsItIs) {
  const auto folder = testing::FreshFolder();
  testing::WriteAll(folder / "other", "of another run");
  std::filesystem::create_hard_link(folder / "other", folder / "hard");
  std::filesystem::create_symlink("other", folder / "link");
  GrowingFile hard(folder / "hard", "header\n");
  EXPECT_EQ(ReadAll(folder / "hard"), "header\n");
  GrowingFile link(folder / "link", "header\n");
  EXPECT_TRUE(link.TakeProblem());
  EXPECT_EQ(ReadAll(folder / "other"), "of another run");
}

TEST(GrowingFile, AFullDiskIsSaidOnceAndEndsNoRun) {
  GrowingFile file("/dev/full", "header\n");
  const auto problem = file.TakeProblem();
  ASSERT_TRUE(problem);
  EXPECT_THAT(*problem, HasSubstr("No space left on device"));
  file.Append("line\n");
  EXPECT_FALSE(file.TakeProblem());
}

TEST(GrowingFile, WhatAFullDiskHeldUpIsWrittenOnceThereIsRoom) {
  const auto path = testing::FreshFolder() / "file";
  GrowingFile file(path, "header\n");
  {
    const testing::FullDisk full(10);  // room for half of the line
    file.Append("line 1\n");
    file.Append("line 2\n");
    EXPECT_THAT(*file.TakeProblem(), HasSubstr("can't grow (File too large)"));
    EXPECT_EQ(ReadAll(path), "header\n");  // whole lines alone
  }
  file.Append("line 3\n");
  EXPECT_EQ(ReadAll(path), "header\nline 1\nline 2\nline 3\n");
  EXPECT_THAT(*file.TakeProblem(), HasSubstr("grows again"));
}

}  // namespace
}  // namespace tutti
