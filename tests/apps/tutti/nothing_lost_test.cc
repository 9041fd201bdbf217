// `tutti run` that is killed, hung up on, or out of room, with a camera or a computer that fails in the
// middle: what was computed, now or earlier, is there.
#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <ctime>
#include <iomanip>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "apps/run/outputs.h"
#include "apps/run/runner.h"
#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;
using ::testing::StartsWith;

class NothingLost : public testing::TownTest {
 protected:
  std::vector<std::string> Arguments(std::vector<std::string> more = {}) const {
    more.insert(more.begin(), "--no-report");
    return testing::RunArguments(config_, testing::TinyTown(), out_, more);
  }
  testing::ProcessResult Run(const std::vector<std::string>& more = {}) const {
    return RunTutti(Arguments(more));
  }
  // Through a shell, which sets something before.
  testing::ProcessResult RunAfter(const std::string& command, const std::vector<std::string>& more) const {
    return testing::RunInShell(command + " \"$@\"", Arguments(more));
  }
  // Files of the result, without what is hidden or grows.
  std::map<std::string, std::string> Files() const {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::directory_iterator(out_)) {
      const std::string name = entry.path().filename();
      if (name[0] != '.' && name.find("_live") == std::string::npos) files[name] = ReadAll(entry.path());
    }
    return files;
  }
};

TEST_F(NothingLost, KilledARunLeavesTheEarlierResultAndItsPosesSoFar) {
  ASSERT_EQ(Run().status, 0);
  const auto earlier = Files();
  EXPECT_EQ(earlier.count("trajectory_online.txt"), 1u);
  for (const char* moment : {" 10%", " 50%", " 90%"}) {
    const auto run = testing::RunTuttiAndSignal(Arguments(), moment, SIGKILL);
    ASSERT_EQ(run.status, 128 + SIGKILL) << run.output;
    EXPECT_EQ(Files(), earlier) << moment;
  }
  // Both runs saw the same.
  const std::string live = ReadAll(out_ / "trajectory_live.txt");
  EXPECT_THAT(earlier.at("trajectory_online.txt"), StartsWith(live));
  EXPECT_GE(ReadTrajectory(out_ / "trajectory_live.txt", TrajectoryFormat::kTum).size(), 20u);
  EXPECT_THAT(ReadAll(out_ / "loops_live.csv"), StartsWith("query,candidate,"));
  const auto run = Run({"--end", "5"});  // what is left over is in nobody's way
  EXPECT_EQ(run.status, 0) << run.output;
  EXPECT_FALSE(fs::exists(out_ / "trajectory_live.txt"));
  EXPECT_EQ(ReadTrajectory(out_ / "trajectory.txt", TrajectoryFormat::kTum).size(), 5u);
}

TEST_F(NothingLost, KilledAtAnyTimeTheResultIsOneOfTheTwo) {
  ASSERT_EQ(Run({"--end", "3"}).status, 0);
  const std::string earlier = Files().at("trajectory.txt");
  ASSERT_EQ(Run({"--end", "4"}).status, 0);
  const std::string next = Files().at("trajectory.txt");
  ASSERT_EQ(Run({"--end", "3"}).status, 0);
  bool killed = true;
  for (int ms = 20; ms < 3000 && killed; ms += ms / 3 + 10) {
    const auto run =
        RunAfter("exec timeout -s KILL " + std::to_string(ms / 1000.0), {"--end", "4", "--quiet"});
    killed = run.status != 0;
    RunRequest request;
    request.out = out_;
    OpenOutputFolder(request, {});  // moves the rest if the kill came between two moves
    const auto now = Files();
    const std::string trajectory = now.at("trajectory.txt");
    EXPECT_TRUE(trajectory == earlier || trajectory == next) << ms << " ms: " << trajectory;
    const auto summary = nlohmann::json::parse(now.at("summary.json"));
    EXPECT_EQ(summary["frames"]["tracked"], trajectory == next ? 4 : 3) << ms << " ms";
    if (trajectory == next) break;
  }
}

TEST_F(NothingLost, HungUpOnItWritesWhatThereIs) {
  const auto run = testing::RunTuttiAndSignal(Arguments(), " 20%", SIGHUP);
  EXPECT_EQ(run.status, 130) << run.output;
  EXPECT_THAT(run.output, HasSubstr("interrupted"));
  const auto poses = ReadTrajectory(out_ / "trajectory.txt", TrajectoryFormat::kTum).size();
  EXPECT_GT(poses, 3u);
  EXPECT_LT(poses, static_cast<std::size_t>(testing::kTinyFrames));
}

