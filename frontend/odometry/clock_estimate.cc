#include "frontend/odometry/clock_estimate.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <tuple>

#include "core/dense_solvers.h"
#include "core/least_squares.h"
#include "core/numbers.h"
#include "frontend/map/matcher.h"
#include "frontend/odometry/depth_rotation.h"

namespace tutti {
namespace {

constexpr std::size_t kMostViews = 1;  // of a landmark: poses and points that were adjusted absorb the rest
constexpr double kFastest = 1.5;       // turning beyond which what is bent is far from linear [rad/s]
constexpr double kFast = 0.5;        // difference of two turning rates that bends a landmark's pixel [rad/s]
constexpr double kTurnChange = 0.4;  // of the rate from frame to frame that tells a time [rad/s]
constexpr float kWide = 3;           // factor of the radius in which landmarks are looked for
constexpr int kFewestLandmarks = 60;
constexpr std::size_t kFewestMeasurements = 8;
constexpr int kRounds = 6;      // of robust least squares
constexpr double kPixel = 1.5;  // at which its loss becomes linear [px]

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;

}  // namespace

std::pair<double, double> Measurements::Mean() const {
  if (all_.size() < kFewestMeasurements) return {0, std::numeric_limits<double>::infinity()};
  std::vector<double> values;
  for (const auto& [value, sigma] : all_) values.push_back(value);
  double mean = internal::Median(values), scatter = 0;
  for (int round = 0; round < kRounds; ++round) {
    double weights = 0, sum = 0, squares = 0;
    for (const auto& [value, sigma] : all_) {
      const double off = (value - mean) / sigma;
      const double w = internal::HuberWeight(off * off, 4.0) / (sigma * sigma);
      weights += w;
      sum += w * value;
      squares += w * w * (value - mean) * (value - mean);
    }
    mean = sum / weights;
    scatter = std::sqrt(squares) / weights;
  }
  return {mean, scatter};
}

ClockEstimate::ClockEstimate(const CameraRig& rig, const OdometryOptions& options)
    : readout_wanted_(rig.sensor == Sensor::kRgbd && rig.readout_s == 0),
      measures_(rig.sensor == Sensor::kRgbd),
      shutter_(rig),
      camera_(rig.camera),
      inverse_sigma_(options.rgbd_inverse_sigma) {}

void ClockEstimate::Break() {
  steps_.clear();
  before_.reset();
}

std::optional<ClocksFound> ClockEstimate::Found() const {
  if (!measures_) return std::nullopt;
  ClocksFound found;  // an infinite standard deviation of the readout where the rig tells it
  std::tie(found.readout_s, found.readout_sigma_s) = readout_.Mean();
  std::tie(found.depth_delay_s, found.depth_delay_sigma_s) = delay_.Mean();
  return found;
}

void ClockEstimate::Add(const Map& map, const TrackedFrame& seen, const PoseFix& fix, const LastFrame& last,
                        int keyframe) {
  if (!measures_) return;
  if (!last.step || fix.by_grey) {
    Break();
    return;
  }
  const double dt = steps_.empty() ? 0 : fix.frame.Time() - time_s_;
  time_s_ = fix.frame.Time();
  if (motions_.empty() || motions_.rbegin()->first < last.newest_keyframe)
    motions_.emplace(last.newest_keyframe, *last.step);  // that a submap began with
  if (readout_wanted_ && before_ && !steps_.empty()) {
    const Vector6d motion = 0.5 * (steps_.back().motion + *last.step);
    if (keyframe_before_ >= 0) motions_[keyframe_before_] = motion;
    MeasureReadout(map, *before_, motion);
  }
  steps_.push_back({*last.step, dt, seen.features->depth_later_s, seen.features->depth_grid});
  if (steps_.size() > 4) steps_.pop_front();
  if (steps_.size() == 4) MeasureDelay();
  if (readout_wanted_) before_ = fix;
  keyframe_before_ = keyframe;
}

// By the second and third of four frames, whose turning both neighbours tell.
void ClockEstimate::MeasureDelay() {
  const Step &first = steps_[1], &second = steps_[2], &next = steps_[3];
  if (!first.depth || !second.depth || !(first.dt > 0 && second.dt > 0 && next.dt > 0)) return;
  const Eigen::Vector3d before = first.motion.tail<3>(), between = second.motion.tail<3>(),
                        after = next.motion.tail<3>();
  const Eigen::Vector3d at_first = 0.5 * (before + between), at_second = 0.5 * (between + after);
  const Eigen::Vector3d change = at_second - at_first;
  if (!(change.norm() > kTurnChange)) return;
  Vector6d motion_first = 0.5 * (steps_[1].motion + steps_[2].motion),
           motion_second = 0.5 * (steps_[2].motion + steps_[3].motion);
  const auto found = RotationByDepth(shutter_, {*first.depth, motion_first}, {*second.depth, motion_second},
                                     ExpSE3(second.motion * second.dt), inverse_sigma_);
  if (!found) return;
  const Eigen::Vector3d apart =
      found->rotation_rad - between * second.dt - second.later_s * at_second + first.later_s * at_first;
  const double weight = change.dot(found->information * change);
  if (!(weight > 0)) return;
  // Depth's noise is not all: surfaces are no planes.
  delay_.Add(-change.dot(found->information * apart) / weight,
             std::hypot(1 / std::sqrt(weight), 2e-3 / change.norm()));
}

void ClockEstimate::MeasureReadout(const Map& map, const PoseFix& fix, const Vector6d& motion) {
  const auto moves_else = [&](int l) {
    const auto made = motions_.find(map.landmark(l).reference);
    return map.landmark(l).alive && map.landmark(l).observations.size() <= kMostViews &&
           made != motions_.end() && (made->second - motion).tail<3>().norm() > kFast &&
           made->second.tail<3>().norm() < kFastest;
  };
  if (!(motion.tail<3>().norm() < kFastest)) return;
  std::vector<int> landmarks;
  std::copy_if(fix.visible.begin(), fix.visible.end(), std::back_inserter(landmarks), moves_else);
  if (static_cast<int>(landmarks.size()) < kFewestLandmarks) return;
  const FrameFeatures& features = *fix.frame.features;
  FrameMatches matches{&features, std::vector<int>(features.size(), -1)};
  std::vector<int> visible;
  if (MatchToLandmarks(map, camera_, fix.T_camera_world, landmarks, kWide, &matches, &visible) <
      kFewestLandmarks)
    return;
  struct Seen {
    Eigen::Vector2d r;
    Eigen::Matrix<double, 2, 7> j;
  };
  std::vector<Seen> all;
  for (std::size_t f = 0; f < features.size(); ++f) {
    const int l = matches.landmarks[f];
    if (l < 0) continue;
    const Eigen::Vector3d p = fix.T_camera_world * map.landmark(l).position;
    if (!(p.z() > 0.1)) continue;
    Eigen::Matrix<double, 2, 3> projection;
    projection << camera_.fx / p.z(), 0, -camera_.fx * p.x() / (p.z() * p.z()), 0, camera_.fy / p.z(),
        -camera_.fy * p.y() / (p.z() * p.z());
    Eigen::Matrix<double, 3, 6> moves;
    moves << Eigen::Matrix3d::Identity(), -Skew(p);
    Seen seen;
    const Eigen::Vector2d pixel(features.keypoints[f].pt.x, features.keypoints[f].pt.y);
    seen.r = pixel - camera_.Project(p);
    seen.j.leftCols<6>() = projection * moves;
    const auto tau = [&](double row) { return row / (camera_.height - 1) - 0.5; };
    const Landmark& landmark = map.landmark(l);
    const Keyframe& maker = map.keyframe(landmark.reference);
    const Pose T_frame_maker = fix.T_camera_world * maker.T_world_camera;
    const Eigen::Vector3d there = maker.T_world_camera.Inverse() * landmark.position;
    const Vector6d& made = motions_.at(landmark.reference);
    const Eigen::Vector3d bent = T_frame_maker.rotation * (made.head<3>() + made.tail<3>().cross(there));
    seen.j.col(6) = projection * (moves * motion * tau(pixel.y()) - bent * tau(camera_.Project(there).y()));
    all.push_back(seen);
  }
  if (static_cast<int>(all.size()) < kFewestLandmarks) return;
  Vector7d x = Vector7d::Zero();
  Matrix7 hessian;
  double squares = 0, weights = 0;
  for (int round = 0; round < kRounds; ++round) {
    hessian.setZero();
    Vector7d gradient = Vector7d::Zero();
    squares = weights = 0;
    for (const Seen& seen : all) {
      const Eigen::Vector2d off = seen.r - seen.j * x;
      const double w = internal::HuberWeight(off.squaredNorm(), kPixel * kPixel);
      hessian += w * seen.j.transpose() * seen.j;
      gradient += w * seen.j.transpose() * off;
      squares += w * w * off.squaredNorm();
      weights += w;
    }
    hessian.diagonal().array() += 1e-6;
    x += internal::SolveLdlt(hessian, gradient);
  }
  const internal::SmallMatrix covariance = internal::Inverse(hessian);
  const double sigma = std::sqrt(covariance(6, 6) * squares / std::max(1.0, 2 * weights - 7));
  if (std::isfinite(x(6)) && sigma > 0) readout_.Add(x(6), std::hypot(sigma, 2e-3));
}

}  // namespace tutti
