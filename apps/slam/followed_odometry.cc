#include "apps/slam/followed_odometry.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/numbers.h"

namespace tutti {
namespace {

OdometryUncertainty::Sigmas Larger(const OdometryUncertainty::Sigmas& a,
                                   const OdometryUncertainty::Sigmas& b) {
  return {std::max(a.fraction, b.fraction), std::max(a.rotation_rad, b.rotation_rad)};
}

// The part of a contradiction that so much does not explain.
double Beyond(const Eigen::Vector3d& contradiction, double explained) {
  return std::sqrt(std::max(0.0, contradiction.squaredNorm() - explained * explained));
}

}  // namespace

FollowedOdometry::FollowedOdometry(const SlamOptions& options, Sensor sensor)
    : configured_{options.odometry_sigma_fraction, options.odometry_sigma_deg * internal::kRadians},
      sensor_(sensor) {}

std::optional<MotionSigma> FollowedOdometry::NoteStep(int keyframe, const StepCheck& check) {
  constexpr double kOwnSigmas = 3, kSlipSigmas = 5;
  images_.Add(check);
  checks_[keyframe] = check;
  const double own_m = kOwnSigmas * check.sigma_translation_m,
               own_rad = kOwnSigmas * check.sigma_rotation_rad;
  const bool contradicted = check.translation_m.norm() > own_m || check.rotation_rad.norm() > own_rad;
  if (!ImagesJudgeSteps() || !contradicted) return std::nullopt;
  const Sigmas seen = Seen(), stated = Stated();
  const double slip_m = seen.fraction > stated.fraction ? 0 : kSlipSigmas * stated.fraction * check.way_m,
               slip_rad = seen.rotation_rad > stated.rotation_rad ? 0 : kSlipSigmas * stated.rotation_rad;
  return MotionSigma{Beyond(check.translation_m, std::max(own_m, slip_m)),
                     Beyond(check.rotation_rad, std::max(own_rad, slip_rad))};
}

std::optional<MotionSigma> FollowedOdometry::NoteMotion(int keyframe, const MotionSigma& sigma,
                                                        const Eigen::Vector3d& position) {
  since_keyframe_ += sigma;
  if (keyframe < 0) return std::nullopt;
  const MotionSigma motion = std::exchange(since_keyframe_, {});
  if (keyframe_) {
    between_keyframes_ += motion;
    way_m2_ += (position - *keyframe_).squaredNorm();
    ++motions_;
  }
  keyframe_ = position;
  return motion;
}

// One camera's landmarks stand where the odometry put them: it sees a turn, and no length.
bool FollowedOdometry::ImagesConfirm(int keyframe, const OdometryJump& jump) const {
  constexpr double kShare = 0.2;  // of the jump
  const auto check = checks_.find(keyframe);
  if (!ImagesJudgeSteps() || check == checks_.end()) return false;
  return check->second.translation_m.norm() < kShare * std::max(jump.distance_m, check->second.way_m) &&
         check->second.rotation_rad.norm() < std::max(kShare * jump.angle_rad, 2 * internal::kRadians);
}

FollowedOdometry::Sigmas FollowedOdometry::Stated() const {
  if (motions_ == 0) return configured_;
  return {way_m2_ > 0 ? between_keyframes_.translation_m / std::sqrt(way_m2_) : 0,
          between_keyframes_.rotation_rad / std::sqrt(motions_)};
}

FollowedOdometry::Sigmas FollowedOdometry::Least() const {
  return motions_ == 0 ? Larger(Seen(), Stated()) : Seen();
}

std::string FollowedOdometry::Warning() const {
  const Sigmas seen = Seen(), stated = Stated();
  if (seen.fraction < stated.fraction && seen.rotation_rad < stated.rotation_rad) return "";
  const Sigmas counts = Larger(seen, stated);
  char text[240];
  std::snprintf(text, sizeof text,
                "the images contradict the odometry by more than its standard deviation says: between two "
                "keyframes %.2g of the way and %.2g deg count, instead of %.2g and %.2g deg",
                counts.fraction, counts.rotation_rad * internal::kDegrees, stated.fraction,
                stated.rotation_rad * internal::kDegrees);
  return text;
}

}  // namespace tutti
