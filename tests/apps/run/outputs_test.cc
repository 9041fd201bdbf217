// summary.json and loops.csv: what they say. Places of frames, by their stamps, those of earlier recordings
// by their numbers.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "apps/run/outputs.h"
#include "apps/run/run_observer.h"

namespace tutti {
namespace {

RunResult WithOneLoopOfWeight(double weight) {
  RunResult result;
  Loop loop;
  loop.query = 9;
  loop.candidate = 2;
  loop.verified = true;
  loop.state = LoopState::kInMap;
  loop.weight = weight;
  result.loops.push_back(loop);
  return result;
}

nlohmann::json ParsedSummary(const RunResult& result) { return nlohmann::json::parse(SummaryJson(result)); }

nlohmann::json Doubted(const RunResult& result) { return ParsedSummary(result)["loops"]["doubted"]; }

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
  EXPECT_EQ(ParsedSummary(result)["loops"]["accepted"], 1);
}

TEST(Summary, SaysHowGoodTheResultIsAndWhy) {
  RunResult result;
  result.frames_total = result.frames_tracked = 100;
  const auto health = [&] { return ParsedSummary(result)["health"]; };
  EXPECT_EQ(health()["word"], "good");
  EXPECT_TRUE(health()["reasons"].empty());
  result.frames_tracked = 94;
  EXPECT_EQ(health()["word"], "doubtful");
  ASSERT_EQ(health()["reasons"].size(), 1u);
  EXPECT_EQ(health()["signs"]["frames_posed"], 0.94);
  result.appearance_only = true;
  EXPECT_TRUE(health().is_null());
}

TEST(Summary, LoopsCsvSaysHowFarApartTheEndsOfALoopAre) {
  RunResult result = WithOneLoopOfWeight(1);
  EXPECT_NE(LoopsCsv(result).find(",distance_m,angle_deg,error_m,error_deg,correct,witness\n"),
            std::string::npos);
  EXPECT_NE(LoopsCsv(result).find(",,,,,\n"), std::string::npos);
  result.loop_errors = {{1.5, 30, 0.25, 2}};
  result.loops[0].correct = true;
  result.loops[0].witness = "the map";
  EXPECT_NE(LoopsCsv(result).find(",1.5000,30.0000,0.2500,2.0000,1,\"the map\"\n"), std::string::npos)
      << LoopsCsv(result);
}

TEST(Summary, TheLensSaysHowItWasFound) {
  RunResult result;
  EXPECT_FALSE(ParsedSummary(result).contains("lens"));
  result.lens = LensFound{-0.01, 0.002, 0.001, 0.003, {{40, -0.008, 0.001, 0.002, 0.004}}};
  result.height = HeightFound{0.07, 50, 0.9, 3, -0.01};
  const nlohmann::json height = ParsedSummary(result)["height"];
  EXPECT_EQ(height["measurements"], 50);
  EXPECT_EQ(height["log_scale"], -0.01);
  const nlohmann::json lens = ParsedSummary(result)["lens"];
  EXPECT_EQ(lens["k1"], -0.01);
  EXPECT_EQ(lens["k1_sigma"], 0.001);
  ASSERT_EQ(lens["steps"].size(), 1u);
  EXPECT_EQ(lens["steps"][0]["frame"], 40);
  EXPECT_EQ(lens["steps"][0]["k2_sigma"], 0.004);
}

TEST(Summary, TheGraphsProofIsThereIfItWasAskedFor) {
  RunResult result;
  EXPECT_FALSE(ParsedSummary(result).contains("graph"));
  result.config.run.certify = true;
  EXPECT_EQ(ParsedSummary(result)["graph"]["certificate"]["reason"], "no loop moved the map");
  KeyframeGraphProof proof;
  proof.best = GraphStart::kChordalOptimum;
  proof.better = true;
  proof.starts = {{GraphStart::kFile, 9, 4, false}, {GraphStart::kChordalOptimum, 3, 2, false}};
  proof.certificate.available = proof.certificate.certified = true;
  result.graph_proof = proof;
  const nlohmann::json graph = ParsedSummary(result)["graph"];
  EXPECT_EQ(graph["start"], "chordal optimum");
  EXPECT_EQ(graph["moved"], true);
  EXPECT_EQ(graph["starts"][1]["objective"], 2);
  EXPECT_EQ(graph["certificate"]["certified"], true);
}

Pose At(double x) {
  Pose pose;
  pose.translation.x() = x;
  return pose;
}

TEST(FramePlaces, OwnFramesAreFoundByStampAndThoseOfEarlierRecordingsByNumber) {
  RunResult result;
  result.trajectory = {{0.5, At(3)}};
  result.map = MapGoneOn{"map.tutti", std::vector<MapSession>(2), {}, {{7, At(5)}}};
  result.map->sessions.back().frame_offset = 100000;
  Similarity twice;
  twice.scale = 2;
  const FramePlaces places(result, twice);
  EXPECT_EQ(places.At(0.5)->x(), 6);
  EXPECT_FALSE(places.At(0.6));
  EXPECT_EQ(places.AtEnd(100003, 0.5)->x(), 6);
  EXPECT_EQ(places.AtEnd(7, 0.5)->x(), 10);  // whose stamp is of the other recording
  EXPECT_FALSE(places.AtEnd(8, 0.5));
}

TEST(FramePlaces, WithoutAMapAllFramesAreOwn) {
  RunResult result;
  result.trajectory = {{0.5, At(3)}};
  EXPECT_EQ(FramePlaces(result, {}).AtEnd(7, 0.5)->x(), 3);
}

TEST(RunState, AFrameIsOfTheRecordingWhoseNumbersItLiesIn) {
  const std::vector<Loop> loops;
  RunState state = {nullptr, loops};
  EXPECT_EQ(state.SessionOf(0), 0u);
  EXPECT_EQ(state.SessionOf(123456), 0u);
  state.sessions = {0, 100000, 300000};
  EXPECT_EQ(state.FirstFrame(), 300000);
  EXPECT_EQ(state.SessionOf(99999), 0u);
  EXPECT_EQ(state.SessionOf(100000), 1u);
  EXPECT_EQ(state.SessionOf(300007), 2u);
}

}  // namespace
}  // namespace tutti
