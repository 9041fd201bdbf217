// How good a loop-closure detector was: one evaluator for every row of every table (loop-closure.md section
// 7).
#pragma once

#include <array>
#include <vector>

#include "tutti/loopclosure/detector.h"
#include "tutti/loopclosure/ground_truth.h"

#pragma GCC visibility push(default)
namespace tutti {

/// What a detector said about one image. Images are rows and columns of the ground truth.
struct LoopObservation {
  int image = 0;          ///< row
  double hypothesis = 0;  ///< H, the score that images are ranked by where the posterior stands alone
  int best = -1;          ///< argmax of the posterior, a column; -1: none
  bool accepted = false;  ///< passed the verification
  int verified = -1;      ///< the candidate that it passed with, a column
  double probability =
      0;  ///< that the place (verified, else best) is a loop, 0..1: the score of verified ones
  bool proposed = false;  ///< went to verification
};

/// One threshold of a precision-recall curve: everything ranked down to here is taken as a loop.
struct PrecisionRecall {
  double precision = 1;     ///< TP / (TP + FP); 1 where nothing is taken
  double recall = 0;        ///< TP / rows with a loop; 0 where there are none
  double threshold = 0;     ///< score of the last one taken
  bool rejected = false;    ///< EvaluateRanked: the last one taken was not accepted (they rank last)
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

/// One bin of a reliability diagram (DeGroot and Fienberg, The Statistician 32, 1983): do the images that
/// were given this probability show loops that often?
struct ReliabilityBin {
  int images = 0;               ///< whose probability p lies in the bin
  double mean_probability = 0;  ///< their mean p, 0..1; 0 if there are none
  double accuracy = 0;          ///< share of them whose place is a true loop, 0..1; 0 if there are none
};

/// Recall over some of the images with a loop, by the earlier view that shares most with each.
struct RecallPart {
  /// The images whose best view has from <= overlap (to: 1), or from <= angle < to [deg].
  double from = 0;
  double to = 0;                   ///< see `from`
  int rows = 0;                    ///< so many images
  int found = 0;                   ///< of these: the right place was said, at the default threshold
  int found_at_100_precision = 0;  ///< of these: before the first false positive

  /// 0..1; 0 where there are no rows.
  double Recall() const { return rows > 0 ? static_cast<double>(found) / rows : 0.0; }
  /// 0..1; 0 where there are no rows.
  double RecallAt100Precision() const {
    return rows > 0 ? static_cast<double>(found_at_100_precision) / rows : 0.0;
  }
};

/// Everything that the tables print of one detector on one ground truth (loop-closure.md section 7).
struct LoopEvaluation {
  int images = 0;                           ///< observations
  int rows_with_loop = 0;                   ///< images that have at least one true loop: recall's denominator
  double recall_at_100_precision = 0;       ///< the largest recall before the first false positive
  double threshold_at_100_precision = 0;    ///< score of the last one before it; 0 if there is none
  std::vector<int> found_at_100_precision;  ///< the images that this recall counts, ascending
  double area_under_curve = 0;              ///< sum of precision x growth of recall
  double best_f1 = 0;                       ///< largest 2 P R / (P + R) along the curve, 0..1
  PrecisionRecall at_default_threshold;     ///< without any choice after the fact
  /// F1 = 2 P R / (P + R) at the default decision (van Rijsbergen, Information Retrieval, 1979), 0..1: as
  /// 2 TP / (2 TP + FP + missed). 1 where there is nothing to find and nothing wrong was said; 0 where there
  /// is something to find and nothing was said.
  double f1_at_default = 0;
  /// Expected calibration error (Naeini et al., AAAI 2015; Guo et al., ICML 2017), 0..1: the sum over the
  /// bins b of n_b / n |accuracy_b - mean probability_b|. Places on ignored cells and probabilities that are
  /// no numbers are dropped. Means nothing without calibration_images, n: by chance alone it is about
  /// sqrt(p (1 - p) / n) where all have one probability p. 0 if n is 0.
  double calibration_error = 0;
  int calibration_images = 0;                  ///< n: the images that calibration_error is over
  static constexpr int kReliabilityBins = 10;  ///< of equal width
  /// Bin b holds b / 10 < p <= (b + 1) / 10; the first one p = 0, too.
  std::array<ReliabilityBin, kReliabilityBins> reliability;
  std::vector<PrecisionRecall> curve;  ///< one for each rank, the best first; equal scores are one
  int true_positives = 0;              ///< at the default threshold
  int false_positives = 0;             ///< at the default threshold
  int ignored = 0;                     ///< at the default threshold: hypotheses on a grey cell
  std::vector<LoopOutcome> outcomes;   ///< one per observation, at the default threshold
  /// Only by overlap (LoopGroundTruth::best_views): from 0.3, 0.4, 0.5, 0.6, 0.7 on, those that are loops.
  std::vector<RecallPart> recall_by_overlap;
  /// Only by overlap: between 0, 10, 20, 30, 45 and 180 degrees.
  std::vector<RecallPart> recall_by_angle;
};

/// Ranks by H alone and takes the posterior's best location: without verification. At the default decision:
/// H >= threshold. Calibration: H of those.
LoopEvaluation EvaluatePosterior(const std::vector<LoopObservation>& observations,
                                 const LoopGroundTruth& truth, double threshold);

/// What the detector says: the accepted images alone, with the location that they were verified with, ranked
/// by probability. An image that was not accepted is in no ranking; if it has a loop, it is missed, at any
/// threshold. At the default decision: the accepted ones, whatever their score. Calibration: probability of
/// those.
LoopEvaluation EvaluateVerified(const std::vector<LoopObservation>& observations,
                                const LoopGroundTruth& truth);

/// What the scores know beyond the decision: as EvaluateVerified, and behind all accepted images those that
/// were not, with the posterior's best location. Nobody may close a loop with these: not a figure of the
/// detector. At the default decision: the accepted ones. Calibration: probability of all that were proposed
/// or accepted.
LoopEvaluation EvaluateRanked(const std::vector<LoopObservation>& observations, const LoopGroundTruth& truth);

/// A result of LoopDetector as an observation, where the query ids were the image numbers.
LoopObservation Observe(const LoopResult& result);

/// Makes the result of an image what was decided later (LoopResult::late of another image's result): figures
/// are of final decisions. Returns false, and nothing changes, where the decision stays.
bool TakeLate(const LateLoop& late, LoopResult* result);
/// Does so for what Observe has made of it.
bool TakeLate(const LateLoop& late, LoopObservation* observation);

}  // namespace tutti
#pragma GCC visibility pop
