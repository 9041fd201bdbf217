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

// Verified with place `verified`, which is a loop with this probability.
LoopObservation Accepted(int image, double probability, int verified) {
  return {image, 0.5, verified, true, verified, probability, true};
}
// Refused by geometry.
LoopObservation Refused(int image, double probability, int best) {
  return {image, 0.5, best, false, -1, probability, true};
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

// By probability: 6 (right) before 5 (right), and among the refused 7 (right) before 4 (wrong). H ranks 7, 4
// before 5, 6.
std::vector<LoopObservation> TwoAcceptedTwoRefused() {
  return {{4, 0.9, 1, false, -1, 0.1, true},
          {5, 0.5, 3, true, 0, 0.6, true},
          {6, 0.4, 1, true, 1, 0.8, true},
          {7, 0.95, 2, false, -1, 0.2, true}};
}

TEST(Evaluation, WhatGeometryRefusedIsInNoVerifiedRanking) {
  const LoopEvaluation result = EvaluateVerified(TwoAcceptedTwoRefused(), Truth());
  ASSERT_EQ(result.curve.size(), 2u);
  EXPECT_DOUBLE_EQ(result.curve[0].threshold, 0.8);  // the probability, not H
  EXPECT_DOUBLE_EQ(result.curve[1].threshold, 0.6);
  EXPECT_DOUBLE_EQ(result.recall_at_100_precision, 0.5);  // of 4: the refused 7 is missed
  EXPECT_DOUBLE_EQ(result.area_under_curve, 0.5);
  EXPECT_DOUBLE_EQ(result.best_f1, 2.0 / 3.0);
  EXPECT_EQ(result.found_at_100_precision, (std::vector<int>{5, 6}));
  EXPECT_DOUBLE_EQ(result.at_default_threshold.recall, 0.5);
  EXPECT_DOUBLE_EQ(result.at_default_threshold.precision, 1.0);
}

TEST(Evaluation, RankedPutsTheRefusedBehindTheAccepted) {
  const LoopEvaluation result = EvaluateRanked(TwoAcceptedTwoRefused(), Truth());
  EXPECT_DOUBLE_EQ(result.recall_at_100_precision, 0.75);  // the refused 7 still ranks above the refused 4
  EXPECT_DOUBLE_EQ(result.at_default_threshold.recall, 0.5);
  EXPECT_DOUBLE_EQ(result.at_default_threshold.precision, 1.0);
  EXPECT_DOUBLE_EQ(result.f1_at_default, EvaluateVerified(TwoAcceptedTwoRefused(), Truth()).f1_at_default);
  EXPECT_EQ(result.outcomes, EvaluateVerified(TwoAcceptedTwoRefused(), Truth()).outcomes);
  EXPECT_DOUBLE_EQ(EvaluatePosterior(TwoAcceptedTwoRefused(), Truth(), 0.1).recall_at_100_precision, 0.25);
}

TEST(Evaluation, EverythingRefusedIsAnEmptyVerifiedCurve) {
  const std::vector<LoopObservation> observations = {Refused(5, 0.9, 0), Refused(6, 0.8, 1)};
  const LoopEvaluation verified = EvaluateVerified(observations, Truth());
  EXPECT_TRUE(verified.curve.empty());
  EXPECT_EQ(verified.images, 2);
  EXPECT_DOUBLE_EQ(verified.recall_at_100_precision, 0);
  EXPECT_DOUBLE_EQ(verified.area_under_curve, 0);
  EXPECT_DOUBLE_EQ(verified.best_f1, 0);
  EXPECT_DOUBLE_EQ(verified.f1_at_default, 0);
  EXPECT_EQ(verified.calibration_images, 0);
  EXPECT_DOUBLE_EQ(verified.calibration_error, 0);
  EXPECT_EQ(std::count(verified.outcomes.begin(), verified.outcomes.end(), LoopOutcome::kMissed), 2);
  EXPECT_DOUBLE_EQ(EvaluateRanked(observations, Truth()).recall_at_100_precision, 0.5);
}

TEST(Evaluation, VerifiedImagesOfOneProbabilityAreOneRank) {
  const LoopEvaluation result = EvaluateVerified({Accepted(5, 0.9, 0), Accepted(6, 0.9, 4)}, Truth());
  ASSERT_EQ(result.curve.size(), 1u);
  EXPECT_DOUBLE_EQ(result.curve[0].precision, 0.5);
  EXPECT_DOUBLE_EQ(result.recall_at_100_precision, 0);
}

TEST(Evaluation, AnAcceptedImageWithoutAProbabilityHasNoRankButIsADecision) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const LoopEvaluation result =
      EvaluateVerified({Accepted(5, nan, 0), Accepted(6, 0.9, 1), Accepted(4, nan, 2)}, Truth());
  EXPECT_EQ(result.curve.size(), 1u);
  EXPECT_EQ(result.calibration_images, 1);
  EXPECT_EQ(result.true_positives, 2);
  EXPECT_EQ(result.false_positives, 1);
}

