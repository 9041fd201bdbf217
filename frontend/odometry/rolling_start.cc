#include "frontend/odometry/rolling_start.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/dense_solvers.h"
#include "core/numbers.h"
#include "frontend/map/matcher.h"

namespace tutti {
namespace {

constexpr double kLongestTurn_s = 0.25;  // between frames that tell how the camera turns
constexpr std::size_t kLeastPairs = 30;
constexpr int kTurnRounds = 8;

// The rotation that most pairs of rays agree with: by least squares with weights that fall with the distance
// (Cauchy), in units of the median one. What the camera's way moves differs from ray to ray.
Eigen::Quaterniond TurnOf(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to) {
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  for (int round = 0; round < kTurnRounds; ++round) {
    std::vector<double> off;
    off.reserve(from.size());
    for (std::size_t i = 0; i < from.size(); ++i) off.push_back((to[i] - turn * from[i]).norm());
    const double usual = std::max(1e-9, internal::Median(off));
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < from.size(); ++i) {
      const double weight = 1 / (1 + off[i] * off[i] / (usual * usual));
      const Eigen::Vector3d a = turn * from[i];
      normal += weight * (a.squaredNorm() * Eigen::Matrix3d::Identity() - a * a.transpose());
      right += weight * a.cross(to[i]);
    }
    turn = ExpSO3(internal::SolveLdlt<3>(normal, right)) * turn;
  }
  return turn;
}

}  // namespace

std::optional<Vector6d> TurnBetween(const PinholeCamera& camera, const TrackedFrame& before,
                                    const TrackedFrame& after) {
  const double dt = after.Time() - before.Time();
  if (!(dt > 0 && dt <= kLongestTurn_s)) return std::nullopt;
  std::vector<cv::Point2f> centres;
  for (const cv::KeyPoint& k : before.features->keypoints) centres.push_back(k.pt);
  const float radius = static_cast<float>(std::max(100, camera.width / 10));
  std::vector<Eigen::Vector3d> from, to;
  for (const auto& [a, b] : MatchTwoViews(*before.features, *after.features, radius, &centres)) {
    const cv::Point2f p = before.features->keypoints[static_cast<std::size_t>(a)].pt,
                      q = after.features->keypoints[static_cast<std::size_t>(b)].pt;
    from.push_back(camera.Unproject({p.x, p.y}).normalized());
    to.push_back(camera.Unproject({q.x, q.y}).normalized());
  }
  if (from.size() < kLeastPairs) return std::nullopt;
  Vector6d motion = Vector6d::Zero();
  motion.tail<3>() = LogSO3(TurnOf(from, to)) / dt;
  if (!motion.allFinite()) return std::nullopt;
  return motion;
}

std::optional<Vector6d> TurnIn(const PinholeCamera& camera, const std::vector<TrackedFrame>& before,
                               const TrackedFrame& frame) {
  if (before.empty()) return std::nullopt;
  std::optional<Vector6d> turn = TurnBetween(camera, before.back(), frame);
  if (!turn || before.size() < 2) return turn;
  const TrackedFrame &middle = before[before.size() - 1], &first = before[before.size() - 2];
  if (const auto earlier = TurnBetween(camera, first, middle)) {
    const double dt = frame.Time() - middle.Time(), span = 0.5 * (frame.Time() - first.Time());
    *turn += 0.5 * dt / span * (*turn - *earlier);
  }
  return turn;
}

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
