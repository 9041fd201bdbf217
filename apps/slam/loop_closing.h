// The half of SLAM that finds loops and closes them, for an odometry that somebody else runs.
//
//   while (auto update = loops.Due(odometry, frames)) {    // before each frame
//     if (update->correction) loops.Applied(*update, odometry.Correct(*update->correction), odometry, frames);
//   }
//   loops.Submit(frame, &view, frames);                    // after it, for each keyframe
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/slam/loop_closer.h"
#include "apps/slam/loop_worker.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// Detector and LoopCloser: keyframes go in, and what they do to the map comes out a fixed number of frames
/// later. `odometry`: null without calibration (loops between appearances alone), else always the same.
/// `frames`: number of frames so far.
class LoopClosing {
 public:
  /// `recorder` may be null. `resumes`: State will be read into it.
  LoopClosing(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder, bool resumes = false);

  /// Calls `listener` with each answer of the detector before it is considered.
  void SetDetectionListener(std::function<void(const LoopResult&)> listener);

  void SwapListener(LoopClosing* other) { on_detection_.swap(other->on_detection_); }

  /// True if loops are searched for (run.loops).
  bool Searching() const { return worker_ != nullptr; }
  /// Another recording begins, of this rig, with this frame number and keyframe. Nothing may be on its way.
  void BeginSession(const CameraRig& rig, std::int64_t first_frame, int first_keyframe);
  /// The loops of another map whose keyframes have been appended to this one's; its first frame and first
  /// keyframe have these numbers here. Its places are to be compared then (Compare).
  void Append(const LoopClosing& other, std::int64_t first_frame, int first_keyframe) {
    session_ = first_frame;
    closer_.Append(other.closer_, first_frame, first_keyframe);
  }
  /// The places that the detector knows, in their order.
  std::vector<LoopPlace> Places() const { return worker_->Places(); }
  /// The keyframe that is a place of this detector; -1: none.
  int KeyframeOf(std::int64_t frame) const;
  /// What is proposed when the places of another map, which get frame numbers from this one on, are shown to
  /// the detector, one after the other: all loops between the two, verified or not. None enters. `view`: of
  /// the keyframe that the frame with such a number is, null: it is none. Nothing may be on its way.
  std::vector<ProposedLoop> Compare(
      std::vector<LoopPlace> places, std::int64_t first_frame,
      const std::function<std::optional<KeyframeView>(std::int64_t frame)>& view);
  /// LoopCloser::Join. What stays outside is no loop for the detector either.
  std::string Join(const std::vector<ProposedLoop>& loops, const Odometry& odometry, std::int64_t frames);
  /// The whole map moves, and nothing in it: the keyframes to these poses. To be applied at once. The
  /// detector forgets where places are.
  LoopUpdate MoveAll(const std::map<int, Similarity>& S_world_keyframe, const Odometry& odometry);
  /// A new keyframe as the map has it, null: an image without a pose. Those that come too soon after the one
  /// before (loop_every_keyframes, loop_min_interval_s) are not searched.
  void Submit(const InputFrame& frame, const KeyframeView* view, std::int64_t frames);
  /// As LoopCloser.
  void NoteStep(int keyframe, const StepCheck& check) { closer_.NoteStep(keyframe, check); }
  void FollowOdometry(const StampedPose& T_odom_camera, const Odometry& odometry) {
    closer_.FollowOdometry(T_odom_camera, odometry);
  }
  void NoteMotion(int keyframe, const MotionSigma& sigma, const Eigen::Vector3d& position) {
    closer_.NoteMotion(keyframe, sigma, position);
  }
  /// The keyframe that shows the place of a lost frame; -1 if none is known.
  int Locate(const InputFrame& frame);
  /// A loop from elsewhere (LoopCloser::Add).
  void Add(int candidate, int query, const Similarity& S_candidate_query, const Matrix7d& information,
           const Odometry& odometry, std::int64_t frames) {
    closer_.Add(candidate, query, S_candidate_query, information, odometry, frames);
  }

  /// A loop that was found between two keyframes of the map, and its verification.
  LoopUpdate ConsiderFound(const Verification& found, int candidate, int query, const Odometry& odometry,
                           std::int64_t frames);
  /// LoopCloser::Converge.
  bool Converge(const Odometry& odometry, int piece) { return closer_.Converge(odometry, piece); }