TEST(Evaluation, F1AtTheDefaultDecision) {
  // TP 1, FP 1, 4 rows: P = 1/2, R = 1/4, F1 = 2 (1/8) / (3/4) = 1/3.
  EXPECT_DOUBLE_EQ(EvaluateVerified({Accepted(5, 0.9, 0), Accepted(6, 0.9, 4)}, Truth()).f1_at_default,
                   1.0 / 3.0);
  EXPECT_DOUBLE_EQ(EvaluateVerified({}, Truth()).f1_at_default, 0);             // all missed
  EXPECT_DOUBLE_EQ(EvaluateVerified({}, LoopGroundTruth(3)).f1_at_default, 1);  // nothing to find
  EXPECT_DOUBLE_EQ(EvaluateVerified({Accepted(2, 0.9, 0)}, LoopGroundTruth(3)).f1_at_default, 0);
  LoopGroundTruth grey(3);
  grey.Set(2, 0, LoopLabel::kIgnore);
  EXPECT_DOUBLE_EQ(EvaluateVerified({Accepted(2, 0.9, 0)}, grey).f1_at_default, 1);  // nothing wrong was said
}

// Bin (0.8, 0.9]: p = 0.85 and 0.9, one right: |1/2 - 0.875| = 0.375, 2 of 4 images. Bin (0.1, 0.2]: p = 0.2,
// right: 0.8, 1 of 4. Bin [0, 0.1]: p = 0, wrong: 0.
TEST(Evaluation, CalibrationErrorByHand) {
  const std::vector<LoopObservation> observations = {
      Accepted(5, 0.85, 0), Accepted(6, 0.9, 4), Accepted(7, 0.2, 2),
      Accepted(4, 0.0, 1),  Accepted(9, 0.7, 0),  // on a grey cell
  };
  const LoopEvaluation result = EvaluateVerified(observations, Truth());
  EXPECT_EQ(result.calibration_images, 4);
  EXPECT_NEAR(result.calibration_error, 0.5 * 0.375 + 0.25 * 0.8, 1e-12);
  EXPECT_EQ(result.reliability[8].images, 2);
  EXPECT_NEAR(result.reliability[8].mean_probability, 0.875, 1e-12);
  EXPECT_DOUBLE_EQ(result.reliability[8].accuracy, 0.5);
  EXPECT_EQ(result.reliability[1].images, 1);
  EXPECT_EQ(result.reliability[0].images, 1);
  EXPECT_EQ(result.reliability[6].images, 0);
}

TEST(Evaluation, EachRankingIsCalibratedOverWhatItPutsForward) {
  const std::vector<LoopObservation> observations = {
      {5, 0.3, 0, true, 0, 1.0, true},     // accepted, right
      {6, 0.4, 1, false, -1, 0.25, true},  // proposed, right, refused
      {4, 0.5, 1, false, -1, 0.05, true},  // proposed, wrong, refused
      {7, 0.05, 2, false, -1, 0.9, false}  // not proposed
  };
  EXPECT_EQ(EvaluateVerified(observations, Truth()).calibration_images, 1);
  EXPECT_NEAR(EvaluateVerified(observations, Truth()).calibration_error, 0, 1e-12);
  EXPECT_EQ(EvaluateRanked(observations, Truth()).calibration_images, 3);
  EXPECT_NEAR(EvaluateRanked(observations, Truth()).calibration_error, (0.75 + 0.05) / 3, 1e-12);
  const LoopEvaluation posterior = EvaluatePosterior(observations, Truth(), 0.1);
  EXPECT_EQ(posterior.calibration_images, 3);
  EXPECT_NEAR(posterior.calibration_error, (0.7 + 0.6 + 0.5) / 3, 1e-12);
}

