// How good a loop-closure detector was: one evaluator for every row of every table (loop-closure.md section
// 7).
#pragma once

#include <vector>

#include "tutti/loopclosure/detector.h"
#include "tutti/loopclosure/ground_truth.h"

namespace tutti {

/// What a detector said about one image. Images are rows and columns of the ground truth.
struct LoopObservation {
  int image = 0;          ///< row
  double hypothesis = 0;  ///< H, the score that images are ranked by
  int best = -1;          ///< argmax of the posterior, a column; -1: none
  bool accepted = false;  ///< passed the verification
  int verified = -1;      ///< the candidate that it passed with, a column
};

/// One threshold of a precision-recall curve: everything ranked down to here is taken as a loop.
struct PrecisionRecall {
  double precision = 1;     ///< TP / (TP + FP); 1 where nothing is taken
  double recall = 0;        ///< TP / rows with a loop; 0 where there are none
  double threshold = 0;     ///< H of the last one taken
  bool rejected = false;    ///< the last one taken was rejected by the verification (they rank last)
  int true_positives = 0;   ///< right places down to here
  int false_positives = 0;  ///< wrong places down to here
};

/// What became of one image at the default threshold.
enum class LoopOutcome {
  kNothing,        ///< no loop said, and there is none
  kTruePositive,   ///< the right place
  kFalsePositive,  ///< a wrong place, whether the image has a loop or not
  kIgnored,        ///< said a place on a grey cell, and the image has no loop
  kMissed          ///< the image has a loop, but none (or only one on a grey cell) was said
};

/// Everything that the tables print of one detector on one ground truth (loop-closure.md section 7).
struct LoopEvaluation {
  int images = 0;                           ///< observations
  int rows_with_loop = 0;                   ///< images that have at least one true loop: recall's denominator
  double recall_at_100_precision = 0;       ///< the largest recall before the first false positive
  double threshold_at_100_precision = 0;    ///< H of the last one before it; 0 if there is none
  std::vector<int> found_at_100_precision;  ///< the images that this recall counts, ascending
  double area_under_curve = 0;              ///< sum of precision x growth of recall
  double best_f1 = 0;                       ///< largest 2 P R / (P + R) along the curve, 0..1
  PrecisionRecall at_default_threshold;     ///< without any choice after the fact
  std::vector<PrecisionRecall> curve;       ///< one for each rank, the best first; equal H are one
  int true_positives = 0;                   ///< at the default threshold
  int false_positives = 0;                  ///< at the default threshold
  int ignored = 0;                          ///< at the default threshold: hypotheses on a grey cell
  std::vector<LoopOutcome> outcomes;        ///< one per observation, at the default threshold
};

/// Ranks by H alone and takes the posterior's best location: without verification. At the default threshold:
/// H >= threshold.
LoopEvaluation EvaluatePosterior(const std::vector<LoopObservation>& observations,
                                 const LoopGroundTruth& truth, double threshold);

/// Rejected images rank below all accepted ones; accepted ones count with the location that they were
/// verified with. At the default threshold: the accepted ones.
LoopEvaluation EvaluateVerified(const std::vector<LoopObservation>& observations,
                                const LoopGroundTruth& truth, double threshold);

/// A result of LoopDetector as an observation, where the query ids were the image numbers.
LoopObservation Observe(const LoopResult& result);

}  // namespace tutti
