// Waits for two views that know well how the camera moved, and starts a mono map from them.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "frontend/geometry/two_view.h"
#include "frontend/odometry/tracked_frame.h"
#include "tutti/frontend/frame.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry_options.h"

namespace tutti {

/// Value type.
class MonoInitializer {
 public:
  MonoInitializer(const OdometryOptions& options, const CameraRig& rig) : options_(options), rig_(rig) {}

  /// Offers the next frame. True: `map` has two new keyframes of `piece` (ids first, first + 1) with
  /// landmarks; the first stands at T_world_camera and its median depth is `median_depth`. False: `reason`
  /// says what is missing.
  bool Offer(const TrackedFrame& frame, int piece, const Pose& T_world_camera, double median_depth, Map* map,
             std::string* reason);

  /// Frames since (and before) the reference that were offered without success, oldest first; at most about
  /// 100.
  const std::vector<TrackedFrame>& pending() const { return pending_; }
  void Reset();
  /// Further frames to be posed backwards, older than all that are offered from now on.
  void Await(const std::vector<TrackedFrame>& earlier) { pending_ = earlier; }

  template <class Archive>
  void State(Archive& archive) {
    archive(references_, pending_);
  }
  /// Throws InputError if the state does not fit the map.
  void Check(const Map& map, const internal::SectionReader& file) const;

 private:
  // A first view, and where its features are by now.
  struct FirstView {
    TrackedFrame frame;
    std::vector<cv::Point2f> centres;
    template <class Archive>
    void State(Archive& archive) {
      archive(frame, centres);
    }
  };
  using Matches = std::vector<std::pair<int, int>>;
  TrackedFrame Straight(const TrackedFrame& frame) const;
  Matches FollowReferences(const TrackedFrame& frame);
  void KeepAsReference(const TrackedFrame& frame);
  double AddPair(const TrackedFrame& frame, int piece, const Pose& T_world_camera, double median_depth,
                 const Matches& matches, const TwoViewResult& view, Map* map) const;
  double DirectionSigmaOfPair(const Map& map) const;

  OdometryOptions options_;
  CameraRig rig_;
  // Oldest first. The first is the one that frames are compared with; the others take its place when it has
  // gone out of view.
  std::vector<FirstView> references_;
  std::vector<TrackedFrame> pending_;
};

}  // namespace tutti