TEST(Evaluation, AProbabilityOutsideOfItsRangeIsInAnEndBin) {
  const LoopEvaluation result = EvaluateVerified({Accepted(5, 1.5, 0), Accepted(4, -0.5, 0)}, Truth());
  EXPECT_EQ(result.reliability[9].images, 1);
  EXPECT_EQ(result.reliability[0].images, 1);
  EXPECT_DOUBLE_EQ(result.calibration_error, 0);
}

TEST(Evaluation, ObserveTakesTheProbabilityFromTheDetector) {
  LoopResult result;
  result.query = 7;
  result.hypothesis = 0.4;
  result.probability = 0.8;
  result.best = 2;
  result.proposed = true;
  const LoopObservation refused = Observe(result);
  EXPECT_DOUBLE_EQ(refused.hypothesis, 0.4);
  EXPECT_DOUBLE_EQ(refused.probability, 0.8);
  EXPECT_TRUE(refused.proposed);
  EXPECT_EQ(refused.verified, -1);
  result.accepted = true;
  result.candidate = 3;
  EXPECT_EQ(Observe(result).verified, 3);
}

TEST(Evaluation, NothingAtAllIsNoDivisionByZero) {
  for (const LoopEvaluation& result :
       {EvaluateVerified({}, LoopGroundTruth(3)), EvaluateRanked({}, LoopGroundTruth(3)),
        EvaluatePosterior({}, LoopGroundTruth(), 0.1)}) {
    EXPECT_EQ(result.recall_at_100_precision, 0.0);
    EXPECT_EQ(result.best_f1, 0.0);
    EXPECT_EQ(result.at_default_threshold.precision, 1.0);
    EXPECT_EQ(result.calibration_images, 0);
    EXPECT_EQ(result.calibration_error, 0.0);
  }
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
      {7, 0.9, 2, false, -1},   // right, but refused
      {8, 0.9, 3, true, 1},     // on a grey cell of an image that has a loop
      {9, 0.9, 0, true, 0},     // on a grey cell of an image that has none
  };
  const LoopEvaluation result = EvaluateVerified(observations, truth);
  using Outcome = LoopOutcome;
  EXPECT_EQ(result.outcomes,
            (std::vector<Outcome>{Outcome::kNothing, Outcome::kTruePositive, Outcome::kFalsePositive,
                                  Outcome::kMissed, Outcome::kMissed, Outcome::kIgnored}));
  EXPECT_EQ(result.true_positives, 1);
  EXPECT_EQ(result.false_positives, 1);
  EXPECT_EQ(result.ignored, 2);
  EXPECT_DOUBLE_EQ(result.at_default_threshold.recall, 0.25);
}

TEST(Evaluation, TheRankedCurveSaysFromWhereOnImagesWereNotAccepted) {
  const LoopEvaluation result =
      EvaluateRanked({Accepted(5, 0.5, 0), Refused(6, 0.9, 1), Accepted(7, 0.4, 2)}, Truth());
  ASSERT_EQ(result.curve.size(), 3u);
  EXPECT_FALSE(result.curve[1].rejected);
  EXPECT_TRUE(result.curve[2].rejected);
  EXPECT_DOUBLE_EQ(result.curve[2].threshold, 0.9);
  EXPECT_FALSE(EvaluatePosterior({{5, 0.5, 0, false, -1}}, Truth(), 0.1).curve[0].rejected);
}

