// State and steps of Odometry.
#pragma once

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "frontend/features/matcher.h"
#include "frontend/map/local_mapper.h"
#include "frontend/map/map.h"
#include "frontend/odometry/background_mapping.h"
#include "frontend/odometry/mono_initializer.h"
#include "frontend/odometry/stage_times.h"
#include "tutti/frontend/odometry.h"

namespace tutti {

class Odometry::Impl {
 public:
  Impl(const OdometryOptions& options, const CameraRig& rig);

  TrackResult Track(const InputFrame& frame);
  TrackResult RelocalizeAt(int keyframe);
  std::vector<SeenLandmark> SeenLandmarks() const;

  OdometryOptions options;
  CameraRig rig;
  StageTimes stages;
  bool own_threads = true;  // for mapping
  std::vector<double> row_errors, stereo_matches;

  /// Pose of a frame relative to its reference keyframe: corrections of the map reach it.
  struct FrameRecord {
    std::int64_t index = 0;
    double stamp_s = 0;
    int reference = -1;
    Pose T_reference_frame;
  };
  std::vector<FrameRecord> records;  // ascending by time

  const Map& map() const { return map_; }
  /// For writing: brings in first what mapping has made of it meanwhile.
  Map& WritableMap() {
    EnterMapping();
    return map_;
  }
  /// Waits for the mapping that is under way, if any, and brings its result in.
  void EnterMapping();
  std::vector<int> mapped;  // keyframes whose mapping was brought in, until somebody takes them

  /// Moves keyframes, with all that hangs on them; the landmarks' geometry is to be updated then.
  void MoveMap(const std::map<int, Similarity>& S_world_keyframe);
  void UpdateGeometry();
  void TakeAdjusted(int landmark, const Landmark& before, const Landmark& after);
  const LensError& Lens() const { return mapper_.lens().Remaining(); }
  /// Moves everything that hangs on the current pose after its keyframe was moved.
  void MoveCurrent(const Pose& old_reference, const Similarity& S_world_reference);
  int reference() const { return reference_; }
  std::map<int, int> piece_joined;  // piece -> the piece it joined

 private:
  /// A pose that a frame may have, and what speaks for it.
  struct Fix {
    explicit Fix(const TrackedFrame& f) : extracted(f.features), frame(f) { Clear(); }
    void Clear() {
      frame.features = extracted;
      matches = {extracted.get(), std::vector<int>(extracted->size(), -1)};
      visible.clear();
      found.clear();
      inliers = 0;
    }
    // Inliers among the landmarks in view, of which there can't be more than features.
    double Share() const {
      return inliers / std::max(1.0, static_cast<double>(std::min(visible.size(), extracted->size())));
    }
    std::shared_ptr<const FrameFeatures> extracted;
    TrackedFrame frame;  // with features that are aligned with their landmarks
    FrameMatches matches;
    Pose T_camera_world;
    int reference = -1;               // keyframe that shares most landmarks
    std::vector<int> visible, found;  // landmarks that should be in view; those that are, -1 between them
    int inliers = 0;
  };

  TrackResult Initialize(const TrackedFrame& frame);
  TrackResult TrackMap(const TrackedFrame& frame);
  void PoseBackwards(const std::vector<TrackedFrame>& frames, int first_keyframe);
  bool FindPose(Fix* fix) const;
  std::vector<Pose> Predictions(double stamp_s) const;
  bool GuessFromLastFrame(const Pose& prediction, float radius_px, Fix* fix) const;
  bool GuessFromKeyframe(int keyframe, Fix* fix) const;
  bool Settle(Fix* fix) const;
  bool Offer(int least_inliers, Fix* guess, std::vector<Pose>* offered, Fix* best) const;
  std::vector<int> LocalLandmarks(const Fix& fix, const std::map<int, int>& votes) const;
  TrackResult Accept(Fix fix);
  /// Refines the pose on the matches, drops those that do not fit; returns the number of inliers.
  int Refine(FrameMatches* matches, Pose* T_camera_world) const;
  int EstablishedLandmarks(int keyframe) const;
  struct DepthNeed {
    bool few_near = false;   // few landmarks are near enough to hold the camera's place
    bool uncovered = false;  // too much of the image has none
  };
  DepthNeed NeedForDepth(const FrameMatches& matches) const;
  bool NeedKeyframe(const TrackedFrame& frame, const FrameMatches& matches, int inliers) const;
  void CountSeen(const Fix& fix);
  int InsertKeyframe(const TrackedFrame& frame);
  void Record(const TrackedFrame& frame, const Pose& T_camera_world, int reference);
  void Lose();

  Map map_;  // not written to while mapping_ is busy
  LocalMapper mapper_;
  BackgroundMapping mapping_;
  int frames_since_mapping_began_ = 0;
  std::vector<int> visible_, found_;  // landmarks of frames since then that are still to be counted
  MonoInitializer initializer_;
  std::optional<TrackedFrame> lost_;    // the last frame, if it has no pose
  TrackResult lost_result_;             // of the last frame
  std::optional<double> lost_since_s_;  // first frame with something to see that was lost [s]
  TrackingState state_ = TrackingState::kInitializing;
  int piece_ = 0;
  int reference_ = -1;      // keyframe that shares most landmarks with the last frame
  int last_keyframe_ = -1;  // newest keyframe
  std::int64_t frames_since_keyframe_ = 0;
  // The last tracked frame.
  FrameMatches last_matches_;
  std::shared_ptr<const FrameFeatures> last_features_;
  Pose last_T_camera_world_;
  double last_stamp_ = 0;
  Vector6d velocity_ = Vector6d::Zero();  // of T_camera_world, per second: T_now = Exp(v dt) T_last
  bool has_velocity_ = false;
  int reference_landmarks_ = 0;  // landmarks of the reference when it was made
};

}  // namespace tutti
