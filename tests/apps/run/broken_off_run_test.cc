// A run that an exception breaks off: what there is by then is written, and an earlier result stays.
#include <gtest/gtest.h>

#include <memory>
#include <new>
#include <nlohmann/json.hpp>

#include "apps/run/runner.h"
#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::ReadAll;

constexpr int kFramesBefore = 8;

class ThrowsInAFrame : public RunObserver {
  void OnFrame(const InputFrame& frame, const TrackResult&, const RunState&) override {
    if (frame.index == kFramesBefore - 1) throw std::bad_alloc();
  }
};

class ThrowsInADetection : public RunObserver {
  void OnDetection(const LoopResult& result) override {
    if (result.query > 0) throw std::runtime_error("the detector gave up");
  }
};

class BrokenOffRun : public ::testing::Test {
 protected:
  RunRequest Request() const {
    RunRequest request;
    request.config = testing::TinyConfig(folder_);
    request.dataset = testing::TinyTown();
    request.out = folder_ / "out";
    request.quiet = true;
    return request;
  }
  nlohmann::json Summary(const fs::path& out) const {
    return nlohmann::json::parse(ReadAll(out / "summary.json"));
  }

  const fs::path folder_ = testing::FreshFolder();
};

TEST_F(BrokenOffRun, WritesWhatThereIsAndThrowsOn) {
  RunRequest request = Request();
  request.observers.push_back(std::make_shared<ThrowsInAFrame>());
  EXPECT_THROW(RunSlam(request), std::bad_alloc);
  for (const char* name : {"trajectory.txt", "trajectory_online.txt", "trajectory_odometry.txt"}) {
    EXPECT_EQ(ReadTrajectory(request.out / name, TrajectoryFormat::kTum).size(),
              static_cast<std::size_t>(kFramesBefore))
        << name;
  }
  EXPECT_FALSE(ReadAll(request.out / "graph.g2o").empty());
  const nlohmann::json summary = Summary(request.out);
  EXPECT_EQ(summary["failure"], std::bad_alloc().what());
  EXPECT_EQ(summary["frames"]["tracked"], kFramesBefore);
  EXPECT_FALSE(fs::exists(request.out / "trajectory_live.txt"));
}

TEST_F(BrokenOffRun, LeavesAnEarlierResultAlone) {
  RunRequest request = Request();
  request.end = 4;
  RunSlam(request);
  const std::string earlier = ReadAll(request.out / "trajectory.txt"),
                    summary = ReadAll(request.out / "summary.json");
  for (const int threads : {1, 2}) {
    RunRequest broken = Request();
    broken.threads = threads;
    broken.observers.push_back(std::make_shared<ThrowsInADetection>());
    EXPECT_THROW(RunSlam(broken), std::runtime_error);
    EXPECT_EQ(ReadAll(request.out / "trajectory.txt"), earlier);
    EXPECT_EQ(ReadAll(request.out / "summary.json"), summary);
    const fs::path unfinished = request.out / "unfinished";
    EXPECT_EQ(Summary(unfinished)["failure"], "the detector gave up");
    EXPECT_GT(ReadTrajectory(unfinished / "trajectory.txt", TrajectoryFormat::kTum).size(), 4u);
  }
}

TEST_F(BrokenOffRun, AReportThatCanNotBeMadeStopsNoFile) {
  RunRequest request = Request();
  request.end = 4;
  request.more_files = [](const RunResult&) -> std::vector<OutputFile> { throw std::bad_alloc(); };
  EXPECT_ANY_THROW(RunSlam(request));
  EXPECT_EQ(ReadTrajectory(request.out / "trajectory.txt", TrajectoryFormat::kTum).size(), 4u);
}

}  // namespace
}  // namespace tutti
