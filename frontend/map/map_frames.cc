#include "frontend/map/map_frames.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

namespace tutti {

void SpreadDrift(int count, const Vector6d& drift, const Eigen::Quaterniond& R_camera_world, Map* map) {
  const Map& now = *map;
  const int frames = static_cast<int>(now.frames().size()), first = frames - count;
  for (int i = std::max(0, first); i < frames; ++i) {
    MapFrame& frame = map->frame(static_cast<std::size_t>(i));
    const Pose T_world_frame = now.keyframe(frame.keyframe).T_world_camera * frame.T_keyframe_frame;
    // The drift as this camera sees it.
    const Eigen::Quaterniond turn = T_world_frame.rotation.conjugate() * R_camera_world.conjugate();
    const double part = double(i - first + 1) / (count + 1);
    Vector6d own;
    own << turn * Eigen::Vector3d(drift.head<3>()), turn * Eigen::Vector3d(drift.tail<3>());
    frame.T_keyframe_frame = frame.T_keyframe_frame * ExpSE3(own * -part);
  }
}

namespace {

// Where a frame is between the keyframe that it hangs on and the one after it, whose frame hangs there, too.
struct Between {
  int next = -1;        // keyframe; -1: none follows
  std::size_t end = 0;  // its frame
  double share = 0;     // of the time from the one to the other; of the next one's own frame 1
};

// Removed ones are in it, too.
std::unordered_map<std::int64_t, int> KeyframesByFrame(const Map& map) {
  std::unordered_map<std::int64_t, int> ids;
  for (int id = 0; id < map.KeyframeCount(); ++id) ids[map.keyframe(id).frame_index] = id;
  return ids;
}

// By time: each frame takes as little of a correction as there is, also where the camera stands or turns.
std::vector<Between> BetweenKeyframes(const Map& map) {
  const std::unordered_map<std::int64_t, int> keyframes = KeyframesByFrame(map);
  std::vector<Between> all(map.frames().size());
  std::size_t first = 0;  // of those that hang on `last` since it, or since the camera was found again there
  double begin_s = 0;
  int last = -1;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const MapFrame& frame = map.frames()[i];
    if (frame.keyframe != last) {
      first = i;
      begin_s = frame.stamp_s;
      last = frame.keyframe;
    }
    const auto own = keyframes.find(frame.index);
    if (own == keyframes.end() || map.keyframe(own->second).replaced_by >= 0) continue;
    const double time = frame.stamp_s - begin_s;
    for (std::size_t k = first; k < i && time > 0; ++k)
      all[k] = {own->second, i, (map.frames()[k].stamp_s - begin_s) / time};
    all[i] = {own->second, i, 1};
    first = i + 1;
    begin_s = frame.stamp_s;
    last = own->second;
  }
  return all;
}

}  // namespace

std::vector<Pose> FramePoses(const Map& map) {
  const std::vector<Between> between = BetweenKeyframes(map);
  std::vector<Pose> poses;
  poses.reserve(between.size());
  for (std::size_t i = 0; i < between.size(); ++i) {
    const auto& [next, end, share] = between[i];
    const MapFrame& frame = map.frames()[i];
    const Pose by_last = map.keyframe(frame.keyframe).T_world_camera * frame.T_keyframe_frame;
    const Pose T_next_frame =
        next < 0 || end == i ? Pose() : map.frames()[end].T_keyframe_frame.Inverse() * frame.T_keyframe_frame;
    const Pose by_next = next < 0 ? by_last : map.keyframe(next).T_world_camera * T_next_frame;
    poses.emplace_back(by_last.rotation.slerp(share, by_next.rotation),
                       (1 - share) * by_last.translation + share * by_next.translation);
  }
  return poses;
}

void RescaleFrames(const std::map<int, Similarity>& S_world_keyframe, Map* map) {
  const auto scale_of = [&](int id) {
    const auto moved = S_world_keyframe.find(id);
    return moved == S_world_keyframe.end() ? 1.0 : moved->second.scale;
  };
  const std::vector<Between> between = BetweenKeyframes(*map);
  for (std::size_t i = 0; i < between.size(); ++i) {
    const double last = scale_of(std::as_const(*map).frames()[i].keyframe);
    const double next = between[i].next < 0 ? last : scale_of(between[i].next);
    const double scale = last * std::pow(next / last, between[i].share);
    if (scale != 1) map->frame(i).T_keyframe_frame.translation *= scale;
  }
}

void RehangFrames(const std::vector<Pose>& poses, Map* map) {
  const Map& now = *map;
  const std::unordered_map<std::int64_t, int> keyframes = KeyframesByFrame(now);
  std::map<int, int> before;  // removed keyframe -> the one that its own frame hangs on
  for (std::size_t i = 0; i < poses.size(); ++i) {
    MapFrame& frame = map->frame(i);
    const int last = frame.keyframe;
    if (now.keyframe(last).replaced_by >= 0)
      frame.keyframe = before.count(last) != 0 ? before[last] : now.PresentKeyframe(last);
    const auto own = keyframes.find(frame.index);
    if (own != keyframes.end() && own->second != last) before[own->second] = frame.keyframe;
    frame.T_keyframe_frame = now.keyframe(frame.keyframe).T_world_camera.Inverse() * poses[i];
  }
}

std::vector<int> FramePieces(const Map& map, const FrameRange& range) {
  std::map<int, int> frames;
  for (std::size_t i = 0; i < map.frames().size(); ++i) {
    const MapFrame& frame = map.frames()[i];
    if (range.Has(frame.index)) ++frames[map.keyframe(frame.keyframe).piece];
  }
  std::vector<int> pieces;
  pieces.reserve(frames.size());
  for (const auto& [piece, count] : frames) pieces.push_back(piece);
  std::stable_sort(pieces.begin(), pieces.end(), [&](int a, int b) { return frames[a] > frames[b]; });
  return pieces;
}

namespace {

// Their places among all frames.
std::vector<std::size_t> FramesOf(const Map& map, int piece, const FrameRange& range) {
  if (piece < 0) {
    const std::vector<int> pieces = FramePieces(map, range);
    if (!pieces.empty()) piece = pieces.front();
  }
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < map.frames().size(); ++i) {
    const MapFrame& frame = map.frames()[i];
    if (range.Has(frame.index) && map.keyframe(frame.keyframe).piece == piece) out.push_back(i);
  }
  return out;
}

}  // namespace

Trajectory FrameTrajectory(const Map& map, int piece, const FrameRange& range) {
  const std::vector<Pose> poses = FramePoses(map);
  Trajectory out;
  for (const std::size_t i : FramesOf(map, piece, range)) out.push_back({map.frames()[i].stamp_s, poses[i]});
  return out;
}

std::vector<std::int64_t> FrameIndices(const Map& map, int piece, const FrameRange& range) {
  std::vector<std::int64_t> out;
  for (const std::size_t i : FramesOf(map, piece, range)) out.push_back(map.frames()[i].index);
  return out;
}

}  // namespace tutti
