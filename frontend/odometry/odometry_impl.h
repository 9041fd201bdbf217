// The steps of Odometry: each part does one thing, and knows none of the others.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/section_file.h"
#include "core/stopwatch.h"
#include "frontend/imu/gravity.h"
#include "frontend/imu/imu_examination.h"
#include "frontend/odometry/async_mapper.h"
#include "frontend/odometry/camera_height.h"
#include "frontend/odometry/clock_estimate.h"
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

  /// Into an object that is new, for the rig of a recording that begins: the map that it goes on in, and what
  /// is known of the camera. Nothing may be under way in `before`.
  void GoOn(const Impl& before, Map map, std::int64_t frame_offset);

  TrackResult Track(const InputFrame& frame);
  TrackResult Follow(const InputFrame& frame, const Pose& T_odom_camera);
  TrackResult RelocalizeAt(int keyframe);
  void BeginLocalization();
  std::optional<Matrix6d> PoseCovariance() const;
  FrameView LastView() const;
  OdometryReport Report() const;
  /// Waits for the mapping that is under way, if any, and brings its result in.
  void EnterMapping();
  std::vector<int> TakeMapped() { return mapper_.TakeMapped(); }
  /// With the keyframes that were mapped since the last result.
  TrackResult Deliver(TrackResult result) {
    result.mapped = TakeMapped();
    return result;
  }
  std::vector<int> Correct(const MapCorrection& correction);
  void Replace(Map map);

  /// Everything but options, rig, recorder and whether to use threads, section by section.
  void Save(const internal::SectionSink& sink) const;
  /// Takes up what Save gave, into an object that is new. After an InputError it is of no use.
  void Load(internal::SectionReader* file);
  template <class Archive>
  void State(Archive& archive) {
    std::vector<MapFrame> frames;
    std::uint64_t before_session = frames_before_session_;
    if constexpr (!Archive::kReading) {
      for (std::size_t i = 0; i < map().frames().size(); ++i) frames.push_back(map().frames()[i]);
    }
    archive(frames, before_session);
    if constexpr (Archive::kReading) {
      if (before_session > frames.size()) archive.Damaged("a recording that begins after its frames");
      frames_before_session_ = static_cast<std::size_t>(before_session);
      for (const MapFrame& frame : frames) mapper_.RestoredMap()->Restore(frame);
    }
    archive(mapper_, initializer_, tracker_, relocalizer_, result_, row_errors_, stereo_matches_,
            frame_offset_, session_piece_, height_, first_unmoved_);
  }

  const OdometryOptions& options() const { return options_; }
  const CameraRig& rig() const { return rig_; }
  const Map& map() const { return mapper_.map(); }
  const AsyncMapper& mapper() const { return mapper_; }
  const LastFrame& last() const { return tracker_.last(); }
  SpanRecorder* recorder() const { return stages_.recorder; }
  void UseOwnThreads(bool own_threads) { mapper_.UseOwnThreads(own_threads); }
  void SetRecorder(SpanRecorder* recorder) { stages_.recorder = recorder; }

 private:
  TrackedFrame Prepare(const InputFrame& input, int features);
  std::pair<TrackedFrame, Tracker::Tracked> Look(const InputFrame& input);
  Tracker::Tracked Look(const TrackedFrame& frame);
  Tracker::Tracked LookFromStart(const TrackedFrame& frame);
  TrackResult Initialize(const TrackedFrame& frame);
  TrackResult FollowFirst(const TrackedFrame& frame, const Pose& T_odom_camera);
  TrackResult TrackMap(const TrackedFrame& frame, const Tracker::Tracked& tracked);
  void CompareTurn(const Pose& T_last_world, double last_s, const PoseFix& fix);
  TrackResult Accept(const Tracker::Tracked& tracked, bool goes_on);
  void TrackLost();
  bool BecomesKeyframe(const Tracker::Tracked& tracked) const;
  int InsertKeyframe();
  void KeepScale();
  void MoveMap(const MapCorrection& correction);
  void AddFrame(const TrackedFrame& frame, const Pose& T_camera_world, int keyframe, bool goes_on = true);
  bool IsLater(double stamp_s) const;
  void Check(const internal::SectionReader& file) const;

  OdometryOptions options_;
  CameraRig rig_;
  StageTimes stages_;
  AsyncMapper mapper_;
  MapInitializer initializer_;
  Tracker tracker_;
  RollingStart rolling_start_;
  ClockEstimate clocks_;
  ImuExamination imu_;
  Gravity gravity_;
  Relocalizer relocalizer_;
  PoseFollower follower_;
  Localizer localizer_;
  bool keeps_height_;  // of one camera, while it makes a map
  CameraHeight height_;
  TrackResult result_;                               // of the last frame
  std::vector<double> row_errors_, stereo_matches_;  // stereo: of each pair
  std::size_t frames_before_session_ = 0;            // of the map
  std::int64_t frame_offset_ = 0;                    // of the recording, in the map's numbers
  int first_unmoved_ = 0;                            // keyframe from which on no loop has moved any
  int session_piece_ = 0;                            // that the recording began with
};

}  // namespace tutti
