// State and steps of Odometry.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "local_mapper.h"
#include "matcher.h"
#include "mono_initializer.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry.h"

namespace tutti {

class Odometry::Impl {
 public:
  Impl(const OdometryOptions& options, const CameraRig& rig);

  TrackResult Track(const InputFrame& frame);

  OdometryOptions options;
  CameraRig rig;
  Map map;
  std::map<std::string, double> stages;
  std::vector<double> row_errors, stereo_matches;

  /// Pose of a frame relative to its reference keyframe: corrections of the map reach it.
  struct FrameRecord {
    std::int64_t index = 0;
    double stamp_s = 0;
    int reference = -1;
    Pose T_reference_frame;
  };
  std::vector<FrameRecord> records;  // ascending by time

  /// Moves everything that hangs on the current pose after keyframes were moved by ApplyCorrection.
  void MoveCurrent(const Pose& old_reference, const Similarity& S_world_reference);
  int reference() const { return reference_; }
  std::map<int, int> piece_joined;  // piece -> the piece it joined

 private:
  TrackResult Initialize(const TrackedFrame& frame);
  TrackResult TrackMap(TrackedFrame frame);
  void PoseBackwards(const std::vector<TrackedFrame>& frames, int first_keyframe);
  bool TrackFromLastFrame(FrameMatches* matches, Pose* T_camera_world, const Pose& prediction);
  bool TrackFromKeyframe(int keyframe, FrameMatches* matches, Pose* T_camera_world);
  int TrackLocalMap(FrameMatches* matches, Pose* T_camera_world);
  /// Refines the pose on the matches, drops those that do not fit; returns the number of inliers.
  int Refine(FrameMatches* matches, Pose* T_camera_world) const;
  bool NeedKeyframe(const TrackedFrame& frame, const FrameMatches& matches, int inliers) const;
  int InsertKeyframe(const TrackedFrame& frame, const FrameMatches& matches, const Pose& T_camera_world);
  void Record(const TrackedFrame& frame, const Pose& T_camera_world, int reference);
  void Lose(const TrackedFrame& frame);
  Pose Predict(double stamp_s) const;

  LocalMapper mapper_;
  MonoInitializer initializer_;
  TrackingState state_ = TrackingState::kInitializing;
  int piece_ = 0;
  int reference_ = -1;      // keyframe that shares most landmarks with the last frame
  int last_keyframe_ = -1;  // newest keyframe
  std::int64_t frames_since_keyframe_ = 0;
  // The last tracked frame.
  FrameMatches last_matches_;
  std::shared_ptr<const Features> last_features_;
  Pose last_T_camera_world_;
  double last_stamp_ = 0;
  Vector6d velocity_ = Vector6d::Zero();  // of T_camera_world, per second: T_now = Exp(v dt) T_last
  bool has_velocity_ = false;
  int reference_landmarks_ = 0;  // landmarks of the reference when it was made
};

}  // namespace tutti