TEST_F(NothingLost, WhatWasInterruptedDoesNotReplaceAFinishedResult) {
  ASSERT_EQ(Run({"--end", "4"}).status, 0);
  const auto earlier = Files();
  const auto run = testing::RunTuttiAndSignal(Arguments(), " 20%", SIGTERM);
  EXPECT_EQ(run.status, 130) << run.output;
  EXPECT_THAT(run.output, HasSubstr("is in " + (out_ / "unfinished").string()));
  const auto summary = testing::ReadJson(out_ / "unfinished" / "summary.json");
  EXPECT_FALSE(summary["finished"].get<bool>());
  EXPECT_GT(ReadTrajectory(out_ / "unfinished" / "trajectory.txt", TrajectoryFormat::kTum).size(), 4u);
  EXPECT_EQ(RunTutti({"collect", out_}).status, 0);
  fs::remove_all(out_ / "unfinished");
  EXPECT_EQ(Files(), earlier);
}

TEST_F(NothingLost, WhatHasNoRoomIsNamedAndTheRestIsWritten) {
  // 10 KB a file: enough for the trajectories, too little for the pictures.
  ExpectRefusal(RunAfter("ulimit -f 20; exec", {}),
                {"trajectory.png: File too large", "the rest is in " + out_.string()});
  EXPECT_EQ(ReadTrajectory(out_ / "trajectory.txt", TrajectoryFormat::kTum).size(),
            static_cast<std::size_t>(testing::kTinyFrames));
  EXPECT_TRUE(fs::exists(out_ / "summary.json"));
  EXPECT_FALSE(fs::exists(out_ / "trajectory.svg"));
  EXPECT_FALSE(fs::exists(out_ / "trajectory.png"));
}

TEST_F(NothingLost, AFileAtItsLimitEndsTheRunLikeAHangUp) {
  const auto run = RunAfter("ulimit -f 5; exec", {});  // 2.5 KB: the poses of some 25 frames
  EXPECT_EQ(run.status, 1) << run.output;
  EXPECT_THAT(run.output, AllOf(HasSubstr("trajectory_live.txt can't grow (File too large)"),
                                HasSubstr("interrupted after")));
  EXPECT_GE(ReadTrajectory(out_ / "trajectory_live.txt", TrajectoryFormat::kTum).size(), 20u);
}

TEST_F(NothingLost, ATraceThatCanNotBeWrittenCostsNothingElse) {
  ExpectRefusal(Run({"--end", "4", "--trace", "/dev/full"}), {"/dev/full", "No space left on device"});
  EXPECT_EQ(Files().size(), 10u);
}

TEST_F(NothingLost, ForeignFoldersAreRefusedAndStayAsTheyAre) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  auto arguments = Arguments();
  arguments[6] = data.string();
  const auto run = RunTutti(arguments);
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.output, AllOf(StartsWith("tutti: " + data.string()), HasSubstr("choose another --out")));
  EXPECT_FALSE(fs::exists(data / ".tutti-lock"));
  EXPECT_EQ(ReadAll(data / "poses.txt"), ReadAll(testing::TinyTown() / "poses.txt"));
}

TEST_F(NothingLost, TheReferenceIsNotReplaced) {
  ASSERT_EQ(Run({"--end", "4"}).status, 0);
  const auto earlier = Files();
  ExpectRefusal(Run({"--ground-truth", out_ / "trajectory.txt"}), {"trajectory.txt, which this run reads"});
  EXPECT_EQ(Files(), earlier);
}

TEST_F(NothingLost, ASecondRunOnOneFolderIsRefusedWithTheFirstOnesProcess) {
  const OutputFolder first(out_,
                           {[](const fs::path&) { return false; }, "summary.json", "version", {}, nullptr});
  ExpectRefusal(Run(), {"process " + std::to_string(getpid())});
}

TEST_F(NothingLost, ComparingIntoAForeignFolderIsRefused) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  const auto run =
      RunTutti({"compare", "--config", config_, "--dataset", data, "--out", data, "--runs", "1"});
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.output, AllOf(StartsWith("tutti: " + data.string()), HasSubstr("choose another --out")));
  EXPECT_FALSE(fs::exists(data / "odometry"));
}

TEST_F(NothingLost, KeepNumbersEarlierResults) {
  for (const char* end : {"3", "4", "5"}) ASSERT_EQ(Run({"--end", end, "--keep"}).status, 0);
  const auto poses = [this](const fs::path& folder) {
    return ReadTrajectory(out_ / folder / "trajectory.txt", TrajectoryFormat::kTum).size();
  };
  EXPECT_EQ(poses("1"), 3u);
  EXPECT_EQ(poses("2"), 4u);
  EXPECT_EQ(poses("."), 5u);
}

