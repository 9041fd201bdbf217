// Which loops enter the pose graph, and how the map moves then: the decisions of LoopCloser.
#include <algorithm>
#include <string>
#include <utility>

#include "apps/slam/loop_closer.h"
#include "apps/slam/loop_reach.h"
#include "apps/slam/weak_steps.h"
#include "core/stopwatch.h"
#include "loopclosure/detector/hypothesis_search.h"

namespace tutti {
namespace {

constexpr int kLeastShared = 100;  // landmarks of an edge between keyframes, as in ORB-SLAM's essential graph
constexpr double kNoWeight = 0.01;  // of the robust loss: the map contradicts the loop
constexpr int kLeastCommon = 30;    // landmarks that tie the two ends of a loop
constexpr int kSurelySeen = 100;    // inliers of a loop within the local map that may contradict it
// With fewer inliers the place is mostly right, but the motion is not: it is off by 6 degrees and more, where
// by 2 with 30.
constexpr int kFewestInliers = 20;
// Below this, what geometry lets pass is wrong as often as right; with a verified loop that agrees with it
// within centimetres and a degree, that is evidence enough.
constexpr double kLeastProbability = 0.3;

}  // namespace

std::vector<MapKeyframe> KeyframesOf(const Map& map) {
  std::vector<MapKeyframe> keyframes;
  for (const int id : map.KeyframeIds())
    keyframes.push_back({id, map.keyframe(id).piece, map.keyframe(id).T_world_camera});
  return keyframes;
}

LoopGate::Places PlacesIn(const Map& map) {
  return [&map](int id) { return LoopGate::Place{map.keyframe(id).piece, map.keyframe(id).T_world_camera}; };
}

void LoopCloser::SetState(std::size_t loop, LoopState state) {
  loops_[loop].state = state;
  loops_[loop].since = ++changes_;
}

std::vector<std::size_t> LoopCloser::InState(LoopState state) const {
  std::vector<std::size_t> loops;
  for (std::size_t i = 0; i < loops_.size(); ++i) {
    const bool has_edge = loops_[i].edge.candidate != loops_[i].edge.query;
    if (loops_[i].state == state && has_edge) loops.push_back(i);
  }
  std::sort(loops.begin(), loops.end(),
            [this](std::size_t a, std::size_t b) { return loops_[a].since < loops_[b].since; });
  return loops;
}

std::vector<LoopEdge> LoopCloser::EdgesOf(const std::vector<std::size_t>& loops) const {
  std::vector<LoopEdge> edges;
  edges.reserve(loops.size());
  for (const std::size_t loop : loops) edges.push_back(loops_[loop].edge);
  return edges;
}

PoseGraph LoopCloser::Graph(const Map& map) const {
  KeyframeGraph graph = graph_;
  graph.Update(KeyframesOf(map), Covisible(map));
  return graph.Graph(EdgesOf(InState(LoopState::kInMap)));
}

// Pairs that the pose graph has edges for beside consecutive keyframes. None where images judge steps:
// keyframes stand where the odometry says, so a pair would say once more what the steps between it said.
// After an adjustment they stand where the images say.
std::vector<CovisiblePair> LoopCloser::Covisible(const Map& map) const {
  if (followed_.ImagesJudgeSteps() && adjustments_ == 0) return {};
  std::vector<CovisiblePair> covisible;
  for (const auto& [pair, shared] : Covisibility(map, kLeastShared))
    covisible.push_back({pair.first, pair.second, shared});
  return covisible;
}

LoopConstraint LoopCloser::Measure(const Verification& verification, int candidate, int query,
                                   const Map& map) {
  const ScopedSpan span(recorder_, Lane::kOptimisation, "measure_loop");
  const internal::Stopwatch watch;
  LoopConstraint constraint =
      MakeLoopConstraint(verification, ViewOf(map, candidate), ViewOf(map, query), rig_, detector_);
  stages_["loop_measure"] += watch.Milliseconds();
  return constraint;
}

// Time stamps of different recordings do not compare.
bool LoopCloser::OfOneSession(std::int64_t frame, std::int64_t other) const {
  const auto session = [this](std::int64_t f) {
    return std::upper_bound(sessions_.begin(), sessions_.end(), f) - sessions_.begin();
  };
  return session(frame) == session(other);
}

// What the detector does not believe, though geometry does, or would with a few more inliers.
bool LoopCloser::IsWitness(const Loop& loop, const Verification& verification) const {
  if (verification.accepted) return loop.probability >= kLeastProbability;
  if (verification.type == ConstraintType::kNone || verification.inliers < kFewestInliers) return false;
  const bool rigid = verification.type == ConstraintType::kRigid || verification.homography;
  const VerificationOptions& bars = detector_.verification;
  // Geometry refuses more of them for another reason than their number.
  if (verification.inliers >= (rigid ? bars.min_inliers : bars.min_epipolar_inliers)) return false;
  return internal::LoopProbability(verification) >= kLeastProbability;
}

LoopGate::Trust LoopCloser::TrustIn(const LoopEdge& edge, const Map& map) const {
  if (!loops_[edge.record].verified) return LoopGate::Trust::kWeak;
  // A followed odometry may be any, and says itself how far it drifts.
  return followed_.begun() || InReach(edge, map) ? LoopGate::Trust::kSure : LoopGate::Trust::kFar;
}

// Measures it against the map, and lets it in if something else says the same. One that is not verified
// enters only as a witness of one that is.
LoopCloser::Update LoopCloser::Consider(Loop proposed, const Verification& verification, int candidate,
                                        int query, const Odometry& odometry, std::int64_t frames,
                                        bool across) {
  const Map& map = odometry.map();
  const std::size_t index = loops_.size();
  loops_.push_back(std::move(proposed));
  Loop& loop = loops_.back();
  if (!loop.verified && !IsWitness(loop, verification)) return {};
  const std::string doubt = loop.reason;  // of the detector
  // What holds a submap to the others may well be what was seen just before.
  const bool recent = map.keyframe(query).piece == map.keyframe(candidate).piece &&
                      OfOneSession(loop.query, loop.candidate) &&
                      loop.query_stamp_s - loop.candidate_stamp_s < options_.loop_min_age_s;
  const auto reject = [&loop](const std::string& reason) {
    loop.reason = reason;
    return Update();
  };
  constexpr const char* kRecent = "too recent: still in the local map";
  if (recent && (!loop.verified || verification.inliers < kSurelySeen)) return reject(kRecent);
  const LoopConstraint constraint = Measure(verification, candidate, query, map);
  if (recent && (!constraint.usable || gate_.Fulfilled(constraint.edge, PlacesIn(map))))
    return reject(kRecent);
  if (!constraint.usable) return reject(constraint.reason);
  loop.edge = constraint.edge;
  loop.edge.record = index;
  loop.S_candidate_query = loop.edge.S_candidate_query;
  // An odometry that is followed may be any. Between recordings anything may have happened.
  const bool one_way = !followed_.begun() && OfOneSession(loop.query, loop.candidate);
  if (const std::string why = one_way && !recent ? WhyImpossible(loop.edge, map, rig_.sensor) : "";
      !why.empty()) {
    if (loop.verified) Revoke(&loop);  // the detector does not believe the others
    return reject(why);
  }
  if (followed_.ImagesJudgeSteps()) gate_.SetOdometryUncertainty(followed_.Seen());
  const std::vector<std::size_t> waiting = InState(LoopState::kWaiting);
  const LoopGate::Admitted admitted =
      gate_.Admit(loop.edge, EdgesOf(waiting), EdgesOf(InState(LoopState::kInMap)), PlacesIn(map), across,
                  [&](const LoopEdge& edge) { return TrustIn(edge, map); });
  if (admitted.loops.empty()) {
    SetState(index, LoopState::kWaiting);
    return reject(loop.verified ? "waits for a second loop that agrees"
                                : "waits for a verified loop that agrees; by itself: " + doubt);
  }
  NoteWitnesses(admitted);
  std::vector<std::size_t> entering;
  for (const LoopEdge& edge : admitted.loops) {
    loops_[edge.record].untied = true;
    entering.push_back(edge.record);
  }
  for (const std::size_t other : waiting) {  // of the same two frames one loop is enough
    const auto is_of = [&](std::size_t enters) {
      return loops_[other].query == loops_[enters].query &&
             loops_[other].candidate == loops_[enters].candidate;
    };
    if (std::find(entering.begin(), entering.end(), other) != entering.end() ||
        std::none_of(entering.begin(), entering.end(), is_of))
      continue;
    SetState(other, LoopState::kRejected);
    loops_[other].reason = "another loop between the same frames entered";
  }
  return Enter(entering, odometry, frames);
}

// The newest came last, and agrees with the witness; the others agree with it.
void LoopCloser::NoteWitnesses(const LoopGate::Admitted& admitted) {
  const auto of = [](const LoopEdge& loop) {
    return "the loop of frame " + std::to_string(loop.query_frame);
  };
  const LoopEdge& newest = admitted.loops.back();
  for (const LoopEdge& edge : admitted.loops) {
    std::string& witness = loops_[edge.record].witness;
    if (edge.record != newest.record) {
      witness = of(newest);
    } else if (admitted.witness) {
      witness = of(*admitted.witness);
    } else if (options_.loop_confirmations > 1 || !loops_[edge.record].verified) {
      witness = "the map";
    }
  }
}

void LoopCloser::AddLoop(const FoundLoop& found, Odometry* odometry, std::int64_t frames) {
  const Keyframe &candidate = odometry->map().keyframe(found.candidate),
                 &query = odometry->map().keyframe(found.query);
  Loop loop;
  loop.query = query.frame_index;
  loop.candidate = candidate.frame_index;
  loop.query_stamp_s = query.stamp_s;
  loop.candidate_stamp_s = candidate.stamp_s;
  loop.matches = found.verification.matches;
  loop.inliers = found.verification.inliers;
  loop.reason = found.verification.reason;
  if (!found.known) {
    loop.verified = found.verification.accepted;
    return Take(
        Consider(std::move(loop), found.verification, found.candidate, found.query, *odometry, frames, true),
        odometry, frames);
  }
  loop.verified = loop.injected = true;
  loop.S_candidate_query = found.verification.S_candidate_query;
  loop.edge = {found.candidate,
               found.query,
               loop.candidate,
               loop.query,
               found.verification.S_candidate_query,
               *found.known,
               MedianDepth(ViewOf(odometry->map(), found.candidate)),
               loops_.size()};
  loop.untied = loop.edge.depth > 0;
  if (!loop.untied) loop.reason = "the candidate's keyframe has no landmarks";
  loops_.push_back(loop);
  if (loop.untied) Solve({loop.edge.record}, *odometry, frames);
}

// Somebody else's trajectory stays as it is, if it was not moved yet and differs from all loops by no more
// than loops err themselves.
bool LoopCloser::LeavesAsItIs(const std::vector<std::size_t>& loops, const Map& map) const {
  if (!followed_.begun() || corrections_ > 0 || solver_.Running()) return false;
  return gate_.WithinNoise(EdgesOf(loops), PlacesIn(map));
}

// What the map fulfils already waits, so that not every loop moves it.
LoopCloser::Update LoopCloser::Enter(const std::vector<std::size_t>& entering, const Odometry& odometry,
                                     std::int64_t frames) {
  const LoopGate::Places places = PlacesIn(odometry.map());
  std::vector<std::size_t> all = InState(LoopState::kDeferred);
  all.insert(all.end(), entering.begin(), entering.end());
  const bool stays = LeavesAsItIs(all, odometry.map());
  const bool fulfilled = !solver_.Running() && std::all_of(all.begin(), all.end(), [&](std::size_t loop) {
    return gate_.Fulfilled(loops_[loop].edge, places);
  });
  Update update;
  if (!stays && !fulfilled) {
    Solve(all, odometry, frames);
    return update;
  }
  for (const std::size_t loop : entering) SetState(loop, LoopState::kDeferred);
  if (stays || !options_.global_adjustment) return update;
  update.correction.emplace();
  Fuse(entering, &update);
  return update;
}

// Solves the graph with them beside the tracking; those that come meanwhile wait for their turn.
void LoopCloser::Solve(const std::vector<std::size_t>& entering, const Odometry& odometry,
                       std::int64_t frames) {
  const bool running = solver_.Running();
  for (const std::size_t loop : entering) SetState(loop, running ? LoopState::kAgreed : LoopState::kSolving);
  if (running) return;
  const ScopedSpan span(recorder_, Lane::kOptimisation, "begin_closing");
  const internal::Stopwatch watch;
  solved_keyframes_ = KeyframesOf(odometry.map());
  graph_.Update(solved_keyframes_, Covisible(odometry.map()));
  SetSigmas();
  NoteSteps(odometry.map());
  solver_.Start(graph_, EdgesOf(InState(LoopState::kInMap)), EdgesOf(entering), options_, recorder_);
  solved_due_ = frames + SolutionFrames(solved_keyframes_.size());
  stages_["loop_optimize"] += watch.Milliseconds();
}

// Steps are judged once, before loops move them. A followed odometry says itself how certain it is.
void LoopCloser::NoteSteps(const Map& map) {
  if (followed_.begun()) return;
  for (const auto& [keyframe, sigma] : StepSigmas(map, graph_.LastNoted(), pixel_sigma_))
    graph_.NoteMotion(keyframe, sigma);
}

bool LoopCloser::MayMove(std::int64_t frames) const {
  return solver_.Running() ? frames >= solved_due_ : adjuster_.Due(frames);
}

// What the pose graph has found, if it enters now; waits for it.
std::optional<LoopCloser::Update> LoopCloser::Solved(const Odometry& odometry, std::int64_t frames,
                                                     Entering entering) {
  if (!solver_.Running()) {
    if (none_agreed_since_ == changes_) return std::nullopt;
    const std::vector<std::size_t> agreed = InState(LoopState::kAgreed);
    if (!agreed.empty()) return Enter(agreed, odometry, frames);
    none_agreed_since_ = changes_;
    return std::nullopt;
  }
  if (entering == Entering::kWhenDue && frames < solved_due_) return std::nullopt;
  const ScopedSpan span(recorder_, Lane::kOptimisation, "enter_correction");
  const internal::Stopwatch watch;
  const LoopSolution solution = solver_.Take();
  stages_["loop_solve"] += solution.time_ms;
  for (const LoopVerdict& verdict : solution.verdicts) TakeVerdict(verdict);
  Update update;
  if (solution.moves) {
    const std::vector<std::size_t> accepted = InState(LoopState::kInMap);
    for (std::size_t i = 0; i < accepted.size(); ++i) {
      loops_[accepted[i]].weight = solution.correction.loops[i].weight;
      if (solution.correction.loops[i].weight < kNoWeight) Revoke(&loops_[accepted[i]]);
    }
    update.correction = MoveBy(solution.correction, odometry);
    proof_ = solution.proof;
    if (options_.global_adjustment) {
      adjust_piece_ = odometry.map().keyframe(loops_[accepted.back()].edge.candidate).piece;
      std::vector<std::size_t> untied;
      for (const std::size_t loop : accepted) {
        if (loops_[loop].untied) untied.push_back(loop);
      }
      std::sort(untied.begin(), untied.end());
      Fuse(untied, &update);
    }
  }
  stages_["loop_optimize"] += watch.Milliseconds();
  return update;
}

MapCorrection LoopCloser::MoveBy(const KeyframeCorrection& solved, const Odometry& odometry) {
  MapCorrection correction;
  const std::vector<MapKeyframe> now = KeyframesOf(odometry.map());
  correction.S_world_keyframe = MovedAsSolved(solved, solved_keyframes_, now);
  correction.merges = solved.merges;
  ++corrections_;
  graph_.Update(now, Covisible(odometry.map()));
  graph_.Move(correction.S_world_keyframe, correction.merges);
  Rescale(correction.S_world_keyframe);
  return correction;
}

void LoopCloser::Rescale(const std::map<int, Similarity>& S_world_keyframe) {
  for (Loop& loop : loops_) {
    if (loop.state != LoopState::kRejected) tutti::Rescale(S_world_keyframe, &loop.edge);
  }
}

void LoopCloser::Fuse(const std::vector<std::size_t>& loops, Update* update) const {
  update->fused = loops;
  for (const std::size_t loop : loops) {
    const LoopEdge& edge = loops_[loop].edge;
    update->correction->fused.push_back({edge.candidate, edge.query, edge.S_candidate_query});
  }
}

// What the adjustment of the whole map has found, if it enters now; waits for it.
std::optional<LoopCloser::Update> LoopCloser::Adjusted(const Odometry& odometry, std::int64_t frames,
                                                       Entering entering) {
  if (solver_.Running() || !adjuster_.Running()) return std::nullopt;
  if (entering == Entering::kWhenDue && !adjuster_.Due(frames)) return std::nullopt;
  const ScopedSpan span(recorder_, Lane::kOptimisation, "enter_adjustment");
  const internal::Stopwatch watch;
  Update update;
  auto adjustment = std::make_shared<const GlobalAdjustment>(adjuster_.Take());
  if (auto moved = adjustment->Correction(odometry.map())) {
    Rescale(*moved);
    update.correction.emplace();
    update.correction->S_world_keyframe = std::move(*moved);
    update.correction->adjustment = std::move(adjustment);
    ++adjustments_;
  }
  stages_["global_adjustment"] += watch.Milliseconds();
  return update;
}

// A correction has been applied. `common`: what Odometry::Correct returned.
void LoopCloser::Applied(const Update& update, const std::vector<int>& common, const Odometry& odometry,
                         std::int64_t frames) {
  for (std::size_t i = 0; i < common.size(); ++i) {
    if (common[i] >= kLeastCommon) loops_[update.fused[i]].untied = false;
  }
  if (update.correction->adjustment) {
    // The map as it is says more than what was measured before; a loop that it contradicts keeps its own.
    graph_.MeasureAgain();
    for (const std::size_t accepted : InState(LoopState::kInMap)) {
      LoopEdge& edge = loops_[accepted].edge;
      const Similarity in_map(odometry.map().keyframe(edge.candidate).T_world_camera.Inverse() *
                              odometry.map().keyframe(edge.query).T_world_camera);
      const Disagreement d = tutti::Measure(edge.S_candidate_query * in_map.Inverse(), edge.depth);
      if (!Contradicts(d)) edge.S_candidate_query = in_map;
    }
  }
  // To adjust the map without a loop that landmarks do not tie would open that loop again.
  if (adjust_piece_ && AllTied()) adjuster_.MapMoved(odometry, *adjust_piece_, frames);
  adjust_piece_.reset();
}

bool LoopCloser::AllTied() const {
  return std::none_of(loops_.begin(), loops_.end(), [](const Loop& loop) { return loop.untied; });
}

// After the last loop: lets in what the map fulfils and what therefore waited for a correction. True if the
// graph is solved for it, which is due as usual; a followed odometry may stay as it is.
bool LoopCloser::CloseDeferred(const Odometry& odometry, std::int64_t frames) {
  const std::vector<std::size_t> deferred = InState(LoopState::kDeferred);
  if (deferred.empty()) return false;
  if (!LeavesAsItIs(deferred, odometry.map())) {
    Solve(deferred, odometry, frames);
    return true;
  }
  for (const LoopEdge& edge : EdgesOf(deferred)) TakeVerdict({edge, "", false, 1, std::nullopt});
  return false;
}

// Into the map, or out.
void LoopCloser::TakeVerdict(const LoopVerdict& verdict) {
  Loop& loop = loops_[verdict.loop.record];
  SetState(verdict.loop.record, verdict.reason.empty() ? LoopState::kInMap : LoopState::kRejected);
  loop.reason = verdict.reason;
  loop.weight = verdict.weight;
  loop.gate_sigmas = verdict.gate_sigmas;
  if (loop.accepted()) return;
  loop.untied = false;
  if (verdict.contradicted) Revoke(&loop);
}

// What the map contradicts is no loop for the detector's filter either.
void LoopCloser::Revoke(Loop* loop) {
  if (loop->injected || loop->revoked) return;
  loop->revoked = true;
  if (worker_) worker_->Unlink(loop->query, loop->candidate);
}

// The detector decides anew about this frame: what waits of it is no loop, without a graph (images without
// poses) what was accepted neither. What the gate has let in is left to the pose graph, which weighs it.
void LoopCloser::Withdraw(std::int64_t query_frame, const std::string& reason, bool has_graph) {
  for (Loop& loop : loops_) {
    const bool open = loop.state == LoopState::kWaiting || (loop.accepted() && !has_graph);
    if (loop.query != query_frame || !open) continue;
    loop.state = LoopState::kRejected;
    loop.verified = false;
    loop.reason = reason;
  }
}

void LoopCloser::Check(int end, const internal::SectionReader& file) const {
  for (std::size_t i = 0; i < loops_.size(); ++i) {
    const Loop& loop = loops_[i];
    internal::CheckIndex(static_cast<int>(loop.state), 0, static_cast<int>(LoopState::kInMap) + 1, file);
    if (loop.state == LoopState::kRejected || loop.edge.candidate == loop.edge.query) continue;
    internal::CheckIndex(loop.edge.candidate, 0, end, file);
    internal::CheckIndex(loop.edge.query, 0, end, file);
    if (loop.edge.record != i) file.Damaged("a loop that is not listed");
  }
  for (const MapKeyframe& keyframe : solved_keyframes_) internal::CheckIndex(keyframe.id, 0, end, file);
  for (const auto& [frame, keyframe] : keyframe_of_frame_) internal::CheckIndex(keyframe, 0, end, file);
}

}  // namespace tutti
