#include "frontend/odometry/relocalizer.h"

namespace tutti {

void Relocalizer::Found() {
  lost_.reset();
  since_s_.reset();
}

bool Relocalizer::Lose(const TrackedFrame& frame) {
  lost_ = frame;
  if (frame.features->size() < static_cast<std::size_t>(options_.min_inliers)) return false;
  if (!since_s_ || !(*since_s_ <= frame.stamp_s)) since_s_ = frame.stamp_s;  // NaN starts no clock
  const bool given_up = frame.stamp_s - *since_s_ > options_.relocalize_s;
  if (given_up) since_s_.reset();
  return given_up;
}

std::optional<PoseFix> Relocalizer::FindAt(int keyframe, const Map& map) const {
  return lost_ ? search_.FindAt(map, *lost_, keyframe) : std::nullopt;
}

}  // namespace tutti
