// `tutti run --inject-false-loops`: planted false loops leave the trajectory as it is, and loops.csv says
// why.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ReadAll;

constexpr int kPlanted = 15;

struct LoopLine {
  std::string reason;
  bool accepted = false, injected = false;
  double weight = -1;
};

// The reason is the first quoted cell, `accepted` stands before it; of the cells behind it `weight` is the
// eleventh and `injected` the next.
std::vector<LoopLine> ReadLoops(const fs::path& file) {
  std::istringstream in(ReadAll(file));
  std::string line;
  std::getline(in, line);
  EXPECT_THAT(line,
              HasSubstr("reason,verified,tx,ty,tz,qx,qy,qz,qw,scale,sigmas,weight,injected,probability,"));
  std::vector<LoopLine> loops;
  while (std::getline(in, line)) {
    LoopLine loop;
    const std::size_t begin = line.find('"') + 1, end = line.find('"', begin);
    std::istringstream behind(line.substr(end + 2));
    std::vector<std::string> after;
    for (std::string cell; std::getline(behind, cell, ',');) after.push_back(cell);
    loop.reason = line.substr(begin, end - begin);
    loop.accepted = line.at(begin - 3) == '1';
    loop.injected = after.at(11) == "1";
    loop.weight = ParseDouble(after.at(10)).value_or(-1);
    loops.push_back(loop);
  }
  return loops;
}

nlohmann::json RunTown(const fs::path& folder, const fs::path& out, int planted) {
  const fs::path config = folder / "town.yaml";
  // One member and one view per candidate: the time goes into the pose graph, not into the detector.
  testing::WriteAll(config,
                    "dataset: {type: kitti, sensor: stereo}\n"
                    "odometry: {features: 600}\n"
                    "loops: {members: [surf], verification: {max_hypotheses: 1, neighbours: 0}}\n");
  // Long enough for loops, true ones and planted ones.
  const fs::path town = testing::GeneratedDataset(testing::SmallStereoTownWithALoop(320, 160));
  const auto run = testing::RunTutti({"run", "--config", config, "--dataset", town, "--out", out,
                                      "--inject-false-loops", std::to_string(planted), "--quiet"});
  EXPECT_EQ(run.status, 0) << run.output;
  return nlohmann::json::parse(ReadAll(out / "summary.json"));
}

TEST(InjectFalseLoops, LeaveTheTrajectoryAndAreListedWithReasonAndWeight) {
  const fs::path folder = testing::FreshFolder();
  const nlohmann::json without = RunTown(folder, folder / "without", 0);
  const nlohmann::json with = RunTown(folder, folder / "with", kPlanted);

  const double ate = without["evaluation"]["slam"]["ate_rmse_m"].get<double>();
  EXPECT_NEAR(with["evaluation"]["slam"]["ate_rmse_m"].get<double>(), ate, 0.05 * ate);
  EXPECT_GT(with["loops"]["accepted"].get<int>(), 0) << "the true loops";
  EXPECT_EQ(without["loops"]["injected"], 0);
  EXPECT_EQ(with["loops"]["injected"], kPlanted);
  EXPECT_EQ(with["loops"]["injected_accepted"], 0);

  int listed = 0;
  for (const LoopLine& loop : ReadLoops(folder / "with" / "loops.csv")) {
    if (!loop.injected) continue;
    ++listed;
    EXPECT_FALSE(loop.accepted);
    EXPECT_FALSE(loop.reason.empty());
    EXPECT_GT(loop.weight, 0) << "the pose graph never had it: " << loop.reason;
    EXPECT_LE(loop.weight, 1);
  }
  EXPECT_EQ(listed, kPlanted);
}

}  // namespace
}  // namespace tutti
