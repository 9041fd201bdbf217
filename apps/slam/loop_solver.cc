#include "apps/slam/loop_solver.h"

#include <cmath>
#include <cstdio>
#include <utility>

#include "core/numbers.h"
#include "core/stopwatch.h"

namespace tutti {
namespace {

// The share of its weight that a loop has left after optimisation. A true loop has all of it: what it
// disagreed by was drift, which the map has taken up. A false one that the map could be bent to keeps the
// part that Huber's loss leaves it.
constexpr double kLeastWeight = 0.5;

std::string BeyondGate(double sigmas, double limit) {
  char text[120];
  std::snprintf(text, sizeof text, "the map can't be that far off: Mahalanobis distance %.1f, limit %.1f",
                sigmas, limit);
  return text;
}

std::string Contradiction(const Disagreement& d, double weight) {
  char text[200];
  std::snprintf(text, sizeof text,
                "contradicts the map: off by %.0f %% of the scene depth and %.1f deg after optimisation, "
                "which leaves it %.0f %% of its weight",
                100 * d.fraction, d.angle_deg, 100 * weight);
  return text;
}

// Loops that the map can't have drifted to by what it knows of its own uncertainty.
void Gate(const KeyframeGraph& graph, const std::vector<LoopEdge>& accepted,
          const std::vector<LoopEdge>& entering, double limit, std::vector<LoopVerdict>* verdicts) {
  const std::vector<std::optional<double>> distances = graph.Distances(accepted, entering);
  for (std::size_t i = 0; i < entering.size(); ++i) {
    LoopVerdict& verdict = (*verdicts)[i];
    verdict.gate_sigmas = distances[i];
    if (!distances[i] || *distances[i] <= limit) continue;
    verdict.reason = BeyondGate(*distances[i], limit);
    verdict.contradicted = true;
  }
}

// How far a loop is from the optimised map.
Disagreement Residual(const LoopEdge& loop, const std::map<int, Similarity>& poses) {
  const Similarity &c = poses.at(loop.candidate), &q = poses.at(loop.query);
  const Similarity E = loop.S_candidate_query * q.Inverse() * c;  // in the candidate's units, as depth is
  return Measure(E, loop.depth);
}

// Judges the loops that are in by the optimised graph; true if all may stay.
bool Judge(const KeyframeCorrection& correction, const std::vector<LoopEdge>& accepted,
           std::vector<LoopVerdict>* verdicts) {
  bool old_broken = false;
  for (const LoopEdge& loop : accepted)
    old_broken = old_broken || Contradicts(Residual(loop, correction.S_world_keyframe));
  bool all_stay = true;
  std::size_t e = accepted.size();
  for (LoopVerdict& verdict : *verdicts) {
    if (!verdict.reason.empty()) continue;
    verdict.weight = correction.loops[e++].weight;
    const Disagreement d = Residual(verdict.loop, correction.S_world_keyframe);
    if (!old_broken && verdict.weight >= kLeastWeight && !Contradicts(d)) continue;
    verdict.reason =
        old_broken ? "contradicts loops that were accepted before" : Contradiction(d, verdict.weight);
    verdict.contradicted = true;
    all_stay = false;
  }
  return all_stay;
}

// From every start; another one than the map counts if it is lower and all loops may stay there, too.
void Prove(const KeyframeGraph& graph, const std::vector<LoopEdge>& accepted, LoopSolution* out) {
  std::vector<LoopEdge> loops = accepted;
  for (const LoopVerdict& verdict : out->verdicts) {
    if (verdict.reason.empty()) loops.push_back(verdict.loop);
  }
  out->proof = graph.Prove(loops);
  if (!out->proof->better) return;
  std::vector<LoopVerdict> verdicts = out->verdicts;
  out->proof->better = Judge(out->proof->correction, accepted, &verdicts);
  if (!out->proof->better) return;
  out->verdicts = std::move(verdicts);
  out->correction = out->proof->correction;
}

}  // namespace

bool Within(const Disagreement& d, const Disagreement& limits) {
  return d.fraction <= limits.fraction && d.angle_deg <= limits.angle_deg && d.log_scale <= limits.log_scale;
}

Disagreement Measure(const Similarity& E, double depth) {
  Disagreement d;
  d.fraction = E.translation.norm() / depth;
  d.angle_deg = LogSO3(E.rotation).norm() * internal::kDegrees;
  d.log_scale = std::abs(std::log(E.scale));
  return d;
}

bool Contradicts(const Disagreement& d) {
  constexpr double kMostFraction = 0.08, kMostDeg = 3;
  return d.fraction > kMostFraction || d.angle_deg > kMostDeg;
}

LoopSolution SolveLoops(const KeyframeGraph& graph, const std::vector<LoopEdge>& accepted,
                        const std::vector<LoopEdge>& entering, const SlamOptions& options) {
  const internal::Stopwatch watch;
  LoopSolution out;
  for (const LoopEdge& loop : entering) out.verdicts.push_back({loop, "", false, 0, std::nullopt});
  if (options.loop_gate_sigmas > 0) Gate(graph, accepted, entering, options.loop_gate_sigmas, &out.verdicts);
  while (!out.moves) {
    std::vector<LoopEdge> loops = accepted;
    for (const LoopVerdict& verdict : out.verdicts) {
      if (verdict.reason.empty()) loops.push_back(verdict.loop);
    }
    if (loops.size() == accepted.size()) break;
    out.correction = graph.Optimize(loops);
    if (out.correction.success) {
      out.moves = Judge(out.correction, accepted, &out.verdicts);
      continue;
    }
    for (LoopVerdict& verdict : out.verdicts) {
      if (verdict.reason.empty())
        verdict.reason = "the pose graph could not be solved: " + out.correction.reason;
    }
  }
  if (out.moves && options.certify) Prove(graph, accepted, &out);
  out.time_ms = watch.Milliseconds();
  return out;
}

std::map<int, Similarity> MovedAsSolved(const KeyframeCorrection& solved,
                                        const std::vector<MapKeyframe>& then,
                                        const std::vector<MapKeyframe>& now) {
  std::map<int, Similarity> out;
  std::map<int, Similarity> newest;  // motion of the newest known keyframe, by map piece
  auto before = then.begin();
  for (const MapKeyframe& keyframe : now) {
    const Similarity S_now(keyframe.T_world_keyframe);
    while (before != then.end() && before->id < keyframe.id) ++before;
    if (before == then.end() || before->id != keyframe.id) {
      out[keyframe.id] = newest[keyframe.piece] * S_now;
      continue;
    }
    const Pose& old = before->T_world_keyframe;
    const Similarity& found = solved.S_world_keyframe.at(keyframe.id);
    newest[keyframe.piece] = found * Similarity(old).Inverse();
    const bool stayed = old.translation == keyframe.T_world_keyframe.translation &&
                        old.rotation.coeffs() == keyframe.T_world_keyframe.rotation.coeffs();
    out[keyframe.id] = stayed ? found : newest[keyframe.piece] * S_now;
  }
  return out;
}

std::int64_t SolutionFrames(std::size_t keyframes) {
  constexpr std::int64_t kLeast = 5, kKeyframesOfAFrame = 100;
  return kLeast + static_cast<std::int64_t>(keyframes) / kKeyframesOfAFrame;
}

void BackgroundLoopSolver::Start(const KeyframeGraph& graph, const std::vector<LoopEdge>& accepted,
                                 const std::vector<LoopEdge>& entering, const SlamOptions& options,
                                 SpanRecorder* recorder) {
  const auto work = [recorder](const KeyframeGraph& g, const std::vector<LoopEdge>& old,
                               const std::vector<LoopEdge>& fresh, const SlamOptions& o) {
    const ScopedSpan span(recorder, Lane::kOptimisation, "close_loop");
    return std::make_shared<const LoopSolution>(SolveLoops(g, old, fresh, o));
  };
  recorded_ = recorder != nullptr;
  const auto launch = options.threads > 1 ? std::launch::async : std::launch::deferred;
  solution_ = Pending(std::async(launch, work, graph, accepted, entering, options));
}

void BackgroundLoopSolver::Resume(LoopSolution solution) {
  std::promise<std::shared_ptr<const LoopSolution>> found;
  found.set_value(std::make_shared<const LoopSolution>(std::move(solution)));
  solution_ = found.get_future().share();
}

}  // namespace tutti
