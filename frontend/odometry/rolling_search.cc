#include "frontend/odometry/rolling_search.h"

#include <algorithm>
#include <utility>

#include "frontend/map/measured.h"
#include "frontend/odometry/depth_rotation.h"

namespace tutti {
namespace {

// How fast the motion of a camera in a hand changes: about 200 deg/s at 1 Hz.
constexpr double kTurningChange = 20;   // [rad/s^2]
constexpr double kMovingChange = 2;     // [1/s^2], in units of the depth of what is in view
constexpr double kTurningJerk = 140;    // [rad/s^3]
constexpr double kMovingJerk = 15;      // [1/s^3], in units of that depth
constexpr double kTurningNoise = 0.02;  // of what rows tell [rad/s]
constexpr double kMovingNoise = 0.01;   // [1/s], in units of that depth
constexpr double kUnknownDepth = 3;     // of a view without landmarks [m]
constexpr double kBlurred = 0.03;       // corners are at the ends of streaks that are longer [rad]
constexpr double kLongExposure = 0.03;  // of what may be blurred as long as nothing is known [s]
constexpr int kAskAgain = 8;            // frames, after which the exposure may be another
constexpr double kManyInliers = 3;      // that outweigh grey values, in units of those that a pose needs
constexpr int kMostByGrey = 300;        // frames in a row that grey values alone pose
constexpr double kDepthHolds = 0.5;     // a depth image, aligned with the one before by its surfaces [s]
constexpr int kLeastWithDepth = 50;     // features that make a keyframe where no landmark is found
constexpr double kLongestByDepth = 2;   // that a camera goes on before a plain surface [s]
constexpr double kFastestTurn = 10;     // [rad/s]
constexpr double kFastestMove = 2;      // [1/s], in units of the depth of what is in view

Vector6d Sigma(double dt, double depth) {
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(kMovingChange * depth * dt),
      Eigen::Vector3d::Constant(kTurningChange * dt);
  return sigma;
}

// Of a motion that steps between frames tell.
Vector6d SigmaOfChange(double dt, double depth) {
  const double curve = 5.0 / 12 * dt * dt;  // what an even change leaves out
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(depth * (kMovingJerk * curve + kMovingNoise)),
      Eigen::Vector3d::Constant(kTurningJerk * curve + kTurningNoise);
  return sigma;
}

// How fast what is in view moves, as seen by the camera [rad/s].
double SpeedOf(const Vector6d& motion, double depth) {
  return motion.tail<3>().norm() + motion.head<3>().norm() / depth;
}

}  // namespace

RollingSearch::Expected RollingSearch::Expect(const Map& map, const TrackedFrame& frame,
                                              const LastFrame& last) const {
  const double depth = map.MedianDepth(last.reference), dt = frame.Time() - last.frame.Time();
  Expected expected;
  expected.depth = depth > 0 ? depth : kUnknownDepth;
  const bool known = last.velocity && dt > 0 && dt < kMotionHolds;
  if (known) expected.camera.motion = *last.velocity;
  const bool turned = frame.turn && dt > 0 && dt < kMotionHolds;
  if (turned) expected.camera.motion.tail<3>() = LogSO3(*frame.turn) / dt;
  expected.camera.T_camera_world = ExpSE3(expected.camera.motion * dt) * last.T_camera_world;
  const Vector6d next = last.motion + dt * last.change;  // of a camera that goes on changing its motion
  for (const Vector6d& motion : {expected.camera.motion, next})
    expected.speed_rad_s = std::max(expected.speed_rad_s, SpeedOf(motion, expected.depth));
  expected.exposure_s = last.exposure.Seconds();
  expected.prior.motion = expected.camera.motion;
  expected.prior.sigma = Sigma(known ? dt : kMotionHolds, expected.depth);
  if (known && shutter_.Rolls() && last.by_grey == 0) {
    expected.prior.since_s = dt;
    expected.prior.T_camera_world_before = last.T_camera_world;
    expected.prior.motion_before = *last.velocity;
    const double curve = dt * dt / 12;  // of the trapezoidal rule
    expected.prior.mean_sigma << Eigen::Vector3d::Constant(expected.depth *
                                                           (kMovingJerk * curve + kMovingNoise)),
        Eigen::Vector3d::Constant(kTurningJerk * curve + kTurningNoise);
  }
  return expected;
}

std::shared_ptr<const FrameFeatures> RollingSearch::Straight(const TrackedFrame& frame,
                                                             const Expected& expected) const {
  return shutter_.Rolls() ? shutter_.Straighten(*frame.features, expected.camera.motion, expected.depth)
                          : frame.features;
}

std::optional<PoseFix> RollingSearch::Find(const Map& map, const TrackedFrame& frame, const LastFrame& last,
                                           bool lost) const {
  if (last.reference < 0) return std::nullopt;
  Expected expected = Expect(map, frame, last);
  const auto misfits = lost ? std::nullopt : MisfitsOf(map, frame, last, expected);
  if (misfits) {
    ExposureEstimate exposure = last.exposure;
    exposure.Add(*misfits);
    expected.exposure_s = exposure.Seconds();
  }
  std::optional<PoseFix> fix = FindExpected(map, frame, last, expected, lost);
  if (fix) fix->misfits = misfits;
  return fix;
}

std::optional<PoseFix> RollingSearch::FindExpected(const Map& map, const TrackedFrame& frame,
                                                   const LastFrame& last, const Expected& expected,
                                                   bool lost) const {
  std::optional<PoseFix> fix;
  const bool soon = frame.Time() - last.frame.Time() < kMotionHolds;
  if (!lost && soon && expected.speed_rad_s * expected.exposure_s > kBlurred)
    fix = Blurred(map, frame, last, expected);
  if (fix) return fix;
  if (last.by_grey > 0) fix = Near(map, frame, last, expected);
  if (!fix) {
    TrackedFrame straight = frame;
    straight.features = Straight(frame, expected);
    fix = search_.Find(map, straight, last, lost);
    if (!fix) return lost ? fix : ByGreyValues(map, frame, last, expected);
    if (shutter_.Rolls()) fix = Again(map, *frame.features, expected, *std::move(fix));
  }
  if (last.by_grey > 0) {
    if (const auto by_grey = Aligned(map, frame, last, expected))
      fix->drift = LogSE3(fix->T_camera_world * by_grey->T_camera_world.Inverse());
  }
  return fix;
}

// Landmarks around the place where the camera is expected.
std::optional<PoseFix> RollingSearch::Near(const Map& map, const TrackedFrame& frame, const LastFrame& last,
                                           const Expected& expected) const {
  TrackedFrame straight = frame;
  straight.features = Straight(frame, expected);
  std::optional<PoseFix> fix =
      search_.FindNear(map, straight, last.reference, expected.camera.T_camera_world);
  return fix && shutter_.Rolls() ? Again(map, *frame.features, expected, *std::move(fix)) : fix;
}

ImageAligner::Reference RollingSearch::ReferenceOf(const Map& map, const LastFrame& last,
                                                   double time_s) const {
  const FrameFeatures& before = *last.frame.features;
  ImageAligner::Reference reference{&before,
                                    {last.T_camera_world, last.motion, last.change},
                                    std::vector<double>(before.size(), 0),
                                    time_s - last.frame.Time(),
                                    last.step};
  for (std::size_t f = 0; f < before.size(); ++f) {
    const int l = last.matches.landmarks[f];
    if (l >= 0 && map.landmark(l).alive) {
      reference.depth[f] = (last.T_camera_world * map.landmark(l).position).z();
    } else if (before.inverse_depth[f] > 0 &&
               before.inverse_depth_sigma[f] < 0.2F * before.inverse_depth[f]) {
      reference.depth[f] = 1 / double(before.inverse_depth[f]);
    }
  }
  return reference;
}

// Of an image that is expected to be blurred: by grey values, unless it is sharp after all and shows the map.
std::optional<PoseFix> RollingSearch::Blurred(const Map& map, const TrackedFrame& frame,
                                              const LastFrame& last, const Expected& expected) const {
  if (last.by_grey >= kMostByGrey) return std::nullopt;
  const std::optional<CameraMotion> aligned = Aligned(map, frame, last, expected);
  if (!aligned) return std::nullopt;
  Expected found = expected;
  found.camera = *aligned;
  PoseFix fix = FixByGrey(frame, last, found);
  fix.sharp = SpeedOf(aligned->motion, expected.depth) * expected.exposure_s <= kBlurred;
  if (!fix.sharp) return fix;
  found.prior.motion = aligned->motion;
  found.prior.sigma = SigmaOfChange(frame.Time() - last.frame.Time(), expected.depth);
  found.prior.since_s = 0;
  std::optional<PoseFix> near = Near(map, frame, last, found);
  if (!near || near->inliers < kManyInliers * options_.min_inliers) return fix;
  near->drift = LogSE3(near->T_camera_world * fix.T_camera_world.Inverse());
  return near;
}

PoseFix RollingSearch::FixByGrey(const TrackedFrame& frame, const LastFrame& last,
                                 const Expected& found) const {
  TrackedFrame straight = frame;
  straight.features = Straight(frame, found);
  PoseFix fix(straight);
  fix.T_camera_world = found.camera.T_camera_world;
  fix.reference = last.reference;
  fix.by_grey = true;
  if (shutter_.RowsTell()) fix.motion = found.camera.motion;
  return fix;
}

// What a fast frame says of its exposure, if it is asked.
std::optional<ExposureEstimate::Misfits> RollingSearch::MisfitsOf(const Map& map, const TrackedFrame& frame,
                                                                  const LastFrame& last,
                                                                  const Expected& expected) const {
  const bool ask = last.exposure.IsOpen() || frame.index % kAskAgain == 0;
  if (!(frame.Time() - last.frame.Time() < kMotionHolds)) return std::nullopt;
  if (!ask || !(expected.speed_rad_s * kLongExposure > kBlurred)) return std::nullopt;
  const std::optional<CameraMotion> aligned = Aligned(map, frame, last, expected);
  if (!aligned) return std::nullopt;
  const auto misfits = aligner_.Misfits(ReferenceOf(map, last, frame.Time()), *frame.features, *aligned);
  return misfits[0] > 0 ? std::optional(misfits) : std::nullopt;
}

// Where the grey values of the last frame say that the camera is.
std::optional<CameraMotion> RollingSearch::Aligned(const Map& map, const TrackedFrame& frame,
                                                   const LastFrame& last, const Expected& expected) const {
  const double dt = frame.Time() - last.frame.Time();
  const bool depth = frame.features->depth_grid && last.frame.features->depth_grid;
  if (!(dt > 0 && dt < (depth ? kDepthHolds : kMotionHolds))) return std::nullopt;
  MotionPrior prior = expected.prior;
  if (last.step) prior.sigma = SigmaOfChange(dt, expected.depth);
  std::optional<CameraMotion> found = aligner_.Align(ReferenceOf(map, last, frame.Time()), *frame.features,
                                                     expected.camera, prior, expected.exposure_s);
  if (!found) return std::nullopt;
  const Vector6d step = LogSE3(found->T_camera_world * last.T_camera_world.Inverse());
  const bool possible =
      step.tail<3>().norm() < kFastestTurn * dt && step.head<3>().norm() < kFastestMove * expected.depth * dt;
  return possible ? found : std::nullopt;
}

// By the surfaces of this frame and the last; in the directions that they leave open, the camera goes on as
// it did.
std::optional<CameraMotion> RollingSearch::ByDepth(const TrackedFrame& frame, const LastFrame& last,
                                                   const Expected& expected) const {
  const double dt = frame.Time() - last.frame.Time();
  const auto &before = last.frame.features->depth_grid, &now = frame.features->depth_grid;
  if (!(dt > 0 && dt < kDepthHolds) || !before || !now || !last.mean_velocity) return std::nullopt;
  const Vector6d sigma = dt * Sigma(dt, expected.depth);
  const auto aligned = AlignDepth(
      shutter_, {*before, last.motion}, {*now, *last.mean_velocity}, ExpSE3(*last.mean_velocity * dt),
      Matrix6d(sigma.cwiseAbs2().cwiseInverse().asDiagonal()), options_.rgbd_inverse_sigma);
  if (!aligned) return std::nullopt;
  CameraMotion found;
  found.T_camera_world = aligned->T_second_first * last.T_camera_world;
  found.motion = *last.mean_velocity;
  return found;
}

std::optional<PoseFix> RollingSearch::ByGreyValues(const Map& map, const TrackedFrame& frame,
                                                   const LastFrame& last, const Expected& expected) const {
  if (last.by_grey >= kMostByGrey) return std::nullopt;
  const double dt = frame.Time() - last.frame.Time();
  const std::optional<CameraMotion> by_depth = ByDepth(frame, last, expected);
  Expected better = expected;
  // Grey values are compared near the place where they are expected: far apart in time, that is not the last.
  if (by_depth && dt >= kMotionHolds) better.camera = *by_depth;
  std::optional<CameraMotion> found = Aligned(map, frame, last, better);
  if (!found && (last.by_grey + 1) * dt < kLongestByDepth) found = by_depth;
  if (!found) return std::nullopt;
  better.camera.T_camera_world = found->T_camera_world;
  if (shutter_.RowsTell()) better.camera.motion = found->motion;
  if (auto fix = Near(map, frame, last, better)) return fix;
  PoseFix fix = FixByGrey(frame, last, better);
  // A slow camera's images are sharp whatever the exposure; the view changes while the map stays behind.
  const auto& depths = frame.features->inverse_depth;
  const bool new_landmarks =
      std::count_if(depths.begin(), depths.end(), [](float d) { return d > 0; }) >= kLeastWithDepth;
  const bool slow = SpeedOf(last.motion, expected.depth) * kLongExposure <= kBlurred;
  fix.sharp = last.exposure.IsKnown() || (slow && new_landmarks);
  return fix;
}

std::optional<PoseFix> RollingSearch::FindAt(const Map& map, const TrackedFrame& frame, int keyframe) const {
  std::optional<PoseFix> fix = search_.FindAt(map, frame, keyframe);
  if (!fix || !shutter_.Rolls() || !frame.features->rolled.empty()) return fix;
  const double depth = map.MedianDepth(keyframe);
  Expected expected;
  expected.depth = depth > 0 ? depth : kUnknownDepth;
  expected.prior.sigma = Sigma(kMotionHolds, expected.depth);
  return Again(map, *frame.features, expected, *std::move(fix));
}

// `seen`: the features as the image has them.
PoseFix RollingSearch::Again(const Map& map, const FrameFeatures& seen, const Expected& expected,
                             PoseFix fix) const {
  // Where the image has them, those that were aligned more precisely.
  FrameFeatures found = seen;
  const FrameFeatures& straight = *fix.frame.features;
  found.pyramid = straight.pyramid;
  found.aligned = straight.aligned;
  std::vector<PointObservation> observations;
  for (std::size_t f = 0; f < seen.size(); ++f) {
    const Eigen::Vector2d rolled = straight.Rolled(f);
    found.keypoints[f].pt = straight.keypoints[f].pt -
                            cv::Point2f(static_cast<float>(rolled.x()), static_cast<float>(rolled.y()));
    if (seen.depth_image) {  // as it was looked up, when the row was read
      const cv::Point2f& middle = straight.keypoints[f].pt;
      const double inverse = double(straight.inverse_depth[f]);
      const Pose T_row_middle = ExpSE3(expected.camera.motion * shutter_.TimeOf(found.keypoints[f].pt.y));
      const Eigen::Vector3d p = T_row_middle * (shutter_.camera().Unproject({middle.x, middle.y}) / inverse);
      found.inverse_depth[f] = inverse > 0 && p.z() > kMinDepth ? static_cast<float>(1 / p.z()) : 0.0F;
      found.inverse_depth_sigma[f] = straight.inverse_depth_sigma[f];
    }
    const int l = fix.matches.landmarks[f];
    if (l >= 0)
      observations.push_back(Measured(map, found, {-1, static_cast<int>(f)}, l, options_.pixel_sigma));
  }
  Pose T_camera_world = fix.T_camera_world;
  Vector6d motion;
  std::vector<char> inlier;
  const MotionPrior& prior = expected.prior;
  if (!shutter_.RowsTell()) {  // the step from the last frame does, if it goes on changing as it did
    if (!(prior.since_s > 0)) return fix;
    const Vector6d step = LogSE3(T_camera_world * prior.T_camera_world_before.Inverse()) / prior.since_s;
    motion = step + 0.5 * (step - prior.motion_before);
  } else if (shutter_.Refine(observations, prior, &T_camera_world, &motion, &inlier) < options_.min_inliers) {
    return fix;
  }
  PoseFix again = fix;
  again.frame.features = shutter_.Straighten(found, motion, expected.depth);
  again.matches.features = again.frame.features.get();
  again.T_camera_world = T_camera_world;
  if (shutter_.RowsTell()) again.motion = motion;
  return search_.SettleAgain(map, &again) && again.inliers >= options_.min_inliers ? again : fix;
}

}  // namespace tutti