TEST(Evaluation, NoLoopInTheGroundTruthMeansRecallZero) {
  const LoopEvaluation result =
      EvaluateVerified({Accepted(5, 0.9, 0), Accepted(6, 0.8, 1)}, LoopGroundTruth(10));
  EXPECT_EQ(result.rows_with_loop, 0);
  EXPECT_DOUBLE_EQ(result.recall_at_100_precision, 0);
  EXPECT_DOUBLE_EQ(result.at_default_threshold.recall, 0);
  EXPECT_DOUBLE_EQ(result.at_default_threshold.precision, 0);
  EXPECT_DOUBLE_EQ(result.area_under_curve, 0);
  EXPECT_DOUBLE_EQ(result.best_f1, 0);
  EXPECT_EQ(result.false_positives, 2);
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
      EvaluateVerified({Accepted(25, 0.9, 3), Accepted(-1, 0.9, 3)}, LoopGroundTruth());
  EXPECT_EQ(result.false_positives, 2);
}

TEST(Evaluation, RecallOverTheViewThatSharesMost) {
  LoopGroundTruth truth = Truth();
  truth.least_overlap = 0.4;
  truth.best_views.resize(10);
  truth.best_views[5] = {0, 0.9, 5};
  truth.best_views[6] = {1, 0.55, 20};
  truth.best_views[7] = {2, 0.5, 44};
  truth.best_views[8] = {3, 0.42, 180};
  const LoopEvaluation e = EvaluateVerified({Accepted(5, 0.9, 0), Accepted(6, 0.8, 3), Accepted(7, 0.7, 2),
                                             Refused(8, 0.6, 3), Accepted(9, 0.9, 0)},
                                            truth);
  const auto rows = [](const std::vector<RecallPart>& parts) {
    std::vector<std::vector<double>> all;
    for (const RecallPart& p : parts)
      all.push_back({p.from, double(p.rows), double(p.found), double(p.found_at_100_precision)});
    return all;
  };
  using Rows = std::vector<std::vector<double>>;
  EXPECT_EQ(rows(e.recall_by_overlap), (Rows{{0.4, 4, 2, 1}, {0.5, 3, 2, 1}, {0.6, 1, 1, 1}, {0.7, 1, 1, 1}}))
      << "0.3 is no loop here";
  EXPECT_EQ(rows(e.recall_by_angle),
            (Rows{{0, 1, 1, 1}, {10, 0, 0, 0}, {20, 1, 0, 0}, {30, 1, 1, 0}, {45, 1, 0, 0}}));
  EXPECT_DOUBLE_EQ(e.recall_by_overlap[1].Recall(), 2.0 / 3);
  EXPECT_DOUBLE_EQ(e.recall_by_angle[1].Recall(), 0);
  EXPECT_TRUE(EvaluateVerified({Accepted(5, 0.9, 0)}, Truth()).recall_by_overlap.empty());
}

// A second word replaces the decision, wherever figures come from.
TEST(Evaluation, TheSecondWordIsTheDecisionThatCounts) {
  LoopResult result;
  result.query = 6;
  result.best = result.candidate = 3;
  result.proposed = true;
  result.reason = "probably not this place";
  LoopObservation observation = Observe(result);
  LateLoop late;
  late.query = 6;
  late.probability = 0.98;
  late.verification.candidate = 1;
  EXPECT_FALSE(TakeLate(late, &result)) << "neither accepted nor withdrawn";
  EXPECT_FALSE(TakeLate(late, &observation));
  late.accepted = true;
  EXPECT_TRUE(TakeLate(late, &result));
  EXPECT_TRUE(TakeLate(late, &observation));
  EXPECT_TRUE(result.accepted);
  EXPECT_EQ(result.reason, "");
  for (const LoopObservation& o : {Observe(result), observation}) {
    const LoopEvaluation e = EvaluateVerified({o}, Truth());
    EXPECT_EQ(e.true_positives, 1);
    EXPECT_DOUBLE_EQ(e.curve.at(0).threshold, 0.98);
  }
  late.accepted = false;
  late.withdrawn = true;
  EXPECT_TRUE(TakeLate(late, &result));
  EXPECT_TRUE(TakeLate(late, &observation));
  EXPECT_NE(result.reason.find("withdrawn"), std::string::npos);
  for (const LoopObservation& o : {Observe(result), observation})
    EXPECT_EQ(EvaluateVerified({o}, Truth()).outcomes.at(0), LoopOutcome::kMissed);
}

}  // namespace
}  // namespace tutti
