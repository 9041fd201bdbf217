#include "frontend/map/map_frames.h"

#include <algorithm>
#include <cmath>
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
    frame.T_before_frame = frame.T_before_frame * ExpSE3(own * -part);
  }
}

namespace {

// Frames in a row that hang on one keyframe.
struct Run {
  std::size_t begin, end;
  double middle_s;      // where they follow it alone: at its own frame, or half-way
  bool linked = false;  // the camera was tracked into it from the run before
};

// Whether the first frame of a run knows how it lies to the keyframe of the run before. In a map that a
// correction has torn it may be off by the tear, which was mended since; then it goes on less steadily from
// there than from where the keyframes are now.
bool Links(const Map& map, const Run& before, const Run& after) {
  const auto& frames = map.frames();
  const std::size_t first = after.begin;
  const MapFrame& link = frames[first];
  if (link.before != frames[first - 1].keyframe) return false;
  const auto by = [&](int keyframe, const Pose& T_keyframe_frame) {
    return Eigen::Vector3d(map.keyframe(keyframe).T_world_camera * T_keyframe_frame.translation);
  };
  const auto position = [&](std::size_t i) { return by(frames[i].keyframe, frames[i].T_keyframe_frame); };
  const auto velocity = [&](std::size_t i, const Eigen::Vector3d& to) {
    return Eigen::Vector3d((to - position(i - 1)) / (frames[i].stamp_s - frames[i - 1].stamp_s));
  };
  const std::size_t step = before.end - before.begin > 1 ? first - 1 : first + 1;  // within one of them
  if (step == after.end) return true;
  const Eigen::Vector3d usual = velocity(step, position(step));
  const auto change = [&](const Eigen::Vector3d& to) { return (velocity(first, to) - usual).norm(); };
  return change(by(link.before, link.T_before_frame)) <= change(position(first));
}

std::vector<Run> Runs(const Map& map) {
  std::vector<Run> runs;
  bool has_own = false;
  for (std::size_t i = 0; i < map.frames().size(); ++i) {
    const MapFrame& frame = map.frames()[i];
    if (i == 0 || map.frames()[i - 1].keyframe != frame.keyframe) {
      runs.push_back({i, i, frame.stamp_s});
      has_own = false;
    }
    Run& run = runs.back();
    run.end = i + 1;
    if (!has_own) run.middle_s = 0.5 * (map.frames()[run.begin].stamp_s + frame.stamp_s);
    if (map.keyframe(frame.keyframe).frame_index != frame.index) continue;
    run.middle_s = frame.stamp_s;
    has_own = true;
  }
  for (std::size_t r = 1; r < runs.size(); ++r) runs[r].linked = Links(map, runs[r - 1], runs[r]);
  return runs;
}

}  // namespace

std::vector<Pose> FramePoses(const Map& map) {
  std::vector<Pose> poses;
  poses.reserve(map.frames().size());
  const std::vector<Run> runs = Runs(map);
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const Run& run = runs[r];
    for (std::size_t i = run.begin; i < run.end; ++i) {
      const MapFrame& frame = map.frames()[i];
      poses.push_back(map.keyframe(frame.keyframe).T_world_camera * frame.T_keyframe_frame);
      const bool later = frame.stamp_s >= run.middle_s;
      if (later ? r + 1 == runs.size() || !runs[r + 1].linked : !run.linked) continue;
      const Run& other = later ? runs[r + 1] : runs[r - 1];
      const double time = std::abs(other.middle_s - run.middle_s);
      if (!(time > 0)) continue;
      const MapFrame& link = map.frames()[std::max(run.begin, other.begin)];
      const Pose T_other_this = later ? link.T_keyframe_frame * link.T_before_frame.Inverse()
                                      : link.T_before_frame * link.T_keyframe_frame.Inverse();
      const Pose by_other = map.keyframe(later ? link.keyframe : link.before).T_world_camera * T_other_this *
                            frame.T_keyframe_frame;
      // By time: each frame takes the same part of a correction, also where the camera stands or turns.
      const double share = std::abs(frame.stamp_s - run.middle_s) / time;
      Pose& pose = poses.back();
      pose.rotation = pose.rotation.slerp(share, by_other.rotation);
      pose.translation = (1 - share) * pose.translation + share * by_other.translation;
    }
  }
  return poses;
}

void RescaleFrames(const std::map<int, Similarity>& S_world_keyframe, Map* map) {
  const auto scale_of = [&](int id) {
    const auto moved = S_world_keyframe.find(id);
    return moved == S_world_keyframe.end() ? 1.0 : moved->second.scale;
  };
  for (std::size_t i = 0; i < map->frames().size(); ++i) {
    const MapFrame& now = std::as_const(*map).frames()[i];
    const double scale = scale_of(now.keyframe), before = scale_of(now.before);
    if (scale == 1 && before == 1) continue;
    MapFrame& frame = map->frame(i);
    frame.T_keyframe_frame.translation *= scale;
    frame.T_before_frame.translation *= before;
  }
}

void RehangFrames(const std::vector<Pose>& poses, Map* map) {
  const Map& now = *map;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    MapFrame& frame = map->frame(i);
    frame.keyframe = now.PresentKeyframe(frame.keyframe);
    frame.T_keyframe_frame = now.keyframe(frame.keyframe).T_world_camera.Inverse() * poses[i];
    if (frame.before < 0) continue;
    frame.before = now.PresentKeyframe(frame.before);
    frame.T_before_frame = now.keyframe(frame.before).T_world_camera.Inverse() * poses[i];
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
