// The pose of a frame: guesses from the motion and from keyframes, settled against the local map.
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "frontend/features/patch_aligner.h"
#include "frontend/geometry/measured.h"
#include "frontend/geometry/pose_solver.h"
#include "frontend/odometry/odometry_impl.h"

namespace tutti {
namespace {

constexpr int kMinProjected = 20;           // matches by projection below which the search is widened
constexpr int kMinGuess = 10;               // inliers of a guess
constexpr int kRecentKeyframes = 10;        // that a frame without a pose is compared with
constexpr double kSameGuess = 1.0;          // guesses that differ by less in the image are one [px]
constexpr double kSurePrediction = 0.5;     // a velocity holds for so long [s]
constexpr double kLongestPrediction = 1.5;  // [s]
constexpr double kLeastShare = 0.14;        // of the landmarks in view that must be found again;
constexpr double kSureShare = 0.2;          // with so many nothing else needs to be tried

// Keyframe with most votes by the landmarks seen (ties: the newest); -1 if there is none.
int MostVoted(const std::map<int, int>& votes) {
  int best = -1, most = 0;
  for (const auto& [id, count] : votes) {
    if (count >= most) {
      most = count;
      best = id;
    }
  }
  return best;
}

std::map<int, int> Votes(const Map& map, const std::vector<int>& landmarks) {
  std::map<int, int> votes;
  for (int l : landmarks) {
    if (l < 0 || !map.landmark(l).alive) continue;
    for (const Observation& o : map.landmark(l).observations) ++votes[o.keyframe];
  }
  return votes;
}

}  // namespace

// Where the camera may be, likeliest first: it went on as before, or stopped.
std::vector<Pose> Odometry::Impl::Predictions(double stamp_s) const {
  std::vector<Pose> predictions;
  const auto after = [&](double seconds) { return ExpSE3(velocity_ * seconds) * last_T_camera_world_; };
  const double since = stamp_s - last_stamp_;
  if (has_velocity_) predictions.push_back(after(std::min(since, kLongestPrediction)));
  if (has_velocity_ && since > kSurePrediction) predictions.push_back(after(kSurePrediction));
  predictions.push_back(last_T_camera_world_);
  return predictions;
}

int Odometry::Impl::Refine(FrameMatches* matches, Pose* T_camera_world) const {
  std::vector<PointObservation> observations;
  std::vector<std::size_t> feature;
  for (std::size_t f = 0; f < matches->landmarks.size(); ++f) {
    const int l = matches->landmarks[f];
    if (l < 0) continue;
    observations.push_back(
        Measured(map(), *matches->features, {-1, static_cast<int>(f)}, l, options.pixel_sigma));
    feature.push_back(f);
  }
  if (observations.size() < 6) return 0;
  std::vector<char> inlier;
  const int inliers = RefinePose(rig.camera, observations, T_camera_world, &inlier);
  for (std::size_t i = 0; i < feature.size(); ++i) {
    if (!inlier[i]) matches->landmarks[feature[i]] = -1;
  }
  return inliers;
}

bool Odometry::Impl::GuessFromLastFrame(const Pose& prediction, float radius_px, Fix* fix) const {
  fix->Clear();
  fix->T_camera_world = prediction;
  return MatchToLastFrame(map(), rig.camera, prediction, last_matches_, radius_px, &fix->matches) >=
             kMinProjected &&
         Refine(&fix->matches, &fix->T_camera_world) >= kMinGuess;
}

bool Odometry::Impl::GuessFromKeyframe(int keyframe, Fix* fix) const {
  fix->Clear();
  FrameMatches* const matches = &fix->matches;
  if (MatchToKeyframe(map(), map().keyframe(keyframe), matches) < 15) return false;
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (std::size_t f = 0; f < matches->landmarks.size(); ++f) {
    const int l = matches->landmarks[f];
    if (l < 0) continue;
    const Eigen::Vector3d& p = map().landmark(l).position;
    points.emplace_back(p.x(), p.y(), p.z());
    pixels.emplace_back(matches->features->keypoints[f].pt.x, matches->features->keypoints[f].pt.y);
  }
  const cv::Matx33d k(rig.camera.fx, 0, rig.camera.cx, 0, rig.camera.fy, rig.camera.cy, 0, 0, 1);
  cv::Mat rvec, tvec;
  std::vector<int> inliers;
  try {
    if (!cv::solvePnPRansac(points, pixels, cv::Mat(k), cv::noArray(), rvec, tvec, false, 200, 5.0F, 0.99,
                            inliers))
      return false;
  } catch (const cv::Exception&) {
    return false;  // degenerate points; OpenCV has no other way to say so
  }
  if (static_cast<int>(inliers.size()) < kMinGuess) return false;
  const Eigen::Vector3d w(rvec.at<double>(0), rvec.at<double>(1), rvec.at<double>(2));
  fix->T_camera_world = Pose(ExpSO3(w), {tvec.at<double>(0), tvec.at<double>(1), tvec.at<double>(2)});
  return fix->T_camera_world.IsFinite() && Refine(matches, &fix->T_camera_world) >= kMinGuess;
}

// Landmarks of the keyframes around a guess that should be seen from there and are not matched yet.
std::vector<int> Odometry::Impl::LocalLandmarks(const Fix& fix, const std::map<int, int>& votes) const {
  std::vector<int> local;
  std::vector<std::pair<int, int>> order;
  order.reserve(votes.size());
  for (const auto& [id, count] : votes) order.emplace_back(-count, -id);
  std::sort(order.begin(), order.end());
  const std::size_t limit = static_cast<std::size_t>(options.local_keyframes);
  for (const auto& [count, id] : order) {
    if (local.size() < limit) local.push_back(-id);
  }
  for (int near : map().BestCovisible(fix.reference, 10, 15)) {
    if (local.size() < limit && std::find(local.begin(), local.end(), near) == local.end())
      local.push_back(near);
  }
  std::vector<int> candidates;
  for (int id : local) {
    for (int l : map().keyframe(id).landmarks) {
      if (l >= 0) candidates.push_back(l);
    }
  }
  std::sort(candidates.begin(), candidates.end());
  candidates.erase(std::unique(candidates.begin(), candidates.end()), candidates.end());
  std::vector<int> rest;
  std::set_difference(candidates.begin(), candidates.end(), fix.visible.begin(), fix.visible.end(),
                      std::back_inserter(rest));
  return rest;
}

// Refines a guess on all that the local map has to show; false if that is nothing.
bool Odometry::Impl::Settle(Fix* fix) const {
  const std::map<int, int> votes = Votes(map(), fix->matches.landmarks);
  fix->reference = MostVoted(votes);
  if (fix->reference < 0 || !fix->T_camera_world.IsFinite()) return false;
  for (int l : fix->matches.landmarks) {
    if (l >= 0) fix->visible.push_back(l);
  }
  std::sort(fix->visible.begin(), fix->visible.end());
  MatchToLandmarks(map(), rig.camera, fix->T_camera_world, LocalLandmarks(*fix, votes),
                   rig.sensor == Sensor::kRgbd ? 1.5F : 1.0F, &fix->matches, &fix->visible);
  fix->inliers = Refine(&fix->matches, &fix->T_camera_world);
  fix->found = fix->matches.landmarks;
  if (const auto moved = AlignFeatures(map(), rig.camera, fix->T_camera_world, fix->matches.landmarks,
                                       *fix->frame.features)) {
    fix->frame.features = moved;
    fix->matches.features = moved.get();
    fix->inliers = Refine(&fix->matches, &fix->T_camera_world);
  }
  return fix->T_camera_world.IsFinite();
}

// Settles a guess and keeps it if it is the best so far; true once there is no doubt left. `offered`: poses
// of the guesses so far; what would show the same is not settled again.
bool Odometry::Impl::Offer(int least_inliers, Fix* guess, std::vector<Pose>* offered, Fix* best) const {
  const double depth = offered->empty() ? 1.0 : std::max(1e-6, map().MedianDepth(reference_));
  const auto same = [&](const Pose& other) {
    const Vector6d d = LogSE3(guess->T_camera_world * other.Inverse());
    return rig.camera.fx * (d.tail<3>().norm() + d.head<3>().norm() / depth) < kSameGuess;
  };
  if (std::any_of(offered->begin(), offered->end(), same)) return false;
  offered->push_back(guess->T_camera_world);
  if (Settle(guess) && guess->inliers >= std::max(least_inliers, best->inliers + 1) &&
      guess->Share() >= kLeastShare)
    *best = *guess;
  return best->inliers > 0 && best->Share() >= kSureShare;
}

// Where the frame is: by the motion so far, else from the keyframes around the last place. False if nowhere.
bool Odometry::Impl::FindPose(Fix* fix) const {
  const int least = state_ == TrackingState::kLost ? 2 * options.min_inliers : options.min_inliers;
  Fix guess = *fix;
  std::vector<Pose> offered;
  const float base = rig.sensor == Sensor::kStereo ? 8.0F : 15.0F;
  for (const Pose& prediction : Predictions(guess.frame.stamp_s)) {
    for (const float radius : {base, 2 * base, 4 * base}) {
      if (GuessFromLastFrame(prediction, radius, &guess) && Offer(least, &guess, &offered, fix)) return true;
    }
  }
  std::vector<int> near{reference_, last_keyframe_};
  for (int covisible : map().BestCovisible(reference_, 3, 15)) near.push_back(covisible);
  const auto settled = [&](int keyframe) {
    return GuessFromKeyframe(keyframe, &guess) && Offer(least, &guess, &offered, fix);
  };
  for (std::size_t i = 0; i < near.size(); ++i) {
    const auto here = near.begin() + static_cast<std::ptrdiff_t>(i);
    if (std::find(near.begin(), here, near[i]) == here && settled(near[i])) return true;
  }
  // What the loop detector does not know yet; a doubtful pose from here is as good as one from there.
  const int oldest = std::max(0, last_keyframe_ - kRecentKeyframes);
  for (int k = last_keyframe_ - 1; k >= oldest && fix->inliers == 0; --k) {
    if (std::find(near.begin(), near.end(), k) == near.end() && settled(k)) return true;
  }
  return fix->inliers > 0;
}

}  // namespace tutti
