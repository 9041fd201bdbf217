#include "tutti/loopclosure/evaluation.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <tuple>

#include "core/numbers.h"

namespace tutti {
namespace {

struct Ranked {
  int image = -1;
  bool says = false;      // there is a location and a finite score; else it is in no ranking
  bool rejected = false;  // ranks last
  double score = 0;
  LoopLabel label = LoopLabel::kNone;
  bool taken = false;       // at the default decision
  bool calibrated = false;  // the score is to be a probability
};

bool SameRank(const Ranked& a, const Ranked& b) { return a.rejected == b.rejected && a.score == b.score; }

PrecisionRecall Rates(int true_positives, int false_positives, int rows) {
  PrecisionRecall rates;
  rates.true_positives = true_positives;
  rates.false_positives = false_positives;
  const int taken = true_positives + false_positives;
  if (taken > 0) rates.precision = static_cast<double>(true_positives) / taken;
  if (rows > 0) rates.recall = static_cast<double>(true_positives) / rows;
  return rates;
}

LoopOutcome OutcomeOf(const Ranked& r, bool has_loop) {
  if (r.taken && r.label == LoopLabel::kLoop) return LoopOutcome::kTruePositive;
  if (r.taken && r.label == LoopLabel::kNone) return LoopOutcome::kFalsePositive;
  if (has_loop) return LoopOutcome::kMissed;
  return r.taken ? LoopOutcome::kIgnored : LoopOutcome::kNothing;
}

// 2 P R / (P + R) by its counts, which need no case for P + R = 0.
double F1(int true_positives, int false_positives, int rows) {
  const int sum = rows + true_positives + false_positives;  // 2 TP + FP + missed
  return sum > 0 ? 2.0 * true_positives / sum : 1.0;
}

// The counts at the default decision.
void Count(const std::vector<Ranked>& ranked, const LoopGroundTruth& truth, LoopEvaluation& result) {
  for (const Ranked& r : ranked) {
    result.outcomes.push_back(OutcomeOf(r, truth.HasLoop(r.image)));
    if (!r.taken) continue;
    if (r.label == LoopLabel::kLoop) ++result.true_positives;
    if (r.label == LoopLabel::kNone) ++result.false_positives;
    if (r.label == LoopLabel::kIgnore) ++result.ignored;
  }
  result.at_default_threshold = Rates(result.true_positives, result.false_positives, result.rows_with_loop);
  result.f1_at_default = F1(result.true_positives, result.false_positives, result.rows_with_loop);
}

void Calibrate(const std::vector<Ranked>& ranked, LoopEvaluation& result) {
  constexpr int kBins = LoopEvaluation::kReliabilityBins;
  for (const Ranked& r : ranked) {
    if (!r.says || !r.calibrated || r.label == LoopLabel::kIgnore) continue;
    const double p = std::clamp(r.score, 0.0, 1.0);
    const int bin = std::max(0, static_cast<int>(std::ceil(p * kBins)) - 1);
    ReliabilityBin& b = result.reliability[internal::Index(bin)];
    ++b.images;
    b.mean_probability += p;
    b.accuracy += r.label == LoopLabel::kLoop ? 1 : 0;
    ++result.calibration_images;
  }
  for (ReliabilityBin& b : result.reliability) {
    if (b.images == 0) continue;
    result.calibration_error += std::abs(b.accuracy - b.mean_probability) / result.calibration_images;
    b.mean_probability /= b.images;
    b.accuracy /= b.images;
  }
}

// The curve and what is read from it.
void Sweep(std::vector<Ranked> ranked, LoopEvaluation& result) {
  ranked.erase(std::remove_if(ranked.begin(), ranked.end(), [](const Ranked& r) { return !r.says; }),
               ranked.end());
  std::stable_sort(ranked.begin(), ranked.end(), [](const Ranked& a, const Ranked& b) {
    return std::make_tuple(a.rejected, -a.score) < std::make_tuple(b.rejected, -b.score);
  });
  int true_positives = 0;
  int false_positives = 0;
  double recall_before = 0.0;
  std::vector<int>& found = result.found_at_100_precision;
  std::size_t found_count = 0;
  for (std::size_t i = 0; i < ranked.size(); ++i) {
    if (ranked[i].label == LoopLabel::kLoop) ++true_positives;
    if (ranked[i].label == LoopLabel::kNone) ++false_positives;
    if (ranked[i].label == LoopLabel::kLoop) found.push_back(ranked[i].image);
    if (i + 1 < ranked.size() && SameRank(ranked[i], ranked[i + 1])) continue;  // ties stay together
    PrecisionRecall point = Rates(true_positives, false_positives, result.rows_with_loop);
    point.threshold = ranked[i].score;
    point.rejected = ranked[i].rejected;
    if (false_positives == 0) {
      result.recall_at_100_precision = point.recall;
      result.threshold_at_100_precision = point.threshold;
      found_count = found.size();
    }
    result.area_under_curve += point.precision * (point.recall - recall_before);
    recall_before = point.recall;
    const double sum = point.precision + point.recall;
    if (sum > 0) result.best_f1 = std::max(result.best_f1, 2 * point.precision * point.recall / sum);
    result.curve.push_back(point);
  }
  found.resize(found_count);
  std::sort(found.begin(), found.end());
}

void CountPart(const std::vector<Ranked>& ranked, const LoopGroundTruth& truth, const LoopEvaluation& result,
               const std::function<bool(const BestView&)>& belongs, RecallPart& part) {
  for (std::size_t i = 0; i < ranked.size(); ++i) {
    const int image = ranked[i].image;
    if (image < 0 || image >= truth.size() || !truth.HasLoop(image)) continue;
    if (!belongs(truth.best_views[internal::Index(image)])) continue;
    const std::vector<int>& found = result.found_at_100_precision;
    ++part.rows;
    part.found += result.outcomes[i] == LoopOutcome::kTruePositive ? 1 : 0;
    part.found_at_100_precision += std::binary_search(found.begin(), found.end(), image) ? 1 : 0;
  }
}

// How much harder it becomes with less in common, and with the angle.
void CountParts(const std::vector<Ranked>& ranked, const LoopGroundTruth& truth, LoopEvaluation& result) {
  if (truth.best_views.empty()) return;
  for (const double from : {0.3, 0.4, 0.5, 0.6, 0.7}) {
    if (from < truth.least_overlap - 1e-9) continue;
    RecallPart part{from, 1};
    CountPart(
        ranked, truth, result, [&](const BestView& view) { return view.overlap >= from; }, part);
    result.recall_by_overlap.push_back(part);
  }
  constexpr std::array<double, 6> kAngles = {0, 10, 20, 30, 45, 180};
  for (std::size_t k = 0; k + 1 < kAngles.size(); ++k) {
    RecallPart part{kAngles[k], kAngles[k + 1]};
    const auto belongs = [&](const BestView& view) {
      return view.angle_deg >= part.from && (view.angle_deg < part.to || part.to == kAngles.back());
    };
    CountPart(ranked, truth, result, belongs, part);
    result.recall_by_angle.push_back(part);
  }
}

LoopEvaluation Evaluate(const std::vector<Ranked>& ranked, const LoopGroundTruth& truth) {
  LoopEvaluation result;
  result.images = static_cast<int>(ranked.size());
  result.rows_with_loop = truth.RowsWithLoop();
  Count(ranked, truth, result);
  Calibrate(ranked, result);
  Sweep(ranked, result);
  CountParts(ranked, truth, result);
  return result;
}

// The accepted images rank first, and then the others, if they are ranked at all.
LoopEvaluation EvaluateDecisions(const std::vector<LoopObservation>& observations,
                                 const LoopGroundTruth& truth, bool with_rejected) {
  std::vector<Ranked> ranked;
  for (const LoopObservation& o : observations) {
    const int location = o.accepted ? o.verified : o.best;
    const bool says = (o.accepted || with_rejected) && location >= 0 && std::isfinite(o.probability);
    ranked.push_back({o.image, says, !o.accepted, o.probability, truth.At(o.image, location),
                      o.accepted && location >= 0, o.accepted || o.proposed});
  }
  return Evaluate(ranked, truth);
}

}  // namespace

LoopEvaluation EvaluatePosterior(const std::vector<LoopObservation>& observations,
                                 const LoopGroundTruth& truth, double threshold) {
  std::vector<Ranked> ranked;
  for (const LoopObservation& o : observations) {
    const bool says = o.best >= 0 && std::isfinite(o.hypothesis);
    const bool taken = says && o.hypothesis >= threshold;
    ranked.push_back({o.image, says, false, o.hypothesis, truth.At(o.image, o.best), taken, taken});
  }
  return Evaluate(ranked, truth);
}

LoopEvaluation EvaluateVerified(const std::vector<LoopObservation>& observations,
                                const LoopGroundTruth& truth) {
  return EvaluateDecisions(observations, truth, false);
}

LoopEvaluation EvaluateRanked(const std::vector<LoopObservation>& observations,
                              const LoopGroundTruth& truth) {
  return EvaluateDecisions(observations, truth, true);
}

LoopObservation Observe(const LoopResult& result) {
  LoopObservation observation;
  observation.image = static_cast<int>(result.query);
  observation.hypothesis = result.hypothesis;
  observation.probability = result.probability;
  observation.best = static_cast<int>(result.best);
  observation.proposed = result.proposed;
  observation.accepted = result.accepted;
  observation.verified = result.accepted ? static_cast<int>(result.candidate) : -1;
  return observation;
}

bool TakeLate(const LateLoop& late, LoopResult* result) {
  if (!late.accepted && !late.withdrawn) return false;
  result->accepted = late.accepted;
  result->candidate = late.verification.candidate;
  result->probability = late.probability;
  result->verification = late.verification;
  result->reason = late.accepted ? "" : "withdrawn: the images after it speak against it";
  return true;
}

bool TakeLate(const LateLoop& late, LoopObservation* observation) {
  if (!late.accepted && !late.withdrawn) return false;
  observation->accepted = late.accepted;
  observation->probability = late.probability;
  observation->verified = late.accepted ? static_cast<int>(late.verification.candidate) : -1;
  return true;
}

}  // namespace tutti
