#include "apps/run/frame_places.h"

namespace tutti {
namespace {

template <class Key>
std::optional<Eigen::Vector3d> Find(const std::map<Key, Eigen::Vector3d>& places, Key key) {
  const auto found = places.find(key);
  if (found == places.end()) return std::nullopt;
  return found->second;
}

}  // namespace

FramePlaces::FramePlaces(const RunResult& result, const Similarity& alignment) {
  for (const StampedPose& pose : result.trajectory) own_[pose.stamp_s] = alignment * pose.pose.translation;
  if (!result.map) return;
  first_frame_ = result.map->sessions.back().frame_offset;
  for (const auto& [frame, pose] : result.map->keyframes) earlier_[frame] = alignment * pose.translation;
}

std::optional<Eigen::Vector3d> FramePlaces::At(double stamp_s) const { return Find(own_, stamp_s); }

std::optional<Eigen::Vector3d> FramePlaces::AtEnd(std::int64_t frame, double stamp_s) const {
  return frame < first_frame_ ? Find(earlier_, frame) : At(stamp_s);
}

}  // namespace tutti
