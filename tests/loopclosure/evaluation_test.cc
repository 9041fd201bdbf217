#include "tutti/loopclosure/evaluation.h"

#include <gtest/gtest.h>

namespace tutti {
namespace {

LoopGroundTruth Truth() {
  LoopGroundTruth truth(10);
  for (const int row : {5, 6, 7, 8}) truth.Set(row, row - 5, LoopLabel::kLoop);
  truth.Set(9, 0, LoopLabel::kIgnore);
  return truth;
}

TEST(Evaluation, RecallAtFullPrecisionStopsBeforeTheFirstFalsePositive) {
  const std::vector<LoopObservation> observations = {{5, 0.9, 0, false, -1},
                                                     {6, 0.8, 1, false, -1},
                                                     {4, 0.7, 1, false, -1},
                                                     {7, 0.6, 2, false, -1},
                                                     {8, 0.5, 0, false, -1}};
  const LoopEvaluation result = EvaluatePosterior(observations, Truth(), 0.65);
  EXPECT_EQ(result.rows_with_loop, 4);
  EXPECT_DOUBLE_EQ(result.recall_at_100_precision, 0.5);
  EXPECT_DOUBLE_EQ(result.at_default_threshold.precision, 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(result.at_default_threshold.recall, 0.5);
  EXPECT_DOUBLE_EQ(result.area_under_curve, 0.25 + 0.25 + 0.25 * 3.0 / 4.0);
  EXPECT_DOUBLE_EQ(result.best_f1, 2 * 0.75 * 0.75 / 1.5);
}

TEST(Evaluation, TiesStayTogether) {
  const std::vector<LoopObservation> observations = {{5, 0.9, 0, false, -1}, {6, 0.9, 0, false, -1}};
  EXPECT_DOUBLE_EQ(EvaluatePosterior(observations, Truth(), 0.1).recall_at_100_precision, 0.0);
}

TEST(Evaluation, AHypothesisOnAGreyCellIsDroppedButRowsStayInTheDenominator) {
  const std::vector<LoopObservation> observations = {
      {9, 0.95, 0, false, -1}, {5, 0.9, 0, false, -1}, {6, 0.2, -1, false, -1}};
  const LoopEvaluation result = EvaluatePosterior(observations, Truth(), 0.1);
  EXPECT_DOUBLE_EQ(result.recall_at_100_precision, 0.25);
  EXPECT_EQ(result.ignored, 1);
  EXPECT_EQ(result.false_positives, 0);
}

TEST(Evaluation, RejectedImagesRankBelowAllAcceptedOnes) {
  const std::vector<LoopObservation> observations = {
      {4, 0.9, 1, false, -1}, {5, 0.5, 3, true, 0}, {6, 0.4, 1, true, 1}, {7, 0.95, 2, false, -1}};
  const LoopEvaluation result = EvaluateVerified(observations, Truth(), 0.1);
  EXPECT_DOUBLE_EQ(result.recall_at_100_precision, 0.75);  // the rejected 7 still ranks above the rejected 4
  EXPECT_DOUBLE_EQ(result.at_default_threshold.recall, 0.5);
  EXPECT_DOUBLE_EQ(result.at_default_threshold.precision, 1.0);
  EXPECT_DOUBLE_EQ(EvaluatePosterior(observations, Truth(), 0.1).recall_at_100_precision, 0.25);
}

TEST(Evaluation, NothingAtAllIsNoDivisionByZero) {
  const LoopEvaluation result = EvaluateVerified({}, LoopGroundTruth(3), 0.1);
  EXPECT_EQ(result.recall_at_100_precision, 0.0);
  EXPECT_EQ(result.best_f1, 0.0);
  EXPECT_EQ(result.at_default_threshold.precision, 1.0);
}

}  // namespace
}  // namespace tutti
