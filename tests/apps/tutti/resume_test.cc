// `tutti run --checkpoint`, killed, and `tutti run --resume`: the results are those of a run that never
// stopped.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/small_town.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;

// What is the same however often a run was broken off.
constexpr const char* kResults[] = {
    "trajectory.txt", "trajectory_odometry.txt", "trajectory_online.txt", "keyframes.txt", "loops.csv",
    "graph.g2o"};

class Resume : public testing::TownTest {
 protected:
  std::vector<std::string> Arguments(const fs::path& out, const std::vector<std::string>& more) const {
    return testing::RunArguments(config_, testing::TinyTown(), out, more);
  }
  // Killed after so many seconds, unless it is at its end before.
  static testing::ProcessResult KilledAfter(double seconds, const std::vector<std::string>& arguments) {
    return testing::RunInShell("exec timeout -s KILL " + std::to_string(seconds) + " \"$@\"", arguments);
  }
  static void ExpectTheSame(const fs::path& a, const fs::path& b) {
    for (const char* name : kResults) EXPECT_EQ(ReadAll(a / name) == ReadAll(b / name), true) << name;
  }
  const fs::path whole_ = folder_ / "whole";
};

TEST_F(Resume, AfterThirtyKillsAtAnyMomentTheResultsAreTheSame) {
  SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
  const fs::path town = testing::GeneratedDataset(options);
  const std::vector<std::string> first = {
      "run",       "--config", town / "config.yaml", "--out", out_,
      "--dataset", town,       "--checkpoint",       "0",     "--no-report"};
  std::vector<std::string> never = first;
  never[4] = whole_.string();
  Done(RunTutti(never));
  ASSERT_GT(testing::ReadJson(whole_ / "summary.json")["loops"]["accepted"], 0);

  std::mt19937 random(1);
  auto run = KilledAfter(1.5, first);
  for (double seconds = 3; run.status != 0 && !fs::exists(out_ / "checkpoint.tutti"); seconds *= 2)
    run = KilledAfter(seconds, first);  // a busy machine may not have come to its first frame
  int kills = 0;
  for (; run.status != 0 && kills < 30; ++kills) {
    ASSERT_THAT(run.status, ::testing::AnyOf(137, 128 + SIGKILL)) << run.output;
    const double seconds = 0.05 + 1e-3 * static_cast<double>(random() % 1200);
    run = KilledAfter(seconds, {"run", "--resume", out_, "--no-report"});
  }
  if (run.status != 0) run = RunTutti({"run", "--resume", out_, "--no-report"});
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_GT(kills, 3);
  ExpectTheSame(out_, whole_);
  EXPECT_FALSE(fs::exists(out_ / "checkpoint.tutti"));
  EXPECT_TRUE(testing::ReadJson(out_ / "summary.json").contains("resumed_from_frame"));
  std::printf("  %d kills\n", kills);
}

TEST_F(Resume, AnInterruptedRunSaysHowToGoOn) {
  ASSERT_EQ(RunTutti(Arguments(whole_, {})).status, 0);
  const auto run = testing::RunTuttiAndSignal(Arguments(out_, {"--checkpoint", "3600"}), " 50%", SIGINT);
  EXPECT_EQ(run.status, 130) << run.output;
  EXPECT_THAT(run.output, HasSubstr("tutti run --resume " + out_.string()));
  ASSERT_TRUE(fs::exists(out_ / "checkpoint.tutti"));
  Done(RunTutti({"run", "--resume", out_}));
  ExpectTheSame(out_, whole_);
  EXPECT_TRUE(fs::exists(out_ / "report.html") || fs::exists(out_ / "report.json"));
}

TEST_F(Resume, AFinishedRunIsLeftAloneAndWhereThereIsNoneThatIsSaid) {
  ASSERT_EQ(RunTutti(Arguments(out_, {"--end", "5"})).status, 0);
  const std::string before = ReadAll(out_ / "summary.json");
  const auto finished = RunTutti({"run", "--resume", out_});
  EXPECT_EQ(finished.status, 0);
  EXPECT_THAT(finished.output, HasSubstr("has finished"));
  EXPECT_EQ(ReadAll(out_ / "summary.json"), before);
  ExpectRefusal(RunTutti({"run", "--resume", folder_ / "absent"}), {"no checkpoint.tutti", "--config"});
}

