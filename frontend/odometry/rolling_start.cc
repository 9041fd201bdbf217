#include "frontend/odometry/rolling_start.h"

#include <utility>

namespace tutti {

bool RollingStart::Is(const LastFrame& last) const {
  return depth_ && shutter_.Rolls() && last.reference >= 0 && last.frames_since_keyframe == 0 &&
         last.reference == last.newest_keyframe && last.frame.features && last.frame.features->rolled.empty();
}

std::optional<Vector6d> RollingStart::MotionOf(const LastFrame& first, const PoseFix& next,
                                               const Vector6d& assumed) {
  const double dt = next.frame.Time() - first.frame.Time();
  if (!next.motion || !(dt > 0 && dt < kMotionHolds)) return std::nullopt;
  const Vector6d step = LogSE3(next.T_camera_world * first.T_camera_world.Inverse()) / dt;
  return step - 0.5 * (*next.motion - assumed);
}

std::shared_ptr<const FrameFeatures> RollingStart::Straighten(const FrameFeatures& seen,
                                                              const Vector6d& motion, int keyframe,
                                                              Map* map) const {
  auto straight = shutter_.Straighten(seen, motion, map->MedianDepth(keyframe));
  Keyframe& k = map->keyframe(keyframe);
  k.features = straight;
  for (std::size_t f = 0; f < k.landmarks.size(); ++f) {
    const int l = k.landmarks[f];
    if (l < 0 || !(straight->inverse_depth[f] > 0)) continue;
    const cv::Point2f at = straight->keypoints[f].pt;
    map->landmark(l).position =
        k.T_world_camera * (shutter_.camera().Unproject({at.x, at.y}) / double(straight->inverse_depth[f]));
    map->UpdateGeometry(l);
  }
  return straight;
}

}  // namespace tutti
