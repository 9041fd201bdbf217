// From a verified loop to a corrected map.
//
//   LoopUpdate update = closer.Consider(...);                         // or *closer.Due(...)
//   closer.Applied(update, odometry.Correct(*update.correction), odometry, frames);
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "apps/slam/followed_odometry.h"
#include "apps/slam/global_adjuster.h"
#include "apps/slam/loop_constraint.h"
#include "apps/slam/loop_gate.h"
#include "apps/slam/loop_solver.h"
#include "apps/slam/loop_update.h"
#include "core/section_file.h"
#include "tutti/core/span_recorder.h"
#include "tutti/core/trajectory.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/slam/config.h"
#include "tutti/slam/loop_record.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// What is worked out beside the tracking enters when it is due; at the end of a recording at once.
enum class Entering { kWhenDue, kAtOnce };

/// Reasons of loops that the detector decides anew (LateLoop).
inline constexpr const char* kTakenBack = "the detector has taken it back, by the images that came next";
inline constexpr const char* kDecidedLater =
    "decided anew by the images that came next: in a line further down";

/// A loop between two keyframes of the map, as it was proposed.
struct ProposedLoop {
  LoopRecord record;
  Verification verification;
  int candidate = -1, query = -1;
};

/// Measures verified loops against the odometry's map, lets those in that agree, and works out how the map
/// is to move; it never touches the map itself. The pose graph is solved beside the tracking, and its answer
/// is due a number of frames later that depends on the size of the map alone; so it is with the adjustment
/// of the whole map after that. What becomes of a loop is written into its record.
///
/// `frames` is the number of frames so far, `odometry` always the same.
class LoopCloser {
 public:
  LoopCloser(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder);

  /// Another recording begins, of this rig, with this frame number and keyframe. Nothing may be under way.
  /// Counts and times begin anew.
  void BeginSession(const CameraRig& rig, std::int64_t first_frame, int first_keyframe);

  /// The loops of another map, whose first frame and first keyframe have these numbers in this one.
  void Append(const LoopCloser& other, std::int64_t first_frame, int first_keyframe);

  /// A proposed loop, in the order of the queries. `candidate`, `query`: its keyframes; they have a place in
  /// the map. The update is to be applied at once. `across`: as LoopGate::Offer.
  /// One that is not verified is considered if IsWitness: it enters only with a verified one.
  LoopUpdate Consider(const LoopRecord& proposed, const Verification& verification, int candidate, int query,
                      const Odometry& odometry, std::int64_t frames, bool across = false);
  /// The detector decides anew about this frame: what waits of it in the gate is no loop, for this reason;
  /// without a graph (images without poses) what was accepted neither. What the gate has let in is left to
  /// the pose graph, which weighs it.
  void Withdraw(std::int64_t query_frame, const std::string& reason, bool has_graph);
  /// Loops between two maps, of which the second one was appended (Append): those join them that
  /// ChooseJoiningLoops says, all at once. Why none does; empty: the graph is being solved with them.
  /// `update`: says which others the detector is to forget.
  std::string Join(const std::vector<ProposedLoop>& proposed, const Odometry& odometry, std::int64_t frames,
                   LoopUpdate* update);
  /// What the images say of a step of the odometry that is followed, which led to this keyframe: if it is
  /// less certain than configured, loops are judged by what they say from the next one on. The graph takes
  /// the step to be off by as much as they clearly contradict it.
  void NoteStep(int keyframe, const StepCheck& check);
  /// The odometry that is followed says how uncertain its motion since the last call is, which led to this
  /// position, and to this keyframe if it is not -1. It counts in place of what is configured.
  void NoteMotion(int keyframe, const MotionSigma& sigma, const Eigen::Vector3d& position);
  /// The poses are somebody else's: where they differ from all loops by no more than loops err themselves
  /// (LoopGate::WithinNoise), they stay as they are. Where such a pose is wrong or the odometry began anew
  /// (FindJumps) and the images don't confirm the step, the graph believes no step.
  void FollowOdometry(const StampedPose& T_odom_camera, const Odometry& odometry);
  /// Marks these jumps in the graph, those up to the last pose as well if there are `all`.
  void JudgeJumps(const Odometry& odometry, bool all);
  const FollowedOdometry& followed() const { return followed_; }

  /// A proposed loop between images without poses.
  void List(const LoopRecord& proposed) { records_.push_back(proposed); }
  /// A loop that is not the detector's: past the gate into the pose graph, which may refuse it.
  void Add(int candidate, int query, const Similarity& S_candidate_query, const Matrix7d& information,
           const Odometry& odometry, std::int64_t frames);

  /// True if Solved or Adjusted may move the map now: mapping that is under way should be brought in first.
  bool MayMove(std::int64_t frames) const {
    return solver_.Running() ? frames >= solved_due_ : adjuster_.Due(frames);
  }
  /// What the pose graph has found, if it enters now; waits for it.
  std::optional<LoopUpdate> Solved(const Odometry& odometry, std::int64_t frames,
                                   Entering entering = Entering::kWhenDue);
  /// What the adjustment of the whole map has found, if it enters now; waits for it.
  std::optional<LoopUpdate> Adjusted(const Odometry& odometry, std::int64_t frames,
                                     Entering entering = Entering::kWhenDue);
  /// The whole piece of the map is adjusted until it converges; what comes of it is Adjusted's. False if a
  /// loop is not held together by landmarks: the adjustment would open it again.
  bool Converge(const Odometry& odometry, int piece);
  /// After the last loop: lets in what the map fulfils and what therefore waited for a correction. True if
  /// the graph is solved for it, which is due as usual; a followed odometry may stay as it is.
  bool CloseDeferred(const Odometry& odometry, std::int64_t frames);
  /// After the last loop, when nothing is due any more.
  void Finish();

