// What may happen to a camera or a computer in the middle of a run.
#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ctime>
#include <iomanip>
#include <sstream>
#include <string>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class FaultsWhileRunning : public ::testing::Test {
 protected:
  std::vector<std::string> Arguments(const std::string& out,
                                     const std::vector<std::string>& more = {}) const {
    return testing::RunArguments(testing::TinyConfig(folder_), town_, folder_ / out, more);
  }
  Trajectory Poses(const std::string& out) const {
    return ReadTrajectory(folder_ / out / "trajectory.txt", TrajectoryFormat::kTum);
  }
  // In a shell: "$@" is the run.
  testing::ProcessResult InShell(const std::string& script, const std::string& out) const {
    std::vector<std::string> words = {"-c", script, "sh", TUTTI_EXECUTABLE};
    for (const std::string& word : Arguments(out)) words.push_back(word);
    return testing::RunProgramAndSignal("/bin/sh", words, "", 0);
  }

  const fs::path folder_ = testing::FreshFolder(), town_ = testing::CopyOfTinyTown(folder_ / "town");
};

TEST_F(FaultsWhileRunning, ADayBetweenTwoFramesIsSaidAndTheRunGoesOn) {
  std::istringstream times(testing::ReadAll(town_ / "times.txt"));
  std::ostringstream moved;
  double stamp_s = 0;
  for (int i = 0; times >> stamp_s; ++i)
    moved << std::fixed << std::setprecision(6) << stamp_s + (i < 15 ? 0 : 86400) << "\n";
  testing::WriteAll(town_ / "times.txt", moved.str());
  const auto run = testing::RunTutti(Arguments("out"));
  EXPECT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("frame 15 comes 86400 s after the one before it"));
  EXPECT_EQ(Poses("out").size(), static_cast<std::size_t>(testing::kTinyFrames));
}

TEST_F(FaultsWhileRunning, AProcessThatIsStoppedForASecondGoesOnWithTheSameBytes) {
  ASSERT_EQ(testing::RunTutti(Arguments("quiet")).status, 0);
  const auto run = InShell(
      R"("$@" & run=$!; sleep 0.3; kill -STOP $run || exit 99; sleep 1; kill -CONT $run; wait $run)", "held");
  EXPECT_EQ(run.status, 0) << run.output;
  for (const char* file : {"trajectory.txt", "loops.csv", "graph.g2o"})
    EXPECT_EQ(testing::ReadAll(folder_ / "held" / file), testing::ReadAll(folder_ / "quiet" / file)) << file;
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
  const auto run =
      InShell("LD_PRELOAD='" TUTTI_CLOCK_SET_BACK "' \"$@\" --checkpoint 0.1 --follow 1", "set_back");
  EXPECT_EQ(run.status, 0) << run.output;
  for (const char* file : {"trajectory.txt", "loops.csv", "graph.g2o"})
    EXPECT_EQ(testing::ReadAll(folder_ / "set_back" / file), testing::ReadAll(folder_ / "quiet" / file))
        << file;
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
  const auto run = InShell(script, "out");
  EXPECT_EQ(run.status, 0) << run.output;
  EXPECT_EQ(Poses("out").size(), static_cast<std::size_t>(testing::kTinyFrames)) << run.output;
}

}  // namespace
}  // namespace tutti
