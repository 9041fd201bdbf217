// A run's loops against ground truth.
#include "apps/run/run_evaluation.h"

#include <gtest/gtest.h>

namespace tutti {
namespace {

// One accepted loop from frame 60 back to frame 0, at 30 Hz; the camera is where it was.
RunResult OneLoop() {
  RunResult result;
  result.rig.sensor = Sensor::kRgbd;
  result.frame_interval_s = 1.0 / 30;
  LoopRecord loop;
  loop.query = 60;
  loop.query_stamp_s = 12.0;
  loop.candidate = 0;
  loop.candidate_stamp_s = 10.0;
  loop.accepted = true;
  loop.S_candidate_query = Similarity();
  result.loops = {loop};
  return result;
}

// At rest; a tracking system that began a moment after the camera.
Trajectory TruthFrom(double first_s) {
  Trajectory truth;
  for (double t = first_s; t < 13; t += 0.01) truth.push_back({t, Pose()});
  return truth;
}

RunResult Judged(RunResult result, const Trajectory& truth) {
  EvaluateRun(truth, "truth.txt", result);
  return result;
}

TEST(RunEvaluation, ALoopToAFrameJustBeforeTheGroundTruthIsJudged) {
  const RunResult result = Judged(OneLoop(), TruthFrom(10.015));
  EXPECT_EQ(result.evaluation->loops_true, 1);
  EXPECT_EQ(result.evaluation->loops_unknown, 0);
  EXPECT_EQ(result.loops[0].correct, true);
}

TEST(RunEvaluation, ALoopToAFrameMoreThanHalfAFrameBeforeItIsNot) {
  const RunResult result = Judged(OneLoop(), TruthFrom(10.018));
  EXPECT_EQ(result.evaluation->loops_true, 0);
  EXPECT_EQ(result.evaluation->loops_unknown, 1);
  EXPECT_FALSE(result.loops[0].correct);
}

TEST(RunEvaluation, AFalseLoopThereIsFalse) {
  RunResult result = OneLoop();
  result.loops[0].S_candidate_query->translation = {0.3, 0, 0};
  result = Judged(result, TruthFrom(10.015));
  EXPECT_EQ(result.evaluation->loops_false, 1);
}

}  // namespace
}  // namespace tutti
