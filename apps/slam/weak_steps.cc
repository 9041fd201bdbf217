#include "apps/slam/weak_steps.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "core/dense_solvers.h"
#include "core/numbers.h"
#include "core/reprojection.h"
#include "frontend/map/map_frames.h"

namespace tutti {
namespace {

constexpr int kLeastHeld = 6;            // landmarks that hold a pose
constexpr double kUnheld = 0.1;          // of the depth: step that fewer hold
constexpr double kTimesWeaker = 3;       // than the median of the new keyframes
constexpr int kComparedSteps = 200;      // and of so many before them
constexpr double kAround_s = 0.5;        // on either side, whose speeds tell what is usual
constexpr double kTimesFaster = 3;       // than usual: a slide
constexpr double kLeastSlide = 0.002;    // of the depth, from frame to frame
constexpr double kLongestStep_s = 0.25;  // between frames that are compared
constexpr std::size_t kFewestSpeeds = 8;

// Of the newer keyframe's pose, by landmarks that both see.
std::optional<MotionSigma> Held(const Map& map, const Keyframe& older, const Keyframe& newer,
                                double pixel_sigma) {
  const Pose T_camera_world = newer.T_world_camera.Inverse();
  Matrix6d information = Matrix6d::Zero();
  int held = 0;
  for (const int l : newer.landmarks) {
    if (l < 0 || !map.landmark(l).alive) continue;
    const auto& seen = map.landmark(l).observations;
    if (std::none_of(seen.begin(), seen.end(), [&](const Observation& o) { return o.keyframe == older.id; }))
      continue;
    const Eigen::Vector3d p = T_camera_world * map.landmark(l).position;
    Eigen::Vector2d residual;
    internal::Reprojection<2>::PointJacobian by_point;
    const internal::Reprojection<2>::Measurement pixel{Eigen::Vector2d::Zero(),
                                                       Eigen::Vector2d::Constant(1 / pixel_sigma)};
    if (!internal::Reprojection<2>::Residual(map.rig().camera, p, pixel, 1e-6, &residual, &by_point))
      continue;
    const auto by_pose = internal::Reprojection<2>::ByPose(by_point, p);
    information += by_pose.transpose() * by_pose;
    ++held;
  }
  if (held < kLeastHeld) return std::nullopt;
  const auto covariance = internal::InverseInformation(information);
  if (!covariance) return std::nullopt;
  const auto worst = [&](int first) {
    const Eigen::Matrix3d part = Matrix6d(*covariance).block<3, 3>(first, first);
    return std::sqrt(std::max(0.0, part.trace()));
  };
  return MotionSigma{worst(0), worst(3)};
}

struct KeyframeStep {
  int older = -1, newer = -1;  // keyframes
  double depth = 0;
  MotionSigma sigma;
  double Share() const { return depth > 0 ? sigma.translation_m / depth : 0; }
};

struct FrameStep {
  double stamp_s = 0, way = 0, seconds = 0;
  int keyframe = -1;  // that the newer frame hangs on
  int piece = 0;
  double Speed() const { return way / seconds; }
};

std::vector<FrameStep> FrameSteps(const Map& map) {
  const std::vector<Pose> poses = FramePoses(map);
  std::vector<FrameStep> steps;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const MapFrame &before = map.frames()[i - 1], &frame = map.frames()[i];
    const double seconds = frame.stamp_s - before.stamp_s;
    const int piece = map.keyframe(frame.keyframe).piece;
    if (!(seconds > 0 && seconds < kLongestStep_s) || map.keyframe(before.keyframe).piece != piece) continue;
    steps.push_back({frame.stamp_s, (poses[i].translation - poses[i - 1].translation).norm(), seconds,
                     frame.keyframe, piece});
  }
  return steps;
}

// By how much each step after `since_s` is longer than those around it explain.
std::vector<double> Slides(const Map& map, const std::vector<FrameStep>& steps, double since_s) {
  std::vector<double> slides(steps.size(), 0);
  std::size_t first = 0, end = 0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    while (first < i && steps[first].stamp_s < steps[i].stamp_s - kAround_s) ++first;
    while (end < steps.size() && (end <= i || steps[end].stamp_s <= steps[i].stamp_s + kAround_s)) ++end;
    if (!(steps[i].stamp_s > since_s)) continue;
    std::vector<double> speeds;
    for (std::size_t k = first; k < end; ++k) {
      if (steps[k].piece == steps[i].piece) speeds.push_back(steps[k].Speed());
    }
    if (speeds.size() < kFewestSpeeds) continue;
    const auto quartile = speeds.begin() + static_cast<std::ptrdiff_t>(3 * speeds.size() / 4);
    std::nth_element(speeds.begin(), quartile, speeds.end());
    if (steps[i].Speed() > kTimesFaster * *quartile &&
        steps[i].way > kLeastSlide * map.MedianDepth(steps[i].keyframe))
      slides[i] = steps[i].way - *quartile * steps[i].seconds;
  }
  return slides;
}

}  // namespace

std::vector<std::pair<int, MotionSigma>> StepSigmas(const Map& map, int after, double pixel_sigma) {
  std::vector<std::pair<int, MotionSigma>> sigmas;
  double first_s = std::numeric_limits<double>::infinity();
  std::map<int, int> newest;  // keyframe of each submap
  std::vector<KeyframeStep> held;
  std::vector<double> shares;
  for (const int id : map.KeyframeIds()) {
    const Keyframe& keyframe = map.keyframe(id);
    const auto before = newest.find(keyframe.piece);
    const int older = before == newest.end() ? -1 : before->second;
    newest[keyframe.piece] = id;
    if (older < 0 || id <= after - kComparedSteps) continue;
    KeyframeStep step{older, id, map.MedianDepth(id), {}};
    step.sigma = Held(map, map.keyframe(older), keyframe, pixel_sigma)
                     .value_or(MotionSigma{kUnheld * step.depth, kUnheld});
    shares.push_back(step.Share());
    if (id > after) first_s = std::min(first_s, map.keyframe(older).stamp_s);
    held.push_back(step);
  }
  const double usual = internal::Median(shares);
  const std::vector<FrameStep> steps = FrameSteps(map);
  const std::vector<double> slides = Slides(map, steps, first_s);
  for (const KeyframeStep& step : held) {
    if (step.newer <= after) continue;
    const Keyframe& keyframe = map.keyframe(step.newer);
    const double depth = step.depth, since_s = map.keyframe(step.older).stamp_s;
    const bool weak = step.Share() > kTimesWeaker * usual;
    MotionSigma sigma = weak ? step.sigma : MotionSigma();
    double slid = 0;
    for (std::size_t i = 0; i < steps.size(); ++i) {
      const bool between = steps[i].stamp_s > since_s && steps[i].stamp_s <= keyframe.stamp_s;
      if (between && steps[i].piece == keyframe.piece) slid += slides[i];
    }
    sigma.translation_m = std::hypot(sigma.translation_m, slid);
    if (depth > 0) sigma.rotation_rad = std::hypot(sigma.rotation_rad, slid / depth);
    sigmas.emplace_back(step.newer, sigma);
  }
  return sigmas;
}

}  // namespace tutti
