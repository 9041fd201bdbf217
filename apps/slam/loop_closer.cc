#include "apps/slam/loop_closer.h"

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <optional>
#include <utility>

#include "core/stopwatch.h"

namespace tutti {

LoopCloser::LoopCloser(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder,
                       Odometry* odometry, std::vector<LoopRecord>* records,
                       std::function<void()> before_change)
    : recorder_(recorder),
      options_(config.run),
      rig_(rig),
      seed_(config.loops.seed),
      odometry_(*odometry),
      records_(*records),
      before_change_(std::move(before_change)),
      gate_(config.run),
      graph_(config.graph, config.online, config.run, rig.sensor),
      false_loops_(config.run, config.loops.seed) {}

void LoopCloser::AddKeyframes() {
  const std::vector<int> ids = odometry_.KeyframeIds();
  for (auto id = std::upper_bound(ids.begin(), ids.end(), newest_keyframe_); id != ids.end(); ++id) {
    graph_.AddKeyframe(*id, odometry_.KeyframePiece(*id));
    newest_keyframe_ = *id;
  }
}

LoopGate::Map LoopCloser::Places() const {
  return [this](int id) { return LoopGate::Place{odometry_.KeyframePiece(id), odometry_.KeyframePose(id)}; };
}

// What mapping has found enters earlier than without the loop.
void LoopCloser::BeginChange() {
  before_change_();
  odometry_.FinishMapping();
}

// Measures it against the map, and closes it if something else says the same.
void LoopCloser::Consider(const Verification& verification, int candidate, int query, std::int64_t frames) {
  LoopRecord& record = records_.back();
  if (record.query_stamp_s - record.candidate_stamp_s < options_.loop_min_age_s) {
    record.reason = "too recent: still in the local map";
    return;
  }
  BeginChange();
  const LoopGate::Map places = Places();
  const LoopConstraint constraint = Measure(verification, candidate, query);
  if (!constraint.usable) {
    record.reason = constraint.reason;
    return;
  }
  LoopEdge edge = constraint.edge;
  edge.record = records_.size() - 1;
  record.S_candidate_query = edge.S_candidate_query;
  std::vector<LoopEdge> entering = gate_.Offer(edge, places);
  if (entering.empty()) {
    record.pending = true;
    record.reason = "waits for a second loop that agrees";
    return;
  }
  for (const LoopEdge& loop : entering) untied_[loop.record] = loop;
  const auto fulfilled = [&](const LoopEdge& loop) { return gate_.Fulfilled(loop, places); };
  const auto all_fulfilled = [&](const std::vector<LoopEdge>& loops) {
    return std::all_of(loops.begin(), loops.end(), fulfilled);
  };
  if (all_fulfilled(deferred_) && all_fulfilled(entering)) {
    if (options_.global_adjustment) Fuse(entering);
    deferred_.insert(deferred_.end(), entering.begin(), entering.end());
  } else {
    entering.insert(entering.begin(), deferred_.begin(), deferred_.end());
    deferred_.clear();
    Close(std::move(entering), frames);
  }
}

LoopConstraint LoopCloser::Measure(const Verification& verification, int candidate, int query) {
  const ScopedSpan span(recorder_, Lane::kOptimisation, "measure_loop");
  const internal::Stopwatch watch;
  LoopConstraint constraint = MakeLoopConstraint(verification, odometry_.Keyframe(candidate),
                                                 odometry_.Keyframe(query), rig_, options_, seed_);
  stages_["loop_measure"] += watch.Milliseconds();
  return constraint;
}

bool LoopCloser::Inject(int query, std::int64_t frames) {
  std::optional<LoopEdge> loop = false_loops_.Next(odometry_, query);
  if (!loop) return false;
  LoopRecord record;
  record.query = loop->query_frame;
  record.candidate = loop->candidate_frame;
  record.query_stamp_s = odometry_.KeyframeStamp(loop->query);
  record.candidate_stamp_s = odometry_.KeyframeStamp(loop->candidate);
  record.verified = record.injected = true;
  record.S_candidate_query = loop->S_candidate_query;
  loop->record = records_.size();
  records_.push_back(record);
  untied_[loop->record] = *loop;
  Close({*loop}, frames);
  return true;
}

// Loops that the map can't have drifted to by what it knows of its own uncertainty.
void LoopCloser::Gate(std::vector<LoopEdge>& entering) {
  if (options_.loop_gate_sigmas == 0) return;
  const ScopedSpan span(recorder_, Lane::kOptimisation, "gate_loop");
  const std::vector<std::optional<double>> distances =
      graph_.Distances(odometry_, gate_.accepted(), entering);
  std::vector<LoopEdge> passed;
  for (std::size_t i = 0; i < entering.size(); ++i) {
    const LoopEdge& loop = entering[i];
    const std::optional<double>& distance = distances[i];
    records_[loop.record].gate_sigmas = distance;
    if (!distance || *distance <= options_.loop_gate_sigmas) {
      passed.push_back(loop);
      continue;
    }
    char text[120];
    std::snprintf(text, sizeof text, "the map can't be that far off: Mahalanobis distance %.1f, limit %.1f",
                  *distance, options_.loop_gate_sigmas);
    Reject(loop, text);
    Revoke(loop);
  }
  entering = std::move(passed);
}

void LoopCloser::Reject(const LoopEdge& loop, const std::string& reason) {
  records_[loop.record].pending = false;
  records_[loop.record].reason = reason;
  untied_.erase(loop.record);
}

void LoopCloser::Revoke(const LoopEdge& loop) {
  LoopRecord& record = records_[loop.record];
  if (record.injected || record.revoked) return;
  record.revoked = true;
  revoked_.emplace_back(record.query, record.candidate);
}

// Optimises with the entering loops; those that the rest contradicts leave again. Then the map moves.
void LoopCloser::Close(std::vector<LoopEdge> entering, std::int64_t frames) {
  const ScopedSpan span(recorder_, Lane::kOptimisation, "close_loop");
  const internal::Stopwatch watch;
  const double fused_before = stages_["loop_fuse"];  // a stage of its own
  BeginChange();
  MapGraph::Correction correction;
  Gate(entering);
  while (!entering.empty()) {
    std::vector<LoopEdge> loops = gate_.accepted();
    loops.insert(loops.end(), entering.begin(), entering.end());
    correction = graph_.Optimize(odometry_, loops);
    if (!correction.success) {
      for (const LoopEdge& loop : entering)
        Reject(loop, "the pose graph could not be solved: " + correction.reason);
      entering.clear();
      break;
    }
    const std::size_t old = gate_.accepted().size();
    bool old_broken = false;
    for (std::size_t i = 0; i < old; ++i)
      old_broken = old_broken || Contradicts(correction.residuals[i], options_);
    std::vector<LoopEdge> staying;
    for (std::size_t i = 0; i < entering.size(); ++i) {
      const Disagreement& d = correction.residuals[old + i];
      records_[entering[i].record].weight = correction.weights[old + i];
      if (!old_broken && !Contradicts(d, options_)) {
        staying.push_back(entering[i]);
        continue;
      }
      char text[160];
      std::snprintf(text, sizeof text,
                    "contradicts the map: off by %.0f %% of the scene depth and %.1f deg after optimisation",
                    100 * d.fraction, d.angle_deg);
      Reject(entering[i], old_broken ? "contradicts loops that were accepted before" : text);
      Revoke(entering[i]);
    }
    if (staying.size() == entering.size()) break;
    entering = std::move(staying);
  }
  if (!entering.empty()) Apply(correction, entering, frames);
  stages_["loop_optimize"] += watch.Milliseconds() - (stages_["loop_fuse"] - fused_before);
}

void LoopCloser::Apply(const MapGraph::Correction& correction, const std::vector<LoopEdge>& entering,
                       std::int64_t frames) {
  for (const LoopEdge& loop : entering) {
    LoopRecord& record = records_[loop.record];
    record.accepted = true;
    record.pending = false;
    record.reason.clear();
    gate_.Accepted(loop);
  }
  constexpr double kNoWeight = 0.01;
  for (std::size_t i = 0; i < gate_.accepted().size(); ++i) {
    const LoopEdge& loop = gate_.accepted()[i];
    records_[loop.record].weight = correction.weights[i];
    if (correction.weights[i] < kNoWeight) Revoke(loop);
  }
  graph_.Keep(odometry_, correction, gate_.accepted(), gate_.waiting());
  odometry_.ApplyCorrection(correction.S_world_keyframe, correction.merges);
  ++corrections_;
  if (!options_.global_adjustment) return;
  std::vector<LoopEdge> untied;
  for (const auto& [record, loop] : untied_) untied.push_back(loop);
  if (Fuse(untied)) adjuster_.MapMoved(odometry_, odometry_.KeyframePiece(entering.back().candidate), frames);
}

// Landmarks that both ends of the loops see become one. False if some loop has too few of them yet: to
// adjust the map without it would open it again. It is tried again with the next correction.
bool LoopCloser::Fuse(const std::vector<LoopEdge>& loops) {
  constexpr int kLeastCommon = 30;
  const ScopedSpan span(recorder_, Lane::kOptimisation, "fuse_loop");
  const internal::Stopwatch watch;
  for (const LoopEdge& loop : loops) {
    if (odometry_.FuseLoop(loop.candidate, loop.query, loop.S_candidate_query) >= kLeastCommon)
      untied_.erase(loop.record);
  }
  stages_["loop_fuse"] += watch.Milliseconds();
  return untied_.empty();
}

// Brings in what the adjustment of the whole map has found.
void LoopCloser::EnterAdjustment() {
  const ScopedSpan span(recorder_, Lane::kOptimisation, "enter_adjustment");
  const internal::Stopwatch watch;
  odometry_.FinishMapping();
  const GlobalAdjustment adjustment = adjuster_.Take();
  MapGraph::Correction correction;
  if (auto moved = odometry_.CorrectionOf(adjustment)) {
    correction.S_world_keyframe = std::move(*moved);
    graph_.Keep(odometry_, correction, gate_.accepted(), gate_.waiting());
    odometry_.Enter(adjustment, correction.S_world_keyframe);
    graph_.MeasureAgain(odometry_, gate_.accepted());
    ++adjustments_;
  }
  stages_["global_adjustment"] += watch.Milliseconds();
}

void LoopCloser::EnterDue(std::int64_t frames) {
  if (adjuster_.Due(frames)) EnterAdjustment();
}

void LoopCloser::Finish(std::int64_t frames) {
  if (!deferred_.empty()) Close(std::exchange(deferred_, {}), frames);
  while (Inject(-1, frames)) {
  }
  if (adjuster_.Running()) EnterAdjustment();
}

}  // namespace tutti
