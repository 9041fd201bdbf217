// `tutti compare-loops` on tables of `tutti loops`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tutti/loops_fixture.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::RunTutti;
using testing::WriteAll;

class CompareLoops : public testing::LoopsFixture {};

std::string SmallTable(double joint, double naive, double surf) {
  nlohmann::json table;
  table["best_single"] = {{"verified", "surf"}, {"posterior", "surf"}};
  for (const auto& [rule, recall] : std::vector<std::pair<std::string, double>>{
           {"joint", joint}, {"mean", surf}, {"naive", naive}, {"surf", surf}})
    table["rules"][rule] = {{"recall_at_100_precision", recall},
                            {"recall_at_100_precision_posterior", recall}};
  return table.dump();
}

TEST_F(CompareLoops, CompareLoopsIsThePairedTTestOverTheSets) {
  // joint - naive: 0.3, 0.2, 0.1, 0.3, 0.1: their mean 0.2, deviation 0.1, t = 0.2 / (0.1 / sqrt 5) = 4.4721.
  // With four degrees of freedom and x = t / sqrt(4 + t^2), p = 1 - x (3 - x^2) / 2 = 0.0111.
  const std::vector<std::pair<double, double>> recalls = {
      {0.8, 0.5}, {0.9, 0.7}, {0.7, 0.6}, {0.7, 0.4}, {0.9, 0.8}};
  const std::string out = (folder_ / "t.json").string();
  std::vector<std::string> arguments = {"compare-loops", "--out", out};
  for (const auto& [joint, naive] : recalls) {
    arguments.push_back((folder_ / (std::to_string(arguments.size()) + ".json")).string());
    WriteAll(arguments.back(), SmallTable(joint, naive, joint));
  }
  const auto run = RunTutti(arguments);
  ASSERT_EQ(run.status, 0) << run.output;
  const nlohmann::json tests = Json(out);
  ASSERT_EQ(tests.size(), 8u);
  EXPECT_EQ(tests[1]["a"], "joint");
  EXPECT_EQ(tests[1]["b"], "naive");
  EXPECT_EQ(tests[1]["sets"], 5);
  EXPECT_NEAR(tests[1]["t"].get<double>(), 4.4721, 1e-4);
  EXPECT_NEAR(tests[1]["p"].get<double>(), 0.0111, 1e-4);
  EXPECT_EQ(tests[2]["b"], "best single");
  EXPECT_EQ(tests[2]["p"], 1.0);  // no difference at all
  // Four sets are too few for a p.
  arguments.pop_back();
  const auto few = RunTutti(arguments);
  ASSERT_EQ(few.status, 0) << few.output;
  EXPECT_FALSE(Json(out)[1].contains("p"));
  EXPECT_THAT(few.output, HasSubstr("p is given from 5 sets on"));
}

TEST_F(CompareLoops, CompareLoopsRefusesWhatIsNoTable) {
  WriteAll(folder_ / "1.json", "[1, 2");
  WriteAll(folder_ / "2.json", R"({"rules": {}, "best_single": {}})");
  for (const char* name : {"1.json", "2.json", "none.json"}) {
    const auto run = RunTutti({"compare-loops", (folder_ / name).string()});
    EXPECT_EQ(run.status, 1) << run.output;
    EXPECT_THAT(run.output, HasSubstr(name));
  }
}

}  // namespace
}  // namespace tutti
