#include "frontend/odometry/reach.h"

namespace tutti {
namespace {
constexpr double kMaxAcceleration = 10;  // [m/s^2]
constexpr double kChange = 0.5;          // of the way from frame to frame, where there are no metres
constexpr double kPoseError = 0.02;      // of the depth
constexpr double kSlip = 0.2;            // of a pose in a blurred image [m]
}  // namespace

bool Reach::Has(const Pose& T_camera_world) const {
  return (T_camera_world.Inverse().translation - center_m).norm() <= radius_m;
}

std::optional<Reach> ReachOf(const LastFrame& last, double time_s, double depth_m, Sensor sensor) {
  const double since = time_s - last.frame.Time();
  if (!last.velocity || !(since > 0 && since <= kVelocityHolds)) return std::nullopt;
  if (sensor == Sensor::kMono) {
    const double way = last.velocity->head<3>().norm() * since;
    return Reach{last.After(since).Inverse().translation, kChange * way + kPoseError * depth_m};
  }
  return Reach{last.After(since).Inverse().translation,
               kMaxAcceleration * since * since + kPoseError * depth_m + kSlip};
}

}  // namespace tutti
