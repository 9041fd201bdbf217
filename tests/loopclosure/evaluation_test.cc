#include "tutti/loopclosure/evaluation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

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

// Ranks by hand: 0.9 {5 right}, 0.7 {6 right, 4 wrong, 9 grey} tied, 0.5 {7 right}; 8 is never found.
TEST(Evaluation, TheCurveOfTiedRanksByHand) {
  const std::vector<LoopObservation> observations = {{7, 0.5, 2, false, -1}, {6, 0.7, 1, false, -1},
                                                     {4, 0.7, 3, false, -1}, {9, 0.7, 0, false, -1},
                                                     {5, 0.9, 0, false, -1}, {8, 0.1, -1, false, -1}};
  const LoopEvaluation result = EvaluatePosterior(observations, Truth(), 0.6);
  ASSERT_EQ(result.curve.size(), 3u);
  EXPECT_DOUBLE_EQ(result.curve[0].precision, 1.0);
  EXPECT_DOUBLE_EQ(result.curve[0].recall, 0.25);
  EXPECT_DOUBLE_EQ(result.curve[1].precision, 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(result.curve[1].recall, 0.5);
  EXPECT_DOUBLE_EQ(result.curve[1].threshold, 0.7);
  EXPECT_EQ(result.curve[1].true_positives, 2);
  EXPECT_EQ(result.curve[1].false_positives, 1);
  EXPECT_DOUBLE_EQ(result.curve[2].precision, 0.75);
  EXPECT_DOUBLE_EQ(result.curve[2].recall, 0.75);
  EXPECT_DOUBLE_EQ(result.area_under_curve, 0.25 * (1.0 + 2.0 / 3.0 + 0.75));
  EXPECT_DOUBLE_EQ(result.best_f1, 0.75);
  EXPECT_DOUBLE_EQ(result.threshold_at_100_precision, 0.9);
  EXPECT_EQ(result.found_at_100_precision, std::vector<int>{5});
  // The order of the images does not matter.
  const std::vector<LoopObservation> backwards(observations.rbegin(), observations.rend());
  EXPECT_DOUBLE_EQ(EvaluatePosterior(backwards, Truth(), 0.6).area_under_curve, result.area_under_curve);
}

TEST(Evaluation, EveryImageHasAnOutcomeAtTheDefaultThreshold) {
  LoopGroundTruth truth = Truth();
  truth.Set(8, 1, LoopLabel::kIgnore);
  const std::vector<LoopObservation> observations = {
      {4, 0.0, -1, false, -1},  // nothing said, nothing there
      {5, 0.9, 0, true, 0},     // right
      {6, 0.9, 1, true, 4},     // a loop, but elsewhere
      {7, 0.9, 2, false, -1},   // right, but rejected
      {8, 0.9, 3, true, 1},     // on a grey cell of an image that has a loop
      {9, 0.9, 0, true, 0},     // on a grey cell of an image that has none
  };
  const LoopEvaluation result = EvaluateVerified(observations, truth, 0.1);
  using Outcome = LoopOutcome;
  EXPECT_EQ(result.outcomes,
            (std::vector<Outcome>{Outcome::kNothing, Outcome::kTruePositive, Outcome::kFalsePositive,
                                  Outcome::kMissed, Outcome::kMissed, Outcome::kIgnored}));
  EXPECT_EQ(result.true_positives, 1);
  EXPECT_EQ(result.false_positives, 1);
  EXPECT_EQ(result.ignored, 2);
  EXPECT_DOUBLE_EQ(result.at_default_threshold.recall, 0.25);
}

TEST(Evaluation, TheCurveSaysFromWhereOnImagesWereRejected) {
  const LoopEvaluation result =
      EvaluateVerified({{5, 0.5, 0, true, 0}, {6, 0.9, 1, false, -1}, {7, 0.4, 2, true, 2}}, Truth(), 0.1);
  ASSERT_EQ(result.curve.size(), 3u);
  EXPECT_FALSE(result.curve[1].rejected);
  EXPECT_TRUE(result.curve[2].rejected);
  EXPECT_DOUBLE_EQ(result.curve[2].threshold, 0.9);
  EXPECT_FALSE(EvaluatePosterior({{5, 0.5, 0, false, -1}}, Truth(), 0.1).curve[0].rejected);
}

TEST(Evaluation, NoLoopInTheGroundTruthMeansRecallZero) {
  const LoopEvaluation result =
      EvaluateVerified({{5, 0.9, 0, true, 0}, {6, 0.8, 1, true, 1}}, LoopGroundTruth(10), 0.1);
  EXPECT_EQ(result.rows_with_loop, 0);
  EXPECT_DOUBLE_EQ(result.recall_at_100_precision, 0);
  EXPECT_DOUBLE_EQ(result.at_default_threshold.recall, 0);
  EXPECT_DOUBLE_EQ(result.at_default_threshold.precision, 0);
  EXPECT_DOUBLE_EQ(result.area_under_curve, 0);
  EXPECT_DOUBLE_EQ(result.best_f1, 0);
  EXPECT_EQ(result.false_positives, 2);
}

TEST(Evaluation, AllMissedIsAllInTheDenominator) {
  std::vector<LoopObservation> observations;
  for (int i = 0; i < 10; ++i) observations.push_back({i, 0, -1, false, -1});
  const LoopEvaluation result = EvaluateVerified(observations, Truth(), 0.1);
  EXPECT_EQ(result.rows_with_loop, 4);
  EXPECT_TRUE(result.curve.empty());
  EXPECT_TRUE(result.found_at_100_precision.empty());
  EXPECT_EQ(std::count(result.outcomes.begin(), result.outcomes.end(), LoopOutcome::kMissed), 4);
}

TEST(Evaluation, AHypothesisThatIsNoNumberHasNoRank) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const LoopEvaluation result =
      EvaluatePosterior({{5, nan, 0, false, -1}, {6, 0.5, 1, false, -1}}, Truth(), 0.1);
  EXPECT_EQ(result.curve.size(), 1u);
  EXPECT_DOUBLE_EQ(result.recall_at_100_precision, 0.25);
}

TEST(Evaluation, ImagesOutsideOfTheGroundTruthHaveNoLoop) {
  const LoopEvaluation result =
      EvaluateVerified({{25, 0.9, 3, true, 3}, {-1, 0.9, 3, true, 3}}, LoopGroundTruth(), 0.1);
  EXPECT_EQ(result.false_positives, 2);
}

}  // namespace
}  // namespace tutti
