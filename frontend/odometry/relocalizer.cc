#include "frontend/odometry/relocalizer.h"

#include <utility>

namespace tutti {
namespace {
constexpr std::size_t kMostLost = 100;  // frames
}  // namespace

void Relocalizer::Found() {
  lost_.reset();
  since_s_.reset();
}

void Relocalizer::Keep(const TrackedFrame& frame) {
  lost_ = frame;
  earlier_.push_back(frame);
  earlier_.back().features = WithoutImages(*frame.features);
  if (earlier_.size() > kMostLost) earlier_.erase(earlier_.begin());
}

void Relocalizer::Wait(const TrackedFrame& frame) { Keep(frame); }

std::vector<TrackedFrame> Relocalizer::TakeLost() { return std::exchange(earlier_, {}); }

bool Relocalizer::Lose(const TrackedFrame& frame) {
  Keep(frame);
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
