#include "apps/slam/loop_closer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "apps/slam/joining_loops.h"
#include "apps/slam/loop_reach.h"
#include "core/numbers.h"
#include "core/stopwatch.h"

namespace tutti {
namespace {

// An edge of the pose graph joins keyframes that share so many landmarks (as in ORB-SLAM's essential graph);
// from each to at most so many older ones, the strongest.
constexpr int kLeastShared = 100, kCovisible = 3;
constexpr double kNoWeight = 0.01;  // of the robust loss: the map contradicts the loop
constexpr int kLeastCommon = 30;    // landmarks that tie the two ends of a loop
constexpr int kSurelySeen = 100;    // inliers of a loop within the local map that may contradict it

KeyframeGraphOptions GraphOptions(const RunConfig& config, Sensor sensor) {
  KeyframeGraphOptions options;
  options.kind = sensor == Sensor::kMono ? GraphKind::kSim3 : GraphKind::kSE3;
  options.solver = config.graph;
  options.sigma_translation_ratio = config.run.odometry_sigma_fraction;
  options.sigma_rotation_rad = config.run.odometry_sigma_deg * internal::kRadians;
  options.sigma_log_scale = kOdometrySigmaScale;
  options.max_covisible = kCovisible;
  return options;
}

std::vector<MapKeyframe> KeyframesOf(const Odometry& odometry) {
  std::vector<MapKeyframe> keyframes;
  for (const int id : odometry.KeyframeIds())
    keyframes.push_back({id, odometry.KeyframePiece(id), odometry.KeyframePose(id)});
  return keyframes;
}

LoopGate::Map Places(const Odometry& odometry) {
  return [&odometry](int id) {
    return LoopGate::Place{odometry.KeyframePiece(id), odometry.KeyframePose(id)};
  };
}

}  // namespace

LoopCloser::LoopCloser(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder)
    : recorder_(recorder),
      options_(config.run),
      rig_(rig),
      detector_(config.loops),
      followed_(config.run, rig.sensor),
      gate_(config.run),
      graph_(GraphOptions(config, rig.sensor)) {}

PoseGraph LoopCloser::Graph(const Odometry& odometry) const {
  KeyframeGraph graph = graph_;
  graph.Update(KeyframesOf(odometry), Covisible(odometry));
  return graph.Graph(accepted_);
}

std::vector<CovisiblePair> LoopCloser::Covisible(const Odometry& odometry) const {
  if (followed_.ImagesJudgeSteps() && adjustments_ == 0) return {};
  std::vector<CovisiblePair> covisible;
  for (const auto& [pair, shared] : odometry.Covisibility(kLeastShared))
    covisible.push_back({pair.first, pair.second, shared});
  return covisible;
}

LoopConstraint LoopCloser::Measure(const Verification& verification, int candidate, int query,
                                   const Odometry& odometry) {
  const ScopedSpan span(recorder_, Lane::kOptimisation, "measure_loop");
  const internal::Stopwatch watch;
  LoopConstraint constraint = MakeLoopConstraint(verification, odometry.Keyframe(candidate),
                                                 odometry.Keyframe(query), rig_, detector_);
  stages_["loop_measure"] += watch.Milliseconds();
  return constraint;
}

// Measures it against the map, and lets it in if something else says the same.
LoopUpdate LoopCloser::Consider(const LoopRecord& proposed, const Verification& verification, int candidate,
                                int query, const Odometry& odometry, std::int64_t frames, bool across) {
  records_.push_back(proposed);
  LoopRecord& record = records_.back();
  if (!record.verified && !IsWitness(record, verification)) return {};
  const std::string doubt = record.reason;  // of the detector
  const bool recent = OfOneSession(record.query, record.candidate) &&
                      record.query_stamp_s - record.candidate_stamp_s < options_.loop_min_age_s;
  const auto refuse_recent = [&record] {
    record.reason = "too recent: still in the local map";
    return LoopUpdate();
  };
  if (recent && (!record.verified || verification.inliers < kSurelySeen)) return refuse_recent();
  const LoopConstraint constraint = Measure(verification, candidate, query, odometry);
  if (recent && (!constraint.usable || gate_.Fulfilled(constraint.edge, Places(odometry))))
    return refuse_recent();
  if (!constraint.usable) {
    record.reason = constraint.reason;
    return {};
  }
  LoopEdge edge = constraint.edge;
  edge.record = records_.size() - 1;
  record.S_candidate_query = edge.S_candidate_query;
  // An odometry that is followed may be any. Between recordings anything may have happened.
  const bool one_way = !followed_.begun() && OfOneSession(record.query, record.candidate);
  if (const std::string why = one_way && !recent ? WhyImpossible(edge, odometry, rig_.sensor) : "";
      !why.empty()) {
    record.reason = why;
    LoopUpdate update;
    if (record.verified) Revoke(edge.record, &update);  // the detector does not believe the others
    return update;
  }
  if (followed_.ImagesJudgeSteps()) gate_.SetOdometryUncertainty(followed_.Seen());
  LoopGate::Admitted admitted = gate_.Offer(edge, accepted_, Places(odometry), across,
                                            [&](const LoopEdge& loop) { return TrustIn(loop, odometry); });
  if (admitted.loops.empty()) {
    record.pending = true;
    record.reason = record.verified ? "waits for a second loop that agrees"
                                    : "waits for a verified loop that agrees; by itself: " + doubt;
    return {};
  }
  NoteWitnesses(admitted);
  for (const LoopEdge& loop : admitted.loops) untied_.insert(loop.record);
  return Enter(std::move(admitted.loops), odometry, frames);
}

LoopGate::Trust LoopCloser::TrustIn(const LoopEdge& loop, const Odometry& odometry) const {
  if (!records_[loop.record].verified) return LoopGate::Trust::kWeak;
  // A followed odometry may be any, and says itself how far it drifts.
  return followed_.begun() || InReach(loop, odometry) ? LoopGate::Trust::kSure : LoopGate::Trust::kFar;
}

std::string LoopCloser::Join(const std::vector<ProposedLoop>& proposed, const Odometry& odometry,
                             std::int64_t frames, LoopUpdate* update) {
  std::vector<LoopEdge> loops;
  for (const ProposedLoop& loop : proposed) {
    records_.push_back(loop.record);
    LoopRecord& record = records_.back();
    if (!record.verified) continue;
    LoopConstraint constraint = Measure(loop.verification, loop.candidate, loop.query, odometry);
    record.reason = constraint.reason;
    if (!constraint.usable) continue;
    record.S_candidate_query = constraint.edge.S_candidate_query;
    constraint.edge.record = records_.size() - 1;
    loops.push_back(constraint.edge);
  }
  const JoiningLoops joining = ChooseJoiningLoops(loops, Places(odometry), Graph(odometry), options_);
  for (std::size_t i = 0; i < loops.size(); ++i) {
    records_[loops[i].record].reason = joining.reasons[i];
    if (!joining.reasons[i].empty()) Revoke(loops[i].record, update);
  }
  std::vector<LoopEdge> entering;
  for (const std::size_t i : joining.chosen) entering.push_back(loops[i]);
  for (const LoopEdge& loop : entering) untied_.insert(loop.record);
  if (!entering.empty()) Start(std::move(entering), odometry, frames);
  return joining.reason;
}

LoopUpdate LoopCloser::MoveAll(const std::map<int, Similarity>& S_world_keyframe, const Odometry& odometry) {
  graph_.Update(KeyframesOf(odometry), Covisible(odometry));
  graph_.Move(S_world_keyframe, {});
  Rescale(S_world_keyframe);
  LoopUpdate update;
  update.correction.emplace();
  update.correction->S_world_keyframe = S_world_keyframe;
  return update;
}

void LoopCloser::Add(int candidate, int query, const Similarity& S_candidate_query,
                     const Matrix7d& information, const Odometry& odometry, std::int64_t frames) {
  LoopEdge edge;
  edge.candidate = candidate;
  edge.query = query;
  edge.candidate_frame = odometry.KeyframeFrameIndex(candidate);
  edge.query_frame = odometry.KeyframeFrameIndex(query);
  edge.S_candidate_query = S_candidate_query;
  edge.information = information;
  edge.depth = MedianDepth(odometry.Keyframe(candidate));
  edge.record = records_.size();
  LoopRecord record;
  record.query = edge.query_frame;
  record.candidate = edge.candidate_frame;
  record.query_stamp_s = odometry.KeyframeStamp(query);
  record.candidate_stamp_s = odometry.KeyframeStamp(candidate);
  record.verified = record.injected = true;
  record.S_candidate_query = S_candidate_query;
  if (!(edge.depth > 0)) record.reason = "the candidate's keyframe has no landmarks";
  records_.push_back(record);
  if (!(edge.depth > 0)) return;
  untied_.insert(edge.record);
  Start({edge}, odometry, frames);
}

// Somebody else's trajectory that was not moved yet and needs not be.
bool LoopCloser::LeavesAsItIs(const std::vector<LoopEdge>& entering, const Odometry& odometry) const {
  if (!followed_.begun() || corrections_ > 0 || solver_.Running()) return false;
  std::vector<LoopEdge> loops = deferred_;
  loops.insert(loops.end(), entering.begin(), entering.end());
  return gate_.WithinNoise(loops, Places(odometry));
}

// What the map fulfils already waits, so that not every loop moves it.
LoopUpdate LoopCloser::Enter(std::vector<LoopEdge> entering, const Odometry& odometry, std::int64_t frames) {
  const LoopGate::Map places = Places(odometry);
  const auto fulfilled = [&](const LoopEdge& loop) { return gate_.Fulfilled(loop, places); };
  LoopUpdate update;
  if (LeavesAsItIs(entering, odometry)) {
    deferred_.insert(deferred_.end(), entering.begin(), entering.end());
    return update;
  }
  if (!solver_.Running() && std::all_of(deferred_.begin(), deferred_.end(), fulfilled) &&
      std::all_of(entering.begin(), entering.end(), fulfilled)) {
    deferred_.insert(deferred_.end(), entering.begin(), entering.end());
    if (options_.global_adjustment) {
      update.correction.emplace();
      update.correction->fused = std::move(entering);
    }
    return update;
  }
  entering.insert(entering.begin(), deferred_.begin(), deferred_.end());
  deferred_.clear();
  Start(std::move(entering), odometry, frames);
  return update;
}

void LoopCloser::NoteStep(int keyframe, const StepCheck& check) {
  if (const auto sigma = followed_.NoteStep(keyframe, check)) graph_.NoteMotion(keyframe, *sigma);
}

void LoopCloser::FollowOdometry(const StampedPose& T_odom_camera, const Odometry& odometry) {
  followed_.Add(T_odom_camera);
  JudgeJumps(odometry, false);
}

void LoopCloser::JudgeJumps(const Odometry& odometry, bool all) {
  const std::vector<OdometryJump> jumps = followed_.TakeJumps(all);
  if (jumps.empty()) return;
  const std::vector<int> ids = odometry.KeyframeIds();
  const auto later = [&](double stamp_s) {
    return std::partition_point(ids.begin(), ids.end(),
                                [&](int id) { return odometry.KeyframeStamp(id) < stamp_s; });
  };
  for (const OdometryJump& jump : jumps) {
    const auto end = later(jump.to_s);
    const int next = end == ids.end() ? odometry.NextKeyframeId() : *end;
    if (!jump.comes_back) {
      if (followed_.ImagesConfirm(next, jump)) continue;
      graph_.NoteJump(next);
    }
    followed_.NoteJump(jump);
    if (!jump.comes_back) continue;
    for (auto outlier = later(std::nextafter(jump.from_s, jump.to_s)); outlier != end; ++outlier)
      graph_.NoteOutlier(*outlier);
  }
}

void LoopCloser::NoteMotion(int keyframe, const MotionSigma& sigma, const Eigen::Vector3d& position) {
  const bool said_nothing = followed_.motions() == 0;
  if (const auto motion = followed_.NoteMotion(keyframe, sigma, position))
    graph_.NoteMotion(keyframe, *motion);
  if (said_nothing && followed_.motions() > 0) SetSigmas();  // what is configured no longer counts
}

void LoopCloser::SetSigmas() {
  constexpr double kLeastRotation_rad = 1e-6;  // an edge is never certain
  const FollowedOdometry::Sigmas least = followed_.Least();
  graph_.SetSigmas(least.fraction, std::max(least.rotation_rad, kLeastRotation_rad));
}

// Solves the graph with them beside the tracking; those that come meanwhile wait for their turn.
void LoopCloser::Start(std::vector<LoopEdge> entering, const Odometry& odometry, std::int64_t frames) {
  if (solver_.Running()) {
    queued_.insert(queued_.end(), entering.begin(), entering.end());
    return;
  }
  const ScopedSpan span(recorder_, Lane::kOptimisation, "begin_closing");
  const internal::Stopwatch watch;
  solved_keyframes_ = KeyframesOf(odometry);
  graph_.Update(solved_keyframes_, Covisible(odometry));
  SetSigmas();
  solver_.Start(graph_, accepted_, entering, options_, recorder_);
  solved_due_ = frames + SolutionFrames(solved_keyframes_.size());
  stages_["loop_optimize"] += watch.Milliseconds();
}

std::optional<LoopUpdate> LoopCloser::Solved(const Odometry& odometry, std::int64_t frames,
                                             Entering entering) {
  if (!solver_.Running() && !queued_.empty()) return Enter(std::exchange(queued_, {}), odometry, frames);
  if (!solver_.Running()) return std::nullopt;
  if (entering == Entering::kWhenDue && frames < solved_due_) return std::nullopt;
  const ScopedSpan span(recorder_, Lane::kOptimisation, "enter_correction");
  const internal::Stopwatch watch;
  const LoopSolution solution = solver_.Take();
  stages_["loop_solve"] += solution.time_ms;
  LoopUpdate update;
  for (const LoopVerdict& verdict : solution.verdicts) Settle(verdict, &update);
  if (solution.moves) {
    for (std::size_t i = 0; i < accepted_.size(); ++i) {
      records_[accepted_[i].record].weight = solution.correction.loops[i].weight;
      if (solution.correction.loops[i].weight < kNoWeight) Revoke(accepted_[i].record, &update);
    }
    update.correction = MoveBy(solution.correction, odometry);
    proof_ = solution.proof;
  }
  stages_["loop_optimize"] += watch.Milliseconds();
  return update;
}

MapCorrection LoopCloser::MoveBy(const KeyframeCorrection& solved, const Odometry& odometry) {
  MapCorrection correction;
  const std::vector<MapKeyframe> now = KeyframesOf(odometry);
  correction.S_world_keyframe = Follow(solved, solved_keyframes_, now);
  correction.merges = solved.merges;
  ++corrections_;
  graph_.Update(now, Covisible(odometry));
  graph_.Move(correction.S_world_keyframe, correction.merges);
  Rescale(correction.S_world_keyframe);
  if (options_.global_adjustment) {
    correction.fused = Untied();
    adjust_piece_ = odometry.KeyframePiece(accepted_.back().candidate);
  }
  return correction;
}

void LoopCloser::Rescale(const std::map<int, Similarity>& S_world_keyframe) {
  for (std::vector<LoopEdge>* loops : {&accepted_, &gate_.waiting(), &deferred_, &queued_}) {
    for (LoopEdge& loop : *loops) tutti::Rescale(S_world_keyframe, &loop);
  }
}

std::vector<LoopEdge> LoopCloser::Untied() const {
  std::vector<LoopEdge> untied;
  for (const LoopEdge& loop : accepted_) {
    if (untied_.count(loop.record) != 0) untied.push_back(loop);
  }
  std::sort(untied.begin(), untied.end(),
            [](const LoopEdge& a, const LoopEdge& b) { return a.record < b.record; });
  return untied;
}

std::optional<LoopUpdate> LoopCloser::Adjusted(const Odometry& odometry, std::int64_t frames,
                                               Entering entering) {
  if (solver_.Running() || !adjuster_.Running()) return std::nullopt;
  if (entering == Entering::kWhenDue && !adjuster_.Due(frames)) return std::nullopt;
  const ScopedSpan span(recorder_, Lane::kOptimisation, "enter_adjustment");
  const internal::Stopwatch watch;
  LoopUpdate update;
  auto adjustment = std::make_shared<const GlobalAdjustment>(adjuster_.Take());
  if (auto moved = odometry.CorrectionOf(*adjustment)) {
    Rescale(*moved);
    update.correction.emplace();
    update.correction->S_world_keyframe = std::move(*moved);
    update.correction->adjustment = std::move(adjustment);
    ++adjustments_;
  }
  stages_["global_adjustment"] += watch.Milliseconds();
  return update;
}

bool LoopCloser::Converge(const Odometry& odometry, int piece) {
  if (!options_.global_adjustment || !untied_.empty()) return false;
  adjuster_.Converge(odometry, piece);
  return true;
}

void LoopCloser::Applied(const LoopUpdate& update, const std::vector<int>& common, const Odometry& odometry,
                         std::int64_t frames) {
  const MapCorrection& correction = *update.correction;
  for (std::size_t i = 0; i < common.size(); ++i) {
    if (common[i] >= kLeastCommon) untied_.erase(correction.fused[i].record);
  }
  if (correction.adjustment) {
    // The map as it is says more than what was measured before; a loop that it contradicts keeps its own.
    graph_.MeasureAgain();
    for (LoopEdge& loop : accepted_) {
      const Similarity in_map(odometry.KeyframePose(loop.candidate).Inverse() *
                              odometry.KeyframePose(loop.query));
      const Disagreement d = tutti::Measure(loop.S_candidate_query * in_map.Inverse(), loop.depth);
      if (!Contradicts(d)) loop.S_candidate_query = in_map;
    }
  }
  // To adjust the map without a loop that landmarks do not tie would open that loop again.
  if (adjust_piece_ && untied_.empty()) adjuster_.MapMoved(odometry, *adjust_piece_, frames);
  adjust_piece_.reset();
}

bool LoopCloser::CloseDeferred(const Odometry& odometry, std::int64_t frames) {
  if (deferred_.empty()) return false;
  std::vector<LoopEdge> entering = std::exchange(deferred_, {});
  if (!LeavesAsItIs(entering, odometry)) {
    Start(std::move(entering), odometry, frames);
    return true;
  }
  LoopUpdate none_is_revoked;
  for (const LoopEdge& loop : entering) Settle({loop, "", false, 1, std::nullopt}, &none_is_revoked);
  return false;
}

void LoopCloser::Removed(const std::map<int, int>& into, const Odometry& before) {
  graph_.Update(KeyframesOf(before), Covisible(before));
  for (std::vector<LoopEdge>* loops : {&accepted_, &gate_.waiting(), &deferred_, &queued_}) {
    std::vector<LoopEdge> stay;
    for (LoopEdge& loop : *loops) {
      if (graph_.Rehang(into, &loop)) {
        stay.push_back(loop);
      } else {
        untied_.erase(loop.record);  // its two ends are one keyframe
      }
    }
    *loops = std::move(stay);
  }
  graph_.Remove(into);
}

void LoopCloser::Resume(std::optional<LoopSolution> solution, std::optional<GlobalAdjustment> adjustment) {
  if (solution) solver_.Resume(*std::move(solution));
  adjuster_.Resume(std::move(adjustment));
}

}  // namespace tutti
