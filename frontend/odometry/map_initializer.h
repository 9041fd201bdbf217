// The first pose of a map piece, and the frames before it.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "frontend/odometry/async_mapper.h"
#include "frontend/odometry/mono_initializer.h"
#include "frontend/odometry/pose_search.h"
#include "frontend/odometry/tracked_frame.h"

namespace tutti {

/// Starts the pieces of a map: from one frame that has depth, or from two views. Value type.
class MapInitializer {
 public:
  /// `piece`: number of the one that starts next. Where it is not the first, one of the first frames of the
  /// recording may be recognised in the map: depth starts a piece only after a few that are not, which are
  /// posed then, too.
  MapInitializer(const OdometryOptions& options, const CameraRig& rig, int piece = 0);

  /// What became of a frame that a piece was to start with.
  struct Start {
    int keyframe = -1;   ///< the one that the frame became, or -1
    std::string reason;  ///< why it became none
    /// Frames that were offered before and are posed now, T_camera_world, oldest first.
    std::vector<std::pair<TrackedFrame, Pose>> before;
    int before_reference = -1;  ///< the keyframe that they refer to
  };

  /// Offers the next frame. A piece goes on from where `last` was, if anywhere, and mono at its scale.
  Start Offer(const TrackedFrame& frame, const LastFrame& last, AsyncMapper* mapper);
  /// Forgets the frames that were offered.
  void Reset();
  /// The same, and what starts next is another piece of the map. `lost`: frames that were lost before it, to
  /// be posed backwards once it has started.
  void NextPiece(const std::vector<TrackedFrame>& lost);
  /// Number of the piece that starts next, or started last.
  int piece() const { return piece_; }

  template <class Archive>
  void State(Archive& archive) {
    archive(mono_, waiting_, piece_, hold_);
  }
  /// Throws InputError if the state does not fit the map.
  void Check(const Map& map, const internal::SectionReader& file) const;

 private:
  Start OfferMetric(const TrackedFrame& frame, const Pose& T_world_camera, AsyncMapper* mapper);
  Start OfferMono(const TrackedFrame& frame, const LastFrame& last, const Pose& T_world_camera, Map* map);
  std::vector<std::pair<TrackedFrame, Pose>> PoseBackwards(const std::vector<TrackedFrame>& frames,
                                                           const Keyframe& k0, const Keyframe& k1,
                                                           const Map& map) const;

  OdometryOptions options_;
  CameraRig rig_;
  MonoInitializer mono_;
  PoseSearch search_;
  std::vector<TrackedFrame> waiting_;  // stereo and depth: offered, without enough depth; no images
  int piece_ = 0;
  int hold_ = 0;  // frames with depth that are still to start no piece
};

}  // namespace tutti
