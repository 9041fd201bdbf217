#include "frontend/odometry/pose_follower.h"

#include <algorithm>

#include "core/numbers.h"
#include "frontend/geometry/pose_solver.h"
#include "frontend/map/measured.h"
#include "frontend/map/patch_aligner.h"
#include "frontend/odometry/step_check.h"

namespace tutti {
namespace {

constexpr double kPoseSigma = 3;  // a landmark's error by the odometry's drift, in terms of a corner's
constexpr float kRadiusFactor = 3.0F;
constexpr int kNear = 10;     // keyframes whose landmarks a frame is compared with
constexpr double kFar = 0.1;  // of the scene's depth: a new keyframe
constexpr double kFarTurnDeg = 10;
constexpr double kLeast = 0.02, kLeastTurnDeg = 2;  // less motion than this shows nothing new
constexpr double kFewSeen = 0.4;                    // of what the newest keyframe sees

}  // namespace

Pose PoseFollower::Next(const Pose& T_odom_camera, const Pose& T_world_last) {
  Pose T_world_camera = T_odom_camera;
  if (T_odom_last_) {
    Pose step = T_odom_last_->Inverse() * T_odom_camera;
    step.translation *= scale_;
    T_world_camera = T_world_last * step;
    T_world_camera.rotation.normalize();
  }
  T_odom_last_ = T_odom_camera;
  return T_world_camera;
}

PoseFollower::Sight PoseFollower::See(const Map& map, const TrackedFrame& frame, int keyframe,
                                      const Pose& T_camera_world) const {
  Sight sight{PoseFix(frame), {}};
  PoseFix& fix = sight.fix;
  fix.T_camera_world = T_camera_world;
  fix.reference = keyframe;
  std::vector<int> near = map.BestCovisible(keyframe, kNear, 1);
  near.push_back(keyframe);
  MatchToLandmarks(map, rig_.camera, T_camera_world, map.LandmarksOf(near), kRadiusFactor, &fix.matches,
                   &fix.visible);
  if (const auto moved =
          AlignFeatures(map, rig_.camera, T_camera_world, fix.matches.landmarks, *frame.features)) {
    fix.frame.features = moved;
    fix.matches.features = moved.get();
  }
  sight.matched = fix.matches.landmarks;
  for (std::size_t f = 0; f < fix.matches.landmarks.size(); ++f) {
    int& landmark = fix.matches.landmarks[f];
    if (landmark < 0) continue;
    const PointObservation seen = Measured(map, *fix.matches.features, {-1, static_cast<int>(f)}, landmark,
                                           kPoseSigma * options_.pixel_sigma);
    Eigen::Vector3d residual;
    if (!ReprojectionResidual(rig_.camera, T_camera_world, seen, &residual, nullptr) ||
        residual.squaredNorm() > ChiSquareBound(seen)) {
      landmark = -1;
    } else {
      ++fix.inliers;
    }
  }
  fix.found = fix.matches.landmarks;
  return sight;
}

std::optional<StepCheck> PoseFollower::Check(const Map& map, const Sight& sight, int keyframe) const {
  const TrackedFrame& frame = sight.fix.frame;
  const Pose& given = sight.fix.T_camera_world;
  std::optional<StepCheck> near =
      CheckStep(map, rig_, options_, keyframe, *frame.features, sight.matched, given, given);
  // One camera's landmarks are where the odometry says.
  if (near || rig_.sensor == Sensor::kMono) return near;
  const std::optional<PoseFix> found = search_.FindAt(map, frame, keyframe);
  if (!found) return std::nullopt;
  return CheckStep(map, rig_, options_, keyframe, *found->frame.features, found->matches.landmarks, given,
                   found->T_camera_world);
}

bool PoseFollower::WantsKeyframe(const Map& map, const PoseFix& fix, int newest_keyframe) const {
  if (rig_.sensor != Sensor::kMono && !fix.frame.features->has_depth) return false;
  const Keyframe& newest = map.keyframe(newest_keyframe);
  const Pose moved = fix.T_camera_world * newest.T_world_camera;
  const double turn_deg = moved.Angle() / internal::kRadians;
  const double depth = map.MedianDepth(newest_keyframe), way = moved.translation.norm();
  if (turn_deg > kFarTurnDeg) return true;
  if (depth <= 0) return way > 0;  // one camera at the start: every view may be the one that tells depths
  if (way > kFar * depth) return true;
  const auto known =
      std::count_if(newest.landmarks.begin(), newest.landmarks.end(), [](int l) { return l >= 0; });
  const bool few = fix.inliers < kFewSeen * static_cast<double>(known) || fix.inliers < options_.min_inliers;
  return few && (way > kLeast * depth || turn_deg > kLeastTurnDeg);
}

}  // namespace tutti
