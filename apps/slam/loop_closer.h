// Loop closing: keyframes go in, and what their loops do to the map happens a fixed number of frames later.
//
//   loops.Due(&odometry, frames);               // before each frame
//   loops.AddKeyframe(frame, &view, frames);    // after it, for each keyframe whose landmarks are known
//   loops.Finish(&odometry, frames);            // after the last one
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/slam/followed_odometry.h"
#include "apps/slam/global_adjuster.h"
#include "apps/slam/loop_constraint.h"
#include "apps/slam/loop_gate.h"
#include "apps/slam/loop_solver.h"
#include "apps/slam/loop_worker.h"
#include "core/section_file.h"
#include "tutti/core/span_recorder.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/odometry.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/slam/config.h"
#include "tutti/slam/loop.h"
#include "tutti/slam/slam_report.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// Whom a LoopCloser tells; each may be empty.
struct LoopListener {
  /// Each answer of the detector, before it is considered.
  std::function<void(const LoopResult&)> on_detection;
  /// The map may change next: what is being mapped is to be brought in (Odometry::FinishMapping).
  std::function<void()> before_change;
};

/// A loop between two keyframes of the map that was not proposed by the detector for a new keyframe.
struct FoundLoop {
  int candidate = -1, query = -1;  ///< keyframes, the older one first
  Verification verification;
  /// Somebody knows it (a marker, a survey, a test): it goes past the gate into the pose graph, with
  /// verification.S_candidate_query and this information of (translation, rotation, log scale).
  std::optional<Matrix7d> known;
};

/// Owns the detector and its thread, the gate, the pose graph and its solver. The detector proposes loops for
/// keyframes; those that are verified are measured against the map, and enter when something else says the
/// same (LoopGate). The pose graph is solved beside the tracking, and its answer is due a number of frames
/// later that depends on the size of the map alone; so it is with the adjustment of the whole map after that.
/// What becomes of a loop is written into its Loop.
///
/// `odometry`: null without calibration (loops between appearances alone), else always the same.
/// `frames`: number of frames so far.
class LoopCloser {
 public:
  /// `recorder` may be null. `resumes`: MapFile will read a state into it.
  LoopCloser(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder,
             LoopListener listener = {}, bool resumes = false);

  /// A new keyframe as the map has it, null: an image without a pose. Those that come too soon after the one
  /// before (loop_every_keyframes, loop_min_interval_s) are not searched.
  void AddKeyframe(const InputFrame& frame, const KeyframeView* keyframe, std::int64_t frames);
  void AddLoop(const FoundLoop& found, Odometry* odometry, std::int64_t frames);
  /// What another odometry says, which the map follows: `result` is what became of its frame. Where the
  /// images say that a step is less certain than configured, loops are judged by that. `sigma`: how uncertain
  /// it says its motion since the frame before is, which counts in place of what is configured. Where its
  /// poses are wrong or it began anew (FindJumps) and the images don't confirm the step, the graph believes
  /// no step.
  void Follow(const TrackResult& result, const StampedPose& T_odom_camera,
              const std::optional<MotionSigma>& sigma, const Odometry& odometry);

  /// Brings in what is due.
  void Due(Odometry* odometry, std::int64_t frames);
  /// After the last frame: brings in all that is on its way, and says of each loop what became of it.
  void Finish(Odometry* odometry, std::int64_t frames);

  /// Another recording begins, of this rig, with this frame number and keyframe. Nothing may be on its way.
  /// Counts and times begin anew.
  void BeginSession(const CameraRig& rig, std::int64_t first_frame, int first_keyframe);
  /// The keyframe that shows the place of a frame; -1 if none is known.
  int Locate(const InputFrame& frame);
  /// Nothing can be recognised by fewer.
  static constexpr int kFewestFeatures = 100;
  /// Removes keyframes that the map can do without (tutti::Prune). Their edges and places go over to those
  /// that stand for them. Nothing may be on its way. Returns how many went.
  std::size_t Prune(Odometry* odometry);

  /// Every proposed loop in the order of the queries.
  const std::vector<Loop>& loops() const { return loops_; }
  /// Keyframes, odometry edges and accepted loops at the present poses.
  PoseGraph Graph(const Map& map) const;
  /// All but SlamReport::relocalized.
  SlamReport Report() const;
  /// What went wrong without stopping it since the last call.
  std::vector<std::string> TakeWarnings();

 private:
  friend class MapMerge;        // shows the places of one map to the detector of the other
  friend class MapConnection;   // adjusts the map until it converges
  friend class SubmapJoiner;    // asks which keyframes are of one recording
  friend class MapFile;         // saves it
  friend class LoopCloserPeer;  // tests its decisions one by one

  enum class Entering { kWhenDue, kAtOnce };
  struct Submission {
    std::int64_t due = 0;  // number of frames after which its answer enters
    std::int64_t frame = 0;
    template <class Archive>
    void State(Archive& archive) {
      archive(due, frame);
    }
  };
  // What is to be done to the map, if anything.
  struct Update {
    std::optional<MapCorrection> correction;
    std::vector<std::size_t> fused;  // loops of MapCorrection::fused
  };

