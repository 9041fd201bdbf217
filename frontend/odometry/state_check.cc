#include "frontend/odometry/state_check.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "frontend/odometry/async_mapper.h"
#include "frontend/odometry/map_initializer.h"
#include "frontend/odometry/mono_initializer.h"
#include "frontend/odometry/relocalizer.h"
#include "frontend/odometry/tracker.h"

namespace tutti {

using internal::CheckFeatures;
using internal::CheckIndex;
using internal::CheckKeyframe;
using internal::CheckLandmarks;
using internal::CheckPlace;
using internal::CheckPose;
using internal::SectionReader;

namespace {

constexpr int kMostFrames = 1 << 28;  // counts of frames, and of pieces, stay below

void CheckKeyframeState(const Map& map, int id, const SectionReader& file) {
  const Keyframe& k = map.keyframe(id);
  CheckIndex(k.id, id, id + 1, file);
  CheckIndex(k.replaced_by, -1, id, file);  // so PresentKeyframe gets to an end
  CheckIndex(k.piece, 0, kMostFrames, file);
  CheckPose(k.T_world_camera, file);
  CheckFeatures(k.features, map, file);
  if (k.replaced_by >= 0 && k.features->size() != 0) file.Damaged("a removed keyframe that is still there");
  if (k.landmarks.size() != k.features->size()) file.Damaged("a keyframe with landmarks of another");
  for (const int l : k.landmarks) {
    CheckIndex(l, -1, map.LandmarkCount(), file);
    if (l >= 0 && !map.landmark(l).alive) file.Damaged("a keyframe that sees what is gone");
  }
  for (const auto& [other, shared] : k.covisible) {
    CheckKeyframe(other, map, file);
    CheckIndex(shared, 1, map.LandmarkCount() + 1, file);
    if (other == id) file.Damaged("a keyframe that is its own neighbour");
  }
}

void CheckObservations(const Map& map, int id, const SectionReader& file) {
  const Landmark& l = map.landmark(id);
  if (l.observations.empty()) file.Damaged("a landmark that nothing sees");
  int last = -1;
  for (const Observation& o : l.observations) {
    CheckIndex(o.keyframe, last + 1, map.KeyframeCount(), file);
    const std::vector<int>& seen = map.keyframe(o.keyframe).landmarks;
    CheckIndex(o.feature, 0, static_cast<int>(seen.size()), file);
    if (seen[static_cast<std::size_t>(o.feature)] != id)
      file.Damaged("a landmark with a view that is another's");
    last = o.keyframe;
  }
}

void CheckPatch(const Map& map, const Landmark& l, const SectionReader& file) {
  if (!l.patch) return;
  CheckKeyframe(l.patch_source.keyframe, map, file);
  const Patch& p = *l.patch;
  const auto inside = [](float v) { return std::abs(v) <= 1; };
  const auto scale = [](float v) { return v > 0 && v < 1e6F; };
  if (!inside(p.offset_x) || !inside(p.offset_y) || !scale(p.scale_x) || !scale(p.scale_y))
    file.Damaged("a patch that is none");
}

void CheckLandmarkState(const Map& map, int id, const SectionReader& file) {
  const Landmark& l = map.landmark(id);
  if (!l.alive) return CheckIndex(map.ReplacedBy(id), -1, map.LandmarkCount(), file);
  CheckObservations(map, id, file);
  CheckPatch(map, l, file);
  CheckKeyframe(l.reference, map, file);
  CheckPlace(l.position, file);
  if (!l.normal.allFinite()) file.Damaged("a direction that is none");
  const auto distance = [](float v) { return v >= 0 && std::isfinite(v); };
  if (!distance(l.min_distance) || !distance(l.max_distance)) file.Damaged("a distance that is none");
  CheckIndex(l.visible, 0, kMostFrames, file);
  CheckIndex(l.found, 0, kMostFrames, file);
}

// What a keyframe sees knows of it. The other way round has been checked, so that as many are enough; else
// the keyframe would still see a landmark that is removed.
void CheckViews(const Map& map, const SectionReader& file) {
  std::size_t views = 0, seen = 0;
  for (int id = 0; id < map.LandmarkCount(); ++id) views += map.landmark(id).observations.size();
  for (int id = 0; id < map.KeyframeCount(); ++id) {
    const std::vector<int>& landmarks = map.keyframe(id).landmarks;
    seen += landmarks.size() - static_cast<std::size_t>(std::count(landmarks.begin(), landmarks.end(), -1));
  }
  if (seen != views) file.Damaged("a keyframe that sees what does not know of it");
}

// Whoever follows ReplacedBy gets to an end.
void CheckReplacements(const Map& map, const SectionReader& file) {
  std::vector<int> from(static_cast<std::size_t>(map.LandmarkCount()), -1);  // where the way began
  for (int start = 0; start < map.LandmarkCount(); ++start) {
    for (int l = start; l >= 0 && !map.landmark(l).alive; l = map.ReplacedBy(l)) {
      int& before = from[static_cast<std::size_t>(l)];
      if (before == start) file.Damaged("landmarks that replaced each other");
      if (before >= 0) break;
      before = start;
    }
  }
}

}  // namespace

void Map::Check(const SectionReader& file) const {
  for (int id = 0; id < KeyframeCount(); ++id) CheckKeyframeState(*this, id, file);
  for (int id = 0; id < LandmarkCount(); ++id) CheckLandmarkState(*this, id, file);
  for (std::size_t i = 0; i < frames().size(); ++i) {
    CheckKeyframe(frames()[i].keyframe, *this, file);
    CheckPose(frames()[i].T_keyframe_frame, file);
    CheckKeyframe(frames()[i].before, *this, file, true);
    CheckPose(frames()[i].T_before_frame, file);
  }
  CheckViews(*this, file);
  CheckReplacements(*this, file);
}

void LocalMapper::Check(const Map& map, const SectionReader& file) const {
  for (const auto& [landmark, keyframe] : recent_) {
    CheckIndex(landmark, 0, map.LandmarkCount(), file);
    CheckKeyframe(keyframe, map, file);
  }
}

void AsyncMapper::Check(const SectionReader& file) const {
  map_.Check(file);
  mapper_.Check(map_, file);
  CheckKeyframe(keyframe_, map_, file, !interrupted_);
  CheckIndex(frames_, 0, std::numeric_limits<int>::max(), file);
  CheckLandmarks(visible_, map_, file);
  CheckLandmarks(found_, map_, file);
  for (const int id : mapped_) CheckKeyframe(id, map_, file);
}

void MonoInitializer::Check(const Map& map, const SectionReader& file) const {
  for (const FirstView& reference : references_) {
    if (!reference.frame.features) file.Damaged("a first view without its features");
    CheckFeatures(reference.frame.features, map, file);
    if (reference.centres.size() != reference.frame.features->size())
      file.Damaged("a first view without its features");
    for (const cv::Point2f& c : reference.centres) {
      if (!(std::abs(c.x) < 1e6F && std::abs(c.y) < 1e6F)) file.Damaged("a pixel that is none");
    }
  }
  internal::CheckFrames(pending_, map, file);
}

void MapInitializer::Check(const Map& map, const SectionReader& file) const {
  mono_.Check(map, file);
  internal::CheckFrames(waiting_, map, file);
  CheckIndex(piece_, 0, kMostFrames, file);
  CheckIndex(hold_, 0, kMostFrames, file);
}

void Relocalizer::Check(const Map& map, const SectionReader& file) const {
  if (lost_) CheckFeatures(lost_->features, map, file);
  internal::CheckFrames(earlier_, map, file);
}

void Tracker::Check(const Map& map, const SectionReader& file) const {
  CheckIndex(static_cast<int>(state_), 0, static_cast<int>(TrackingState::kLost) + 1, file);
  CheckKeyframe(last_.reference, map, file, true);
  CheckKeyframe(last_.newest_keyframe, map, file, last_.reference < 0);
  CheckPose(last_.T_camera_world, file);
  CheckLandmarks(last_.matches.landmarks, map, file);
  if (last_.velocity && !last_.velocity->allFinite()) file.Damaged("a velocity that is none");
  if (last_.mean_velocity && !last_.mean_velocity->allFinite()) file.Damaged("a velocity that is none");
  const bool has_frame = last_.reference >= 0;
  if (has_frame) CheckFeatures(last_.frame.features, map, file);
  const std::size_t features = has_frame ? last_.frame.features->size() : 0;
  const bool is_keyframe = has_frame && last_.frames_since_keyframe == 0;
  if (last_.matches.landmarks.size() != features ||
      (is_keyframe && map.keyframe(last_.newest_keyframe).landmarks.size() != features))
    file.Damaged("a frame with landmarks of another");
  if (last_.frames_since_keyframe < 0 || last_.frames_since_keyframe > kMostFrames ||
      (state_ != TrackingState::kInitializing && !has_frame))
    file.Damaged("a track from nowhere");
}

}  // namespace tutti
