#include "frontend/map/self_calibration.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/dense_solvers.h"

namespace tutti {
namespace {

constexpr double kVisible = 0.1;     // [px]: smaller corrections wait
constexpr double kOutOfSight = 1e6;  // [px]: nothing is seen further away

}  // namespace

SelfCalibration::SelfCalibration(const OdometryOptions& options, const CameraRig& rig)
    : camera_(rig.camera), enabled_(rig.sensor == Sensor::kMono && options.lens_sigma > 0) {
  if (enabled_) first_ = Eigen::Matrix2d::Identity() / (options.lens_sigma * options.lens_sigma);
  remaining_.information = first_;
}

std::shared_ptr<const FrameFeatures> SelfCalibration::Correct(
    const std::shared_ptr<const FrameFeatures>& features) const {
  if (applied_.isZero()) return features;
  return Moved(*features);
}

void SelfCalibration::Learn(const LensError& seen, int keyframes, Map* map) {
  if (!enabled_) return;
  // A window that knows less than was known at the start tells more of its other errors than of the lens.
  if (!(seen.information(0, 0) > first_(0, 0))) return;
  // Each view is in about as many windows as a window has keyframes; counted once, it tells so much less.
  const double share = 1.0 / std::max(1, keyframes);
  remaining_.information += share * seen.information;
  remaining_.value += share * internal::SolveLdlt<2>(remaining_.information,
                                                     seen.information * (seen.value - remaining_.value));
  const Eigen::Vector2d lens = remaining_.value;
  if (LargestMove(lens) < kVisible) return;
  remaining_.value.setZero();
  applied_ += lens;
  for (int id = 0; id < map->KeyframeCount(); ++id) {
    if (std::as_const(*map).keyframe(id).features->other_camera) continue;
    Keyframe& k = map->keyframe(id);
    k.features = Moved(*k.features);
  }
  const Eigen::Vector2d sigma = Sigma();
  const std::int64_t frame =
      map->KeyframeCount() > 0 ? std::as_const(*map).keyframe(map->KeyframeCount() - 1).frame_index : 0;
  steps_.push_back({frame, applied_.x(), applied_.y(), sigma.x(), sigma.y()});
}

// Standard deviations of k1 and k2.
Eigen::Vector2d SelfCalibration::Sigma() const {
  return remaining_.information.inverse().diagonal().cwiseSqrt();
}

LensFound SelfCalibration::Found() const {
  const Eigen::Vector2d value = applied_ + remaining_.value, sigma = Sigma();
  return {value.x(), value.y(), sigma.x(), sigma.y(), steps_};
}

// Of a pixel, over the way from the principal point to the farthest corner.
double SelfCalibration::LargestMove(const Eigen::Vector2d& lens) const {
  const Eigen::Vector2d centre(camera_.cx, camera_.cy);
  const Eigen::Vector2d corner(camera_.cx > 0.5 * camera_.width ? 0 : camera_.width,
                               camera_.cy > 0.5 * camera_.height ? 0 : camera_.height);
  double largest = 0;
  for (const double share : {0.4, 0.6, 0.8, 1.0}) {
    const Eigen::Vector2d pixel = centre + share * (corner - centre);
    largest = std::max(largest, (LensError::Jacobian(camera_, pixel) * lens).norm());
  }
  return largest;
}

std::shared_ptr<const FrameFeatures> SelfCalibration::Moved(const FrameFeatures& features) const {
  auto moved = std::make_shared<FrameFeatures>(features);
  for (std::size_t f = 0; f < moved->size(); ++f) {
    cv::KeyPoint& k = moved->keypoints[f];
    const Eigen::Vector2d rolled = features.Rolled(f), seen(k.pt.x - rolled.x(), k.pt.y - rolled.y());
    const Eigen::Vector2d raw = LensError::Uncorrect(camera_, features.lens, seen);
    const Eigen::Vector2d to = LensError::Correct(camera_, applied_, raw) + rolled;
    // An error so large that Uncorrect does not come to an end says nothing of where the pixel belongs.
    if (std::abs(to.x()) < kOutOfSight && std::abs(to.y()) < kOutOfSight)
      k.pt = cv::Point2f(static_cast<float>(to.x()), static_cast<float>(to.y()));
  }
  moved->lens = applied_;
  moved->BuildGrid(camera_.width, camera_.height);
  return moved;
}

}  // namespace tutti
