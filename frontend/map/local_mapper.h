// What happens when a frame becomes a keyframe: new landmarks, fusion of duplicates, culling, local bundle
// adjustment.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "core/stopwatch.h"
#include "frontend/map/bundle_adjustment.h"
#include "frontend/map/self_calibration.h"
#include "tutti/frontend/frame.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry_options.h"

namespace tutti {

/// Value type: copies with the odometry.
class LocalMapper {
 public:
  LocalMapper(const OdometryOptions& options, const CameraRig& rig)
      : options_(options), rig_(rig), lens_(options, rig) {}

  /// Landmarks from the keyframe's own depth, for features that have none yet: the near ones, and at least
  /// `at_least`.
  int AddDepthLandmarks(int keyframe, int at_least, Map* map);

  /// What the camera's calibration turned out to have left over.
  const SelfCalibration& lens() const { return lens_; }

  /// Goes on with what is known of the same camera.
  void KeepLens(const SelfCalibration& lens) { lens_ = lens; }

  /// From now on keyframes stay where they are, since another odometry knows their poses: no bundle
  /// adjustment, and landmarks are made between neighbours in time.
  void KeepPoses() { keeps_poses_ = true; }

  /// From now on what is in the map stays as it is; keyframes and landmarks that come are fitted to it.
  void Keep(const Map& map) {
    kept_keyframes_ = map.KeyframeCount();
    kept_landmarks_ = map.LandmarkCount();
    recent_.clear();
  }

  /// Full treatment of the newest keyframe; its landmark matches, and those of its own depth, are already in
  /// the map. Adds milliseconds to `stages`.
  void Process(int keyframe, Map* map, StageTimes* stages);

  template <class Archive>
  void State(Archive& archive) {
    archive(lens_, recent_);
  }
  /// Throws InputError if the state does not fit the map.
  void Check(const Map& map, const internal::SectionReader& file) const;

 private:
  void CullRecent(int keyframe, Map* map);
  std::optional<Eigen::Vector3d> PointOf(const Keyframe& a, int fa, const Keyframe& b, int fb, const Map& map,
                                         bool strict) const;
  std::vector<int> Neighbours(int keyframe, int count, const Map& map) const;
  int Triangulate(int keyframe, Map* map);
  void Align(int keyframe, Map* map);

  OdometryOptions options_;
  CameraRig rig_;
  SelfCalibration lens_;
  bool keeps_poses_ = false;
  int kept_keyframes_ = 0, kept_landmarks_ = 0;  // of a map that stays: those with smaller ids
  std::vector<std::pair<int, int>> recent_;      // landmark, keyframe in which it was made
};

}  // namespace tutti