  // Keyframes and answers of the detector: loop_closer.cc.
  bool BringInNext(Odometry* odometry, std::int64_t frames, Entering entering);
  void Take(const Update& update, Odometry* odometry, std::int64_t frames);
  void Ask(LoopQuery query, const KeyframeView* view, std::int64_t frames);
  LoopResult TakeResult();
  Update Deliver(const Odometry* odometry, std::int64_t frames);
  Update DeliverLate(const Odometry* odometry, std::int64_t frames);
  Update Decide(Loop proposed, const Verification& verification, const Odometry* odometry,
                std::int64_t frames);
  Loop Proposed(const LoopResult& result) const;
  Loop Proposed(const LateLoop& late) const;
  Loop Proposed(std::int64_t query, std::int64_t candidate, const Verification& verification) const;
  int KeyframeOf(std::int64_t frame) const;  // -1: the detector does not know the frame
  void Say();

  // Which loops enter, and how the map moves then: loop_decisions.cc.
  Update Consider(Loop proposed, const Verification& verification, int candidate, int query,
                  const Odometry& odometry, std::int64_t frames, bool across = false);
  Update Enter(const std::vector<std::size_t>& entering, const Odometry& odometry, std::int64_t frames);
  void Solve(const std::vector<std::size_t>& entering, const Odometry& odometry, std::int64_t frames);
  std::optional<Update> Solved(const Odometry& odometry, std::int64_t frames, Entering entering);
  std::optional<Update> Adjusted(const Odometry& odometry, std::int64_t frames, Entering entering);
  bool CloseDeferred(const Odometry& odometry, std::int64_t frames);
  bool MayMove(std::int64_t frames) const;
  MapCorrection MoveBy(const KeyframeCorrection& solved, const Odometry& odometry);
  void Applied(const Update& update, const std::vector<int>& common, const Odometry& odometry,
               std::int64_t frames);
  void Withdraw(std::int64_t query_frame, const std::string& reason, bool has_graph);
  void TakeVerdict(const LoopVerdict& verdict);
  void Revoke(Loop* loop);
  void Fuse(const std::vector<std::size_t>& loops, Update* update) const;
  LoopConstraint Measure(const Verification& verification, int candidate, int query, const Map& map);
  LoopGate::Trust TrustIn(const LoopEdge& edge, const Map& map) const;
  bool IsWitness(const Loop& loop, const Verification& verification) const;
  void NoteWitnesses(const LoopGate::Admitted& admitted);
  bool LeavesAsItIs(const std::vector<std::size_t>& loops, const Map& map) const;
  void JudgeJumps(const Map& map, bool all);
  void SetSigmas();
  void NoteSteps(const Map& map);
  std::vector<CovisiblePair> Covisible(const Map& map) const;
  void Rescale(const std::map<int, Similarity>& S_world_keyframe);
  bool OfOneSession(std::int64_t frame, std::int64_t other) const;
  bool AllTied() const;
  void SetState(std::size_t loop, LoopState state);
  std::vector<std::size_t> InState(LoopState state) const;  // in the order in which they came into it
  std::vector<LoopEdge> EdgesOf(const std::vector<std::size_t>& loops) const;

  template <class Archive>
  friend void State(Archive& archive, LoopCloser& c) {
    archive(c.loops_, c.changes_, c.graph_, c.solved_due_, c.solved_keyframes_, c.adjust_piece_, c.adjuster_,
            c.proof_, c.corrections_, c.adjustments_, c.sessions_, c.submitted_, c.late_,
            c.keyframe_of_frame_, c.stamps_, c.keyframes_seen_, c.warnings_, c.last_warning_, c.stages_,
            c.session_);
  }
  /// Throws InputError where a state that was loaded names a keyframe from `end` on.
  void Check(int end, const internal::SectionReader& file) const;

  SpanRecorder* recorder_;
  LoopListener listener_;
  SlamOptions options_;
  CameraRig rig_;
  LoopDetectorOptions detector_;
  double pixel_sigma_;                  // of a corner [px]
  std::unique_ptr<LoopWorker> worker_;  // null: no loops
  std::deque<Submission> submitted_;
  std::optional<LateLoop> late_;                   // came with the last answer, and is considered next
  std::map<std::int64_t, int> keyframe_of_frame_;  // of the frames that the detector knows
  std::map<std::int64_t, double> stamps_;          // the same
  std::int64_t keyframes_seen_ = 0;
  std::vector<std::string> warnings_;  // not taken yet
  std::string last_warning_;
  std::size_t jumps_told_ = 0;          // of the odometry that is followed
  double waited_before_ = 0;            // for the detector, in earlier sessions [ms]
  std::int64_t session_ = 0;            // frame number that the present recording began with
  std::vector<std::int64_t> sessions_;  // those of recordings but the first, ascending

  std::vector<Loop> loops_;
  std::int64_t changes_ = 0;             // of their states
  std::int64_t none_agreed_since_ = -1;  // value of changes_: no need to look at all of them in each frame
  FollowedOdometry followed_;
  LoopGate gate_;
  KeyframeGraph graph_;
  BackgroundLoopSolver solver_;
  std::int64_t solved_due_ = 0;                // number of frames
  std::vector<MapKeyframe> solved_keyframes_;  // the map as it was when solving began
  std::optional<int> adjust_piece_;            // submap to be adjusted once the correction was applied
  GlobalAdjuster adjuster_;
  std::optional<KeyframeGraphProof> proof_;
  int corrections_ = 0;
  int adjustments_ = 0;  // of the whole map
  std::map<std::string, double> stages_;
};

/// Reason of a loop that the detector decides anew (LateLoop).
inline constexpr const char* kTakenBack = "the detector has taken it back, by the images that came next";

/// The submap that each keyframe belongs to, and its pose.
LoopGate::Places PlacesIn(const Map& map);
std::vector<MapKeyframe> KeyframesOf(const Map& map);

}  // namespace tutti
#pragma GCC visibility pop