TEST_F(NothingLost, LivePosesAreTheSameForAnyNumberOfThreads) {
  ASSERT_EQ(Run({"--threads", "1"}).status, 0);
  const std::string one = ReadAll(out_ / "trajectory_online.txt");
  ASSERT_EQ(Run({"--threads", "2"}).status, 0);
  EXPECT_EQ(ReadAll(out_ / "trajectory_online.txt"), one);
}

class FaultsWhileRunning : public testing::TownTest {
 protected:
  std::vector<std::string> Arguments(const std::string& out,
                                     const std::vector<std::string>& more = {}) const {
    return testing::RunArguments(config_, town_, folder_ / out, more);
  }
  Trajectory Poses(const std::string& out) const {
    return ReadTrajectory(folder_ / out / "trajectory.txt", TrajectoryFormat::kTum);
  }
  void ExpectSameBytes(const char* a, const char* b) const {
    for (const char* file : {"trajectory.txt", "loops.csv", "graph.g2o"})
      EXPECT_EQ(ReadAll(folder_ / a / file), ReadAll(folder_ / b / file)) << file;
  }
  testing::ProcessResult InShell(const std::string& script, const std::string& out) const {
    return testing::RunInShell(script, Arguments(out));
  }

  const fs::path town_ = testing::CopyOfTinyTown(folder_ / "town");
};

TEST_F(FaultsWhileRunning, ADayBetweenTwoFramesIsSaidAndTheRunGoesOn) {
  std::istringstream times(testing::ReadAll(town_ / "times.txt"));
  std::ostringstream moved;
  double stamp_s = 0;
  for (int i = 0; times >> stamp_s; ++i)
    moved << std::fixed << std::setprecision(6) << stamp_s + (i < 15 ? 0 : 86400) << "\n";
  testing::WriteAll(town_ / "times.txt", moved.str());
  EXPECT_THAT(Done(testing::RunTutti(Arguments("out"))),
              HasSubstr("frame 15 comes 86400 s after the one before it"));
  EXPECT_EQ(Poses("out").size(), static_cast<std::size_t>(testing::kTinyFrames));
}

TEST_F(FaultsWhileRunning, AProcessThatIsStoppedForASecondGoesOnWithTheSameBytes) {
  ASSERT_EQ(testing::RunTutti(Arguments("quiet")).status, 0);
  Done(InShell(R"("$@" & run=$!; sleep 0.3; kill -STOP $run || exit 99; sleep 1; kill -CONT $run; wait $run)",
               "held"));
  ExpectSameBytes("held", "quiet");
}

// Waiting, writing checkpoints and keeping pace go by a clock that nobody can set.
TEST_F(FaultsWhileRunning, AClockThatIsSetBackAgainAndAgainChangesNothing) {
#ifdef TUTTI_SANITIZED
  GTEST_SKIP() << "a sanitizer has functions of its own in these places";
#endif
  void* const module = dlopen(TUTTI_CLOCK_SET_BACK, RTLD_NOW);
  ASSERT_NE(module, nullptr) << dlerror();
  const auto clock = reinterpret_cast<std::time_t (*)(std::time_t*)>(dlsym(module, "time"));
  const std::time_t first = clock(nullptr), second = clock(nullptr);
  EXPECT_LT(second, first - 80000) << "the clock is not set back";
  ASSERT_EQ(testing::RunTutti(Arguments("quiet")).status, 0);
  Done(InShell("LD_PRELOAD='" TUTTI_CLOCK_SET_BACK "' \"$@\" --checkpoint 0.1 --follow 1", "set_back"));
  ExpectSameBytes("set_back", "quiet");
}

TEST_F(FaultsWhileRunning, AFolderThatStallsIsWaitedFor) {
  const fs::path later = folder_ / "later";
  for (const char* camera : {"image_0", "image_1"}) {
    fs::create_directories(later / camera);
    for (int i = 20; i < testing::kTinyFrames; ++i) {
      std::ostringstream name;
      name << std::setw(6) << std::setfill('0') << i << ".png";
      fs::rename(town_ / camera / name.str(), later / camera / name.str());
    }
  }
  const std::string script =
      "\"$@\" --follow 6 & run=$!; sleep 3; kill -0 $run || exit 99; for c in 1 0; do mv '" + later.string() +
      "'/image_$c/* '" + town_.string() + "'/image_$c/; done; wait $run";
  const std::string run = Done(InShell(script, "out"));
  EXPECT_EQ(Poses("out").size(), static_cast<std::size_t>(testing::kTinyFrames)) << run;
}

}  // namespace
}  // namespace tutti
