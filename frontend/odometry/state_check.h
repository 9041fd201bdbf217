// What a saved odometry must fulfil before it is used, beyond what its checksums say: numbers that others are
// looked up with are in range, and finite where the algorithms count on that.
#pragma once

#include <cmath>
#include <vector>

#include "core/section_file.h"
#include "frontend/odometry/tracked_frame.h"
#include "tutti/core/pose.h"
#include "tutti/frontend/map.h"

namespace tutti::internal {

/// Of a keyframe of `map`, or -1 if `none_too`.
inline void CheckKeyframe(int id, const Map& map, const SectionReader& file, bool none_too = false) {
  CheckIndex(id, none_too ? -1 : 0, map.KeyframeCount(), file);
}

/// Of landmarks of `map`, or -1.
inline void CheckLandmarks(const std::vector<int>& ids, const Map& map, const SectionReader& file) {
  for (const int id : ids) CheckIndex(id, -1, map.LandmarkCount(), file);
}

/// A pose, and a place, within 1e12 m.
inline void CheckPlace(const Eigen::Vector3d& place, const SectionReader& file) {
  if (!place.allFinite() || !(place.norm() < 1e12)) file.Damaged("a place that is none");
}
inline void CheckPose(const Pose& pose, const SectionReader& file) {
  if (!(std::abs(pose.rotation.norm() - 1) < 1e-3)) file.Damaged("a rotation that is none");
  CheckPlace(pose.translation, file);
}

/// There, and of levels that the map knows.
inline void CheckFeatures(const std::shared_ptr<const FrameFeatures>& features, const Map& map,
                          const SectionReader& file) {
  if (!features) file.Damaged("a frame without features");
  const int levels = static_cast<int>(map.scales().size());
  for (const cv::KeyPoint& k : features->keypoints) CheckIndex(k.octave, 0, levels, file);
}
inline void CheckFrames(const std::vector<TrackedFrame>& frames, const Map& map, const SectionReader& file) {
  for (const TrackedFrame& frame : frames) CheckFeatures(frame.features, map, file);
}

}  // namespace tutti::internal
