#include "tutti/loopclosure/evaluation.h"

#include <algorithm>
#include <tuple>

namespace tutti {
namespace {

struct Ranked {
  bool accepted = false;  // ranks first
  double hypothesis = 0;
  LoopLabel label = LoopLabel::kNone;
  bool taken = false;  // at the default threshold
};

bool SameRank(const Ranked& a, const Ranked& b) {
  return a.accepted == b.accepted && a.hypothesis == b.hypothesis;
}

PrecisionRecall Rates(int true_positives, int false_positives, int rows) {
  PrecisionRecall rates;
  const int taken = true_positives + false_positives;
  if (taken > 0) rates.precision = static_cast<double>(true_positives) / taken;
  if (rows > 0) rates.recall = static_cast<double>(true_positives) / rows;
  return rates;
}

LoopEvaluation Evaluate(std::vector<Ranked> ranked, int images, int rows) {
  LoopEvaluation result;
  result.images = images;
  result.rows_with_loop = rows;
  for (const Ranked& r : ranked) {
    if (!r.taken) continue;
    if (r.label == LoopLabel::kLoop) ++result.true_positives;
    if (r.label == LoopLabel::kNone) ++result.false_positives;
    if (r.label == LoopLabel::kIgnore) ++result.ignored;
  }
  result.at_default_threshold = Rates(result.true_positives, result.false_positives, rows);

  std::stable_sort(ranked.begin(), ranked.end(), [](const Ranked& a, const Ranked& b) {
    return std::make_tuple(a.accepted, a.hypothesis) > std::make_tuple(b.accepted, b.hypothesis);
  });
  int true_positives = 0;
  int false_positives = 0;
  double recall_before = 0.0;
  for (std::size_t i = 0; i < ranked.size(); ++i) {
    if (ranked[i].label == LoopLabel::kLoop) ++true_positives;
    if (ranked[i].label == LoopLabel::kNone) ++false_positives;
    if (i + 1 < ranked.size() && SameRank(ranked[i], ranked[i + 1])) continue;  // ties stay together
    PrecisionRecall point = Rates(true_positives, false_positives, rows);
    point.threshold = ranked[i].hypothesis;
    if (false_positives == 0) result.recall_at_100_precision = point.recall;
    result.area_under_curve += point.precision * (point.recall - recall_before);
    recall_before = point.recall;
    const double sum = point.precision + point.recall;
    if (sum > 0) result.best_f1 = std::max(result.best_f1, 2 * point.precision * point.recall / sum);
    result.curve.push_back(point);
  }
  return result;
}

}  // namespace

LoopEvaluation EvaluatePosterior(const std::vector<LoopObservation>& observations,
                                 const LoopGroundTruth& truth, double threshold) {
  std::vector<Ranked> ranked;
  for (const LoopObservation& o : observations) {
    if (o.best < 0) continue;
    ranked.push_back({false, o.hypothesis, truth.At(o.image, o.best), o.hypothesis >= threshold});
  }
  return Evaluate(std::move(ranked), static_cast<int>(observations.size()), truth.RowsWithLoop());
}

LoopEvaluation EvaluateVerified(const std::vector<LoopObservation>& observations,
                                const LoopGroundTruth& truth, double threshold) {
  std::vector<Ranked> ranked;
  for (const LoopObservation& o : observations) {
    const int location = o.accepted ? o.verified : o.best;
    if (location < 0) continue;
    ranked.push_back(
        {o.accepted, o.hypothesis, truth.At(o.image, location), o.accepted && o.hypothesis >= threshold});
  }
  return Evaluate(std::move(ranked), static_cast<int>(observations.size()), truth.RowsWithLoop());
}

LoopObservation Observe(const LoopResult& result) {
  LoopObservation observation;
  observation.image = static_cast<int>(result.query);
  observation.hypothesis = result.hypothesis;
  observation.best = static_cast<int>(result.candidate);
  observation.accepted = result.accepted;
  observation.verified = result.accepted ? static_cast<int>(result.verification.candidate) : -1;
  return observation;
}

}  // namespace tutti
