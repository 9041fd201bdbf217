// Loop closure on an odometry that was tracked once.
#include "apps/run/shared_odometry.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "apps/run/outputs.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// A lap around a block and a bit more, with loops.
const fs::path& TownWithALoop() {
  static const fs::path town = testing::GeneratedDataset([] {
    SyntheticOptions options = testing::SmallStereoTownWithALoop(512, 256);
    options.noise_sigma = 4;
    return options;
  }());
  return town;
}

class SharedOdometry : public ::testing::Test {
 protected:
  static RunConfig Config() {
    RunConfig config;
    config.dataset.type = DatasetType::kKitti;
    config.dataset.sensor = Sensor::kStereo;
    config.odometry.features = 1000;
    return config;
  }
  static RunRequest Request(const fs::path& out) {
    RunRequest request;
    request.config = "test";
    request.dataset = TownWithALoop();
    request.out = out;
    request.quiet = true;
    request.threads = 2;
    return request;
  }
  // Tracked once, and its loops closed once, with two threads: however many tests look at it.
  struct Shared {
    fs::path out;
    TrackedSequence tracked;
    RunResult closed;
  };
  static const Shared& WithTwoThreads() {
    static const Shared shared = [] {
      Shared made;
      made.out = testing::FreshFolder();
      made.tracked = TrackSequence(Request(made.out / "odometry"), Config());
      made.closed = CloseLoops(made.tracked, Request(made.out / "ensemble"), Config());
      return made;
    }();
    return shared;
  }
  static std::string Text(const Trajectory& trajectory, const fs::path& file) {
    WriteTrajectory(file, trajectory, TrajectoryFormat::kTum);
    std::ifstream in(file);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  // The lines of loops.csv up to the image that was the first to be measured against the map.
  static std::vector<std::string> Proposals(const RunResult& result, std::int64_t before) {
    std::vector<std::string> out;
    for (const Loop& loop : result.loops) {
      if (loop.query >= before) break;
      std::string line = std::to_string(loop.query) + " " + std::to_string(loop.candidate) + " " +
                         std::to_string(loop.inliers) + "/" + std::to_string(loop.matches);
      for (const MemberOpinion& member : loop.members) line += " " + std::to_string(member.hypothesis);
      out.push_back(line);
    }
    return out;
  }
  const fs::path folder_ = testing::FreshFolder();
};

TEST_F(SharedOdometry, LoopsMoveTheMapAndLeaveTheOdometryAlone) {
  const auto& [out, tracked, closed] = WithTwoThreads();
  ASSERT_TRUE(tracked.odometry);
  EXPECT_EQ(tracked.result.loops.size(), 0u);
  EXPECT_TRUE(closed.shared_odometry);
  ASSERT_GT(closed.LoopsAccepted(), 0u);
  ASSERT_GT(closed.corrections, 0);
  const std::string alone = Text(tracked.result.trajectory, folder_ / "a");
  EXPECT_EQ(Text(closed.trajectory_odometry, folder_ / "b"), alone);
  EXPECT_NE(Text(closed.trajectory, folder_ / "c"), alone);
  ASSERT_TRUE(closed.evaluation && tracked.result.evaluation);
  EXPECT_LT(closed.evaluation->slam.ate.rmse, tracked.result.evaluation->slam.ate.rmse);
  EXPECT_EQ(closed.reference.size(), tracked.result.reference.size());
  EXPECT_TRUE(fs::exists(out / "ensemble" / "loops.csv"));
}

TEST_F(SharedOdometry, UntilTheFirstVerifiedLoopTheDetectorAnswersAsInARunOfItsOwn) {
  const auto& [out, tracked, closed] = WithTwoThreads();
  const RunResult apart = RunSlam(Request(folder_ / "apart"), Config());
  EXPECT_EQ(Text(apart.trajectory_odometry, folder_ / "a"), Text(tracked.result.trajectory, folder_ / "b"));
  std::int64_t first = -1;
  for (const Loop& loop : apart.loops) {
    if (loop.verified && first < 0) first = loop.query + 1;
  }
  ASSERT_GT(first, 0);
  const std::vector<std::string> proposals = Proposals(apart, first);
  ASSERT_FALSE(proposals.empty());
  EXPECT_EQ(Proposals(closed, first), proposals);
}

TEST_F(SharedOdometry, TheSameForAnyNumberOfThreads) {
  RunRequest one = Request(folder_ / "one");
  one.threads = 1;
  const RunResult a = CloseLoops(TrackSequence(one, Config()), one, Config());
  const RunResult& b = WithTwoThreads().closed;
  EXPECT_EQ(LoopsCsv(a), LoopsCsv(b));
  EXPECT_EQ(Text(a.trajectory, folder_ / "a"), Text(b.trajectory, folder_ / "b"));
}

TEST_F(SharedOdometry, WithoutACalibrationThereIsNone) {
  TrackedSequence tracked;
  EXPECT_THROW(CloseLoops(tracked, Request(folder_ / "none"), Config()), InputError);
}

}  // namespace
}  // namespace tutti
