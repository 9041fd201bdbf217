#include "frontend/map/map_frames.h"

#include <algorithm>
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

void RescaleFrames(const std::map<int, Similarity>& S_world_keyframe, Map* map) {
  for (std::size_t i = 0; i < map->frames().size(); ++i) {
    const auto moved = S_world_keyframe.find(map->frames()[i].keyframe);
    if (moved != S_world_keyframe.end() && moved->second.scale != 1)
      map->frame(i).T_keyframe_frame.translation *= moved->second.scale;
  }
}

void RehangFrames(const std::map<int, int>& into, Map* map) {
  const Map& now = *map;
  for (std::size_t i = 0; i < now.frames().size(); ++i) {
    for (auto next = into.find(now.frames()[i].keyframe); next != into.end();
         next = into.find(now.frames()[i].keyframe)) {
      MapFrame& frame = map->frame(i);
      const Pose T_into_removed =
          now.keyframe(next->second).T_world_camera.Inverse() * now.keyframe(frame.keyframe).T_world_camera;
      frame.T_keyframe_frame = T_into_removed * frame.T_keyframe_frame;
      frame.keyframe = next->second;
    }
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

std::vector<const MapFrame*> FramesOf(const Map& map, int piece, const FrameRange& range) {
  if (piece < 0) {
    const std::vector<int> pieces = FramePieces(map, range);
    if (!pieces.empty()) piece = pieces.front();
  }
  std::vector<const MapFrame*> out;
  for (std::size_t i = 0; i < map.frames().size(); ++i) {
    const MapFrame& frame = map.frames()[i];
    if (range.Has(frame.index) && map.keyframe(frame.keyframe).piece == piece) out.push_back(&frame);
  }
  return out;
}

}  // namespace

Trajectory FrameTrajectory(const Map& map, int piece, const FrameRange& range) {
  Trajectory out;
  for (const MapFrame* f : FramesOf(map, piece, range))
    out.push_back({f->stamp_s, map.keyframe(f->keyframe).T_world_camera * f->T_keyframe_frame});
  return out;
}

std::vector<std::int64_t> FrameIndices(const Map& map, int piece, const FrameRange& range) {
  std::vector<std::int64_t> out;
  for (const MapFrame* f : FramesOf(map, piece, range)) out.push_back(f->index);
  return out;
}

}  // namespace tutti