TEST_F(Resume, ADamagedCheckpointAndOptionsThatItHasAreRefused) {
  testing::RunTuttiAndSignal(Arguments(out_, {"--checkpoint", "0"}), " 50%", SIGKILL);
  const fs::path checkpoint = out_ / "checkpoint.tutti";
  ASSERT_TRUE(fs::exists(checkpoint));
  ExpectRefusal(RunTutti({"run", "--resume", out_, "--seed", "3"}), {"--seed can't be given with --resume"});
  std::string bytes = ReadAll(checkpoint);
  bytes[bytes.size() / 2] ^= 1;
  testing::WriteAll(checkpoint, bytes);
  ExpectRefusal(RunTutti({"run", "--resume", out_}), {checkpoint, "is damaged"});
}

// A copy without hidden files has no mark of tutti but the checkpoint.
TEST_F(Resume, ACopiedFolderGoesOnAndNothingElsewhereIsWritten) {
  const fs::path elsewhere = folder_ / "elsewhere.tutti", memory = folder_ / "memory.ltm",
                 copy = folder_ / "copy";
  testing::RunTuttiAndSignal(Arguments(out_, {"--checkpoint", "0", "--save-map", elsewhere, "--set",
                                              "loops.ltm_file=" + memory.string(), "--no-report"}),
                             " 50%", SIGKILL);
  ASSERT_TRUE(fs::exists(out_ / "checkpoint.tutti"));
  for (const char* rest : {"memory.ltm", "memory.ltm-wal", "memory.ltm-shm"}) fs::remove(folder_ / rest);
  fs::create_directory(copy);
  for (const char* name : {"checkpoint.tutti", "trajectory_live.txt", "loops_live.csv"})
    fs::copy(out_ / name, copy / name);
  const auto linked = folder_ / "linked";
  fs::create_directory(linked);
  fs::create_symlink(out_ / "checkpoint.tutti", linked / "checkpoint.tutti");
  ExpectRefusal(RunTutti({"run", "--resume", linked}), {"is a link"});
  const std::string resumed = Done(RunTutti({"run", "--resume", copy, "--no-report"}));
  EXPECT_TRUE(fs::exists(copy / "map.tutti"));
  EXPECT_FALSE(fs::exists(elsewhere));
  EXPECT_FALSE(fs::exists(memory));
  EXPECT_THAT(resumed, AllOf(HasSubstr("--save-map " + elsewhere.string()),
                             HasSubstr("--set loops.ltm_file=" + memory.string())));
  Done(RunTutti({"run", "--resume", out_, "--no-report", "--save-map", elsewhere, "--set",
                 "loops.ltm_file=" + memory.string()}));
  EXPECT_TRUE(fs::exists(elsewhere));
  EXPECT_TRUE(fs::exists(memory));
  ExpectTheSame(out_, copy);
}

TEST_F(Resume, EachRunLeavesAMapUnlessToldNotTo) {
  ASSERT_EQ(RunTutti(Arguments(out_, {"--end", "5"})).status, 0);
  EXPECT_TRUE(fs::exists(out_ / "map.tutti"));
  ASSERT_EQ(RunTutti(Arguments(out_, {"--end", "5", "--no-map"})).status, 0);
  EXPECT_FALSE(fs::exists(out_ / "map.tutti"));
  const fs::path elsewhere = folder_ / "my.map";
  ASSERT_EQ(RunTutti(Arguments(out_, {"--end", "5", "--save-map", elsewhere})).status, 0);
  EXPECT_FALSE(fs::exists(out_ / "map.tutti"));
  EXPECT_TRUE(fs::exists(elsewhere));
}

TEST_F(Resume, MapInfoTellsWhatIsInAMapAndChecksIt) {
  ASSERT_EQ(RunTutti(Arguments(out_, {"--end", "5"})).status, 0);
  const fs::path map = out_ / "map.tutti";
  EXPECT_THAT(Done(RunTutti({"map", "info", map, "--check"})),
              AllOf(HasSubstr("keyframes"), HasSubstr("stereo"), HasSubstr("checksums are right")));
  const auto info = nlohmann::json::parse(RunTutti({"map", "info", map, "--json"}).output);
  EXPECT_EQ(info["frames"], 5);
  EXPECT_GT(info["landmarks"], 50);
  EXPECT_EQ(info["run"]["dataset"], testing::TinyTown().string());
  std::string bytes = ReadAll(map);
  bytes[bytes.size() / 2] ^= 1;
  testing::WriteAll(map, bytes);
  EXPECT_EQ(RunTutti({"map", "info", map}).status, 0) << "the first section is as it was";
  ExpectRefusal(RunTutti({"map", "info", map, "--check"}), {"a checksum is wrong"});
}

}  // namespace
}  // namespace tutti