  /// Each piece of the map moves as a whole, such that keyframes are there. To be applied at once.
  LoopUpdate MoveAll(const std::map<int, Similarity>& S_world_keyframe, const Odometry& odometry);

  /// To be called when an update with a correction has been applied. `common`: what Odometry::Correct returned.
  void Applied(const LoopUpdate& update, const std::vector<int>& common, const Odometry& odometry,
               std::int64_t frames);

  /// When keyframes were removed: which one stands for each; `before`: the odometry with all of them. Their
  /// edges lead to those that stand for them. Nothing may be running.
  void Removed(const std::map<int, int>& into, const Odometry& before);

  /// What is being worked out beside the tracking, for a saved map; it holds on to that.
  struct Pending {
    BackgroundLoopSolver::Pending solution;  ///< not valid: none
    std::optional<GlobalAdjustment> adjustment;
  };
  Pending pending() const { return {solver_.pending(), adjuster_.pending()}; }
  /// Goes on as if this were what is being worked out.
  void Resume(std::optional<LoopSolution> solution, std::optional<GlobalAdjustment> adjustment);
  /// All else that it knows.
  template <class Archive>
  void State(Archive& archive) {
    archive(records_, gate_, graph_, accepted_, deferred_, queued_, untied_, solved_due_, solved_keyframes_,
            adjust_piece_, adjuster_, proof_, corrections_, adjustments_, stages_, sessions_);
  }

  /// Of what was loaded. Throws InputError where it names a keyframe from `end` on.
  void Check(int end, const internal::SectionReader& file) const;

  const std::vector<LoopRecord>& records() const { return records_; }
  /// Keyframes, odometry edges and accepted loops at the present poses.
  PoseGraph Graph(const Odometry& odometry) const;
  /// Of the last solution that moved the map, with graph.certify.
  const std::optional<KeyframeGraphProof>& proof() const { return proof_; }
  int Corrections() const { return corrections_; }
  int Adjustments() const { return adjustments_; }
  /// Milliseconds spent, summed, by stage.
  const std::map<std::string, double>& StageMilliseconds() const { return stages_; }

 private:
  LoopConstraint Measure(const Verification& verification, int candidate, int query,
                         const Odometry& odometry);
  /// Pairs that the pose graph has edges for beside consecutive keyframes. None where images judge steps:
  /// keyframes stand where the odometry says, so a pair would say once more what the steps between it said.
  /// After an adjustment they stand where the images say.
  std::vector<CovisiblePair> Covisible(const Odometry& odometry) const;
  void SetSigmas();
  bool LeavesAsItIs(const std::vector<LoopEdge>& entering, const Odometry& odometry) const;
  LoopUpdate Enter(std::vector<LoopEdge> entering, const Odometry& odometry, std::int64_t frames);
  void Start(std::vector<LoopEdge> entering, const Odometry& odometry, std::int64_t frames);
  LoopGate::Trust TrustIn(const LoopEdge& loop, const Odometry& odometry) const;
  bool IsWitness(const LoopRecord& record, const Verification& verification) const;
  void NoteWitnesses(const LoopGate::Admitted& admitted);
  void Settle(const LoopVerdict& verdict, LoopUpdate* update);
  void Revoke(std::size_t record, LoopUpdate* update);
  MapCorrection MoveBy(const KeyframeCorrection& solved, const Odometry& odometry);
  void Rescale(const std::map<int, Similarity>& S_world_keyframe);
  static void Fuse(const std::vector<LoopEdge>& loops, LoopUpdate* update);
  std::vector<LoopEdge> Untied() const;
  bool OfOneSession(std::int64_t frame, std::int64_t other) const;

  SpanRecorder* recorder_;
  SlamOptions options_;
  CameraRig rig_;
  LoopDetectorOptions detector_;
  std::vector<LoopRecord> records_;
  FollowedOdometry followed_;
  LoopGate gate_;
  KeyframeGraph graph_;
  std::vector<LoopEdge> accepted_;  // in the map
  std::vector<LoopEdge> deferred_;  // agreed, and the map fulfils them: they enter with the next correction
  std::vector<LoopEdge> queued_;    // agreed while the pose graph was being solved
  std::set<std::size_t> untied_;    // records of loops that landmarks do not hold together yet
  BackgroundLoopSolver solver_;
  std::int64_t solved_due_ = 0;                // number of frames
  std::vector<MapKeyframe> solved_keyframes_;  // the map as it was when solving began
  std::optional<int> adjust_piece_;            // map piece to be adjusted once the correction was applied
  GlobalAdjuster adjuster_;
  std::optional<KeyframeGraphProof> proof_;
  int corrections_ = 0;
  int adjustments_ = 0;  // of the whole map
  std::map<std::string, double> stages_;
  std::vector<std::int64_t> sessions_;  // first frame numbers of recordings but the first, ascending
};

}  // namespace tutti
#pragma GCC visibility pop
