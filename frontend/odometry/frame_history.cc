#include "frontend/odometry/frame_history.h"

#include <algorithm>

namespace tutti {

void FrameHistory::Add(const TrackedFrame& frame, const Pose& T_camera_world, const Keyframe& reference) {
  records_.push_back({frame.index, frame.stamp_s, reference.id,
                      reference.T_world_camera.Inverse() * T_camera_world.Inverse()});
}

void FrameHistory::Append(const FrameHistory& other, std::int64_t frame_offset, int first_keyframe) {
  for (Record record : other.records_) {
    record.index += frame_offset;
    record.reference += first_keyframe;
    records_.push_back(record);
  }
}

void FrameHistory::Spread(const Map& map, int count, const Vector6d& drift,
                          const Eigen::Quaterniond& R_camera_world) {
  const int first = static_cast<int>(records_.size()) - count;
  for (int i = std::max(0, first); i < static_cast<int>(records_.size()); ++i) {
    Record& record = records_[static_cast<std::size_t>(i)];
    const Pose T_world_frame = map.keyframe(record.reference).T_world_camera * record.T_reference_frame;
    // The drift as this camera sees it.
    const Eigen::Quaterniond turn = T_world_frame.rotation.conjugate() * R_camera_world.conjugate();
    const double part = double(i - first + 1) / (count + 1);
    Vector6d own;
    own << turn * Eigen::Vector3d(drift.head<3>()), turn * Eigen::Vector3d(drift.tail<3>());
    record.T_reference_frame = record.T_reference_frame * ExpSE3(own * -part);
  }
}

void FrameHistory::Rescale(const std::map<int, Similarity>& S_world_keyframe) {
  for (Record& record : records_) {
    const auto moved = S_world_keyframe.find(record.reference);
    if (moved != S_world_keyframe.end()) record.T_reference_frame.translation *= moved->second.scale;
  }
}

void FrameHistory::Rehang(const std::map<int, int>& into, const Map& map) {
  for (Record& record : records_) {
    for (auto next = into.find(record.reference); next != into.end(); next = into.find(record.reference)) {
      const Pose T_into_removed =
          map.keyframe(next->second).T_world_camera.Inverse() * map.keyframe(record.reference).T_world_camera;
      record.T_reference_frame = T_into_removed * record.T_reference_frame;
      record.reference = next->second;
    }
  }
}

std::vector<int> FrameHistory::Pieces(const Map& map, const FrameRange& range) const {
  std::map<int, int> frames;
  for (const Record& r : records_) {
    if (range.Has(r.index)) ++frames[map.keyframe(r.reference).piece];
  }
  std::vector<int> pieces;
  pieces.reserve(frames.size());
  for (const auto& [piece, count] : frames) pieces.push_back(piece);
  std::stable_sort(pieces.begin(), pieces.end(), [&](int a, int b) { return frames[a] > frames[b]; });
  return pieces;
}

std::vector<const FrameHistory::Record*> FrameHistory::Of(const Map& map, int piece,
                                                          const FrameRange& range) const {
  if (piece < 0) {
    const std::vector<int> pieces = Pieces(map, range);
    if (!pieces.empty()) piece = pieces.front();
  }
  std::vector<const Record*> out;
  for (const Record& r : records_) {
    if (range.Has(r.index) && map.keyframe(r.reference).piece == piece) out.push_back(&r);
  }
  return out;
}

Trajectory FrameHistory::Poses(const Map& map, int piece, const FrameRange& range) const {
  Trajectory out;
  for (const Record* r : Of(map, piece, range))
    out.push_back({r->stamp_s, map.keyframe(r->reference).T_world_camera * r->T_reference_frame});
  return out;
}

std::vector<std::int64_t> FrameHistory::Indices(const Map& map, int piece, const FrameRange& range) const {
  std::vector<std::int64_t> out;
  for (const Record* r : Of(map, piece, range)) out.push_back(r->index);
  return out;
}

}  // namespace tutti