  /// True if Due may move the map: mapping that is under way should be brought in first.
  bool MayMove(std::int64_t frames) const { return closer_.MayMove(frames); }
  /// The next thing that is due; nothing if all is in. A correction is to be applied before the next call.
  std::optional<LoopUpdate> Due(const Odometry* odometry, std::int64_t frames);
  /// The same after the last frame, for all that is on its way.
  std::optional<LoopUpdate> Rest(const Odometry* odometry, std::int64_t frames);
  /// To be called when a correction has been applied. `common`: what Odometry::Correct returned.
  void Applied(const LoopUpdate& update, const std::vector<int>& common, const Odometry& odometry,
               std::int64_t frames) {
    closer_.Applied(update, common, odometry, frames);
  }

  /// Before a keyframe is removed: the detector forgets what it looks like, and its place is that of `into`.
  /// False if it can't do without: the keyframe must stay then.
  bool Forget(int keyframe, int into, const Odometry& odometry);
  /// When keyframes were removed: which one stands for each; `before`: the odometry with all of them. Nothing
  /// may be on its way.
  void Removed(const std::map<int, int>& into, const Odometry& before);

  const LoopCloser& closer() const { return closer_; }

  /// The detector, for a saved map; none if no loops are searched for. As LoopWorker::Save.
  std::shared_future<std::shared_ptr<const LoopWorker::Saved>> SaveDetector() const;
  /// What the closer is waiting for.
  LoopCloser::Pending pending() const { return closer_.pending(); }
  /// All else that it knows.
  template <class Archive>
  void State(Archive& archive) {
    archive(closer_, submitted_, late_, keyframe_of_frame_, stamps_, keyframes_seen_, warnings_,
            last_warning_, stages_, session_);
  }
  /// Of that. Throws InputError where it names a keyframe that the odometry (nullptr: none) has not.
  void Check(const Odometry* odometry, const internal::SectionReader& file) const;
  /// Reads the detector from a map, and touches nothing else: it may run beside what reads the rest.
  void ResumeDetector(internal::SectionReader* file);
  void ResumePending(std::optional<LoopSolution> solution, std::optional<GlobalAdjustment> adjustment) {
    closer_.Resume(std::move(solution), std::move(adjustment));
  }

  /// What went wrong without stopping it since the last call.
  std::vector<std::string> TakeWarnings();
  void Warn(std::string warning) { warnings_.push_back(std::move(warning)); }
  /// Milliseconds spent, summed, by stage.
  std::map<std::string, double> StageMilliseconds() const;

 private:
  struct Submission {
    std::int64_t due = 0;  // number of frames after which its answer enters
    std::int64_t frame = 0;
    template <class Archive>
    void State(Archive& archive) {
      archive(due, frame);
    }
  };
  LoopUpdate Deliver(const Odometry* odometry, std::int64_t frames);
  LoopUpdate Decide(const LoopRecord& proposed, const Verification& verification, const Odometry* odometry,
                    std::int64_t frames);
  LoopUpdate DeliverLate(const Odometry* odometry, std::int64_t frames);
  LoopResult TakeResult();
  void TellRevoked(const LoopUpdate& update);
  LoopRecord Record(const LoopResult& result) const;
  LoopRecord Record(const LateLoop& late) const;
  LoopRecord RecordOf(std::int64_t query, std::int64_t candidate, const Verification& verification) const;
  void Ask(LoopQuery query, const KeyframeView* view, std::int64_t frames);

  SlamOptions options_;
  CameraRig rig_;
  LoopCloser closer_;
  std::unique_ptr<LoopWorker> worker_;                   // null: no loops
  std::function<void(const LoopResult&)> on_detection_;  // may be empty
  std::deque<Submission> submitted_;
  std::optional<LateLoop> late_;                   // came with the last answer, and is considered next
  std::map<std::int64_t, int> keyframe_of_frame_;  // of the frames that the detector knows
  std::map<std::int64_t, double> stamps_;          // the same
  std::int64_t keyframes_seen_ = 0;
  std::vector<std::string> warnings_;  // not taken yet
  std::string last_warning_;
  std::size_t jumps_told_ = 0;  // of the odometry that is followed
  std::map<std::string, double> stages_;
  std::int64_t session_ = 0;  // frame number that the present recording began with
};

}  // namespace tutti
#pragma GCC visibility pop
