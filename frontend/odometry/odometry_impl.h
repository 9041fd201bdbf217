// The steps of Odometry: each part does one thing, and knows none of the others.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "core/section_file.h"
#include "core/stopwatch.h"
#include "frontend/odometry/async_mapper.h"
#include "frontend/odometry/camera_height.h"
#include "frontend/odometry/frame_history.h"
#include "frontend/odometry/localizer.h"
#include "frontend/odometry/map_initializer.h"
#include "frontend/odometry/pose_follower.h"
#include "frontend/odometry/relocalizer.h"
#include "frontend/odometry/rolling_start.h"
#include "frontend/odometry/tracker.h"
#include "tutti/frontend/odometry.h"

namespace tutti {

class Odometry::Impl {
 public:
  Impl(const OdometryOptions& options, const CameraRig& rig);

  /// Into an object that is new, for the rig of a recording that begins: the map of `before` and where its
  /// frames were. Nothing may be under way there.
  void GoOn(const Impl& before, std::int64_t frame_offset);

  /// The map of another one, and where its frames were, into one that has gone on (GoOn) and tracked nothing.
  void Append(const Impl& other, std::int64_t frame_offset);

  TrackResult Track(const InputFrame& frame);
  TrackResult Follow(const InputFrame& frame, const Pose& T_odom_camera);
  TrackResult RelocalizeAt(int keyframe);
  void BeginLocalization();
  std::optional<Matrix6d> PoseCovariance() const;
  /// Waits for the mapping that is under way, if any, and brings its result in.
  void EnterMapping();
  /// Moves keyframes, and what hangs on them, and joins pieces. With an adjustment (else null), landmarks get
  /// what it made of them.
  void Correct(const std::map<int, Similarity>& S_world_keyframe, const std::map<int, int>& merges,
               const GlobalAdjustment::Work* adjustment);
  void FuseAll();
  int FuseLoop(int older, int newer, const Similarity& S_older_newer);
  std::map<int, int> RemoveRedundantKeyframes(const std::function<bool(int removed, int into)>& may);

  /// Everything but options, rig, recorder and whether to use threads, section by section.
  void Save(const internal::SectionSink& sink) const;
  /// Takes up what Save gave, into an object that is new. After an InputError it is of no use.
  void Load(internal::SectionReader* file);
  template <class Archive>
  void State(Archive& archive) {
    archive(mapper_, initializer_, tracker_, relocalizer_, history_, result_, row_errors_, stereo_matches_,
            frame_offset_, session_piece_, height_, first_unmoved_);
  }

  const OdometryOptions& options() const { return options_; }
  const CameraRig& rig() const { return rig_; }
  const Map& map() const { return mapper_.map(); }
  const AsyncMapper& mapper() const { return mapper_; }
  const FrameHistory& history() const { return history_; }
  const LastFrame& last() const { return tracker_.last(); }
  const CameraHeight& height() const { return height_; }
  const Localizer& localizer() const { return localizer_; }
  std::int64_t frame_offset() const { return frame_offset_; }
  int session_piece() const { return session_piece_; }
  const StageTimes& stages() const { return stages_; }
  const std::vector<double>& row_errors() const { return row_errors_; }
  const std::vector<double>& stereo_matches() const { return stereo_matches_; }
  std::vector<int> TakeMapped() { return mapper_.TakeMapped(); }
  void UseOwnThreads(bool own_threads) { mapper_.UseOwnThreads(own_threads); }
  void SetRecorder(SpanRecorder* recorder) { stages_.recorder = recorder; }

 private:
  TrackedFrame Prepare(const InputFrame& input, int features);
  Tracker::Tracked Look(const TrackedFrame& frame);
  Tracker::Tracked LookFromStart(const TrackedFrame& frame);
  TrackResult Initialize(const TrackedFrame& frame);
  TrackResult FollowFirst(const TrackedFrame& frame, const Pose& T_odom_camera);
  TrackResult TrackMap(const TrackedFrame& frame, const Tracker::Tracked& tracked);
  TrackResult Accept(const Tracker::Tracked& tracked);
  bool BecomesKeyframe(const Tracker::Tracked& tracked) const;
  int InsertKeyframe();
  void KeepScale();
  void MoveMap(const std::map<int, Similarity>& S_world_keyframe, const std::map<int, int>& merges,
               const GlobalAdjustment::Work* adjustment);
  void Check(const internal::SectionReader& file) const;

  OdometryOptions options_;
  CameraRig rig_;
  StageTimes stages_;
  AsyncMapper mapper_;
  MapInitializer initializer_;
  Tracker tracker_;
  RollingStart rolling_start_;
  Relocalizer relocalizer_;
  PoseFollower follower_;
  Localizer localizer_;
  CameraHeight height_;
  FrameHistory history_;
  TrackResult result_;                               // of the last frame
  std::vector<double> row_errors_, stereo_matches_;  // stereo: of each pair
  std::int64_t frame_offset_ = 0;                    // of the recording, in the map's numbers
  int first_unmoved_ = 0;                            // keyframe from which on no loop has moved any
  int session_piece_ = 0;                            // that the recording began with
};

}  // namespace tutti
