// summary.json: what it says of the loops.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "apps/run/outputs.h"

namespace tutti {
namespace {

RunResult WithOneLoopOfWeight(double weight) {
  RunResult result;
  LoopRecord loop;
  loop.query = 9;
  loop.candidate = 2;
  loop.verified = loop.accepted = true;
  loop.weight = weight;
  result.loops.push_back(loop);
  return result;
}

nlohmann::json Doubted(const RunResult& result) {
  return nlohmann::json::parse(SummaryJson(result))["loops"]["doubted"];
}

TEST(Summary, ALoopThatTheRobustLossHardlyBelievesIsDoubted) {
  EXPECT_TRUE(Doubted(WithOneLoopOfWeight(0.9)).empty());
  const nlohmann::json doubted = Doubted(WithOneLoopOfWeight(0.1));
  ASSERT_EQ(doubted.size(), 1u);
  EXPECT_EQ(doubted[0]["query"], 9);
  EXPECT_EQ(doubted[0]["reason"], "down-weighted by the robust loss");
}

TEST(Summary, WithoutPosesThereIsNoGraphThatCouldDoubtALoop) {
  RunResult result = WithOneLoopOfWeight(0);
  result.appearance_only = true;
  EXPECT_TRUE(Doubted(result).empty());
  EXPECT_EQ(nlohmann::json::parse(SummaryJson(result))["loops"]["accepted"], 1);
}

LoopRecord Recognised(double candidate_s, double query_s, bool accepted) {
  LoopRecord loop;
  loop.candidate_stamp_s = candidate_s;
  loop.query_stamp_s = query_s;
  loop.verified = true;
  loop.accepted = accepted;
  return loop;
}

RunResult WhereAllIsWell() {
  RunResult result;
  result.frames_total = result.frames_tracked = 100;
  for (int i = 0; i < 3; ++i) result.loops.push_back(Recognised(i, 60 + i, true));
  return result;
}

TEST(Summary, DoubtsARunWhoseMapContradictsMostLoops) {
  RunResult result = WhereAllIsWell();
  for (int i = 0; i < 9; ++i) result.loops.push_back(Recognised(i, i + 1, false));  // neighbours: no loops
  EXPECT_TRUE(nlohmann::json::parse(SummaryJson(result))["doubts"].empty());
  for (int i = 0; i < 6; ++i) result.loops.push_back(Recognised(i, 70 + i, false));
  const nlohmann::json doubts = nlohmann::json::parse(SummaryJson(result))["doubts"];
  ASSERT_EQ(doubts.size(), 1u);
  EXPECT_NE(doubts[0].get<std::string>().find("contradicts 6 of 9 loops"), std::string::npos) << doubts[0];
}

TEST(Summary, DoubtsARunThatLostManyFrames) {
  RunResult result = WhereAllIsWell();
  result.frames_tracked = 94;
  const nlohmann::json doubts = nlohmann::json::parse(SummaryJson(result))["doubts"];
  ASSERT_EQ(doubts.size(), 1u);
  EXPECT_NE(doubts[0].get<std::string>().find("only 94 of 100 frames"), std::string::npos) << doubts[0];
  result.bad.resize(3);  // what could not be read is counted elsewhere
  EXPECT_TRUE(nlohmann::json::parse(SummaryJson(result))["doubts"].empty());
}

TEST(Summary, TheLensSaysHowItWasFound) {
  RunResult result;
  EXPECT_FALSE(nlohmann::json::parse(SummaryJson(result)).contains("lens"));
  result.lens = LensFound{-0.01, 0.002, 0.001, 0.003, {{40, -0.008, 0.001, 0.002, 0.004}}};
  const nlohmann::json lens = nlohmann::json::parse(SummaryJson(result))["lens"];
  EXPECT_EQ(lens["k1"], -0.01);
  EXPECT_EQ(lens["k1_sigma"], 0.001);
  ASSERT_EQ(lens["steps"].size(), 1u);
  EXPECT_EQ(lens["steps"][0]["frame"], 40);
  EXPECT_EQ(lens["steps"][0]["k2_sigma"], 0.004);
}

TEST(Summary, TheGraphsProofIsThereIfItWasAskedFor) {
  RunResult result;
  EXPECT_FALSE(nlohmann::json::parse(SummaryJson(result)).contains("graph"));
  result.config.run.certify = true;
  EXPECT_EQ(nlohmann::json::parse(SummaryJson(result))["graph"]["certificate"]["reason"],
            "no loop moved the map");
  KeyframeGraphProof proof;
  proof.best = GraphStart::kChordalOptimum;
  proof.better = true;
  proof.starts = {{GraphStart::kFile, 9, 4, false}, {GraphStart::kChordalOptimum, 3, 2, false}};
  proof.certificate.available = proof.certificate.certified = true;
  result.graph_proof = proof;
  const nlohmann::json graph = nlohmann::json::parse(SummaryJson(result))["graph"];
  EXPECT_EQ(graph["start"], "chordal optimum");
  EXPECT_EQ(graph["moved"], true);
  EXPECT_EQ(graph["starts"][1]["objective"], 2);
  EXPECT_EQ(graph["certificate"]["certified"], true);
}

}  // namespace
}  // namespace tutti
