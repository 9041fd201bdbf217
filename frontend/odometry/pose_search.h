// The pose of a frame: guesses from the motion and from keyframes, settled against the local map.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "frontend/odometry/tracked_frame.h"
#include "tutti/frontend/frame.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry_options.h"

namespace tutti {

/// Has no state: the same map, frame and last frame give the same pose.
class PoseSearch {
 public:
  PoseSearch(const OdometryOptions& options, const CameraRig& rig) : options_(options), rig_(rig) {}

  /// Where `frame` is by the motion so far, else around the place of `last`. `lost`: the frame before had no
  /// pose; twice the landmarks must agree then. Out of reach of a steady motion, half of the landmarks in
  /// view must. None if it is nowhere.
  std::optional<PoseFix> Find(const Map& map, const TrackedFrame& frame, const LastFrame& last,
                              bool lost) const;
  /// Where `frame` is if it shows the same place as a keyframe, whatever the motion so far. None if it does
  /// not, or if there is no such keyframe.
  std::optional<PoseFix> FindAt(const Map& map, const TrackedFrame& frame, int keyframe) const;

  /// Where `frame` is if it shows what the map has around a keyframe, as seen from about `T_camera_world`.
  /// None if it does not.
  std::optional<PoseFix> FindNear(const Map& map, const TrackedFrame& frame, int keyframe,
                                  const Pose& T_camera_world) const;
  /// Looks again for all that the local map has to show, from a pose and features that are known better.
  /// False if that is nothing.
  bool SettleAgain(const Map& map, PoseFix* fix) const;

  /// Refines a pose on the matches and drops those that do not fit. Returns the number of inliers; 0, and
  /// changes nothing, with fewer than 6 matches.
  int Refine(const Map& map, FrameMatches* matches, Pose* T_camera_world) const;

 private:
  struct Contest;

  std::optional<PoseFix> GuessFromPatches(const Map& map, const TrackedFrame& frame, const LastFrame& last,
                                          const Pose& prediction) const;
  std::optional<PoseFix> GuessFromLandmarks(const Map& map, const TrackedFrame& frame,
                                            const std::vector<int>& landmarks, const Pose& T_camera_world,
                                            float radius_factor) const;
  std::optional<PoseFix> GuessFromLastFrame(const Map& map, const TrackedFrame& frame, const LastFrame& last,
                                            const Pose& prediction, float radius_px) const;
  std::optional<PoseFix> GuessFromKeyframe(const Map& map, const TrackedFrame& frame, int keyframe) const;
  std::vector<int> LocalLandmarks(const Map& map, const PoseFix& fix, const std::map<int, int>& votes) const;
  bool Settle(const Map& map, PoseFix* fix) const;
  bool Offer(std::optional<PoseFix> guess, Contest* contest) const;

  OdometryOptions options_;
  CameraRig rig_;
};

}  // namespace tutti
