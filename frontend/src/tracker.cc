// Tracking: from the last frame, then against the local map; loss and recovery.
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "measured.h"
#include "odometry_impl.h"
#include "patch_aligner.h"
#include "stopwatch.h"
#include "tutti/frontend/pose_solver.h"

namespace tutti {
namespace {

constexpr int kMinDepthFeatures = 50;  // features with depth that a metric map starts from
constexpr int kMinProjected = 20;      // matches by projection below which the search is widened

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

Odometry::Impl::Impl(const OdometryOptions& o, const CameraRig& r)
    : options(o),
      rig(r),
      map(PyramidScales(o), r.camera, o.aligned_sigma),
      mapper_(o, r),
      initializer_(o, r) {}

TrackResult Odometry::Impl::Track(const InputFrame& input) {
  TrackedFrame frame{input.index, input.stamp_s, input.features};
  if (!frame.features) {
    const ScopedStopwatch watch(&stages["extract"]);
    frame.features = std::make_shared<const Features>(ExtractFeatures(input, rig, options));
  }
  frame.features = mapper_.lens().Correct(frame.features);
  if (rig.sensor == Sensor::kStereo) {
    row_errors.push_back(frame.features->row_error_px);
    stereo_matches.push_back(frame.features->stereo_matches);
  }
  if (state_ == TrackingState::kInitializing) return Initialize(frame);
  return TrackMap(frame);
}

TrackResult Odometry::Impl::Initialize(const TrackedFrame& frame) {
  const ScopedStopwatch watch(&stages["initialize"]);
  TrackResult result;
  result.state = TrackingState::kInitializing;
  const Pose start = records.empty() ? Pose() : last_T_camera_world_.Inverse();
  if (rig.sensor == Sensor::kMono) {
    const double depth = last_keyframe_ >= 0 ? std::max(1e-6, map.MedianDepth(last_keyframe_)) : 1.0;
    const std::vector<TrackedFrame> before = initializer_.pending();
    if (!initializer_.Offer(frame, piece_, start, depth > 1e-6 ? depth : 1.0, &map, &result.reason))
      return result;
    const int second = static_cast<int>(map.keyframes().size()) - 1;
    last_keyframe_ = reference_ = second;
    initializer_.Reset();
    PoseBackwards(before, second - 1);
  } else {
    const auto with_depth = std::count_if(frame.features->inverse_depth.begin(),
                                          frame.features->inverse_depth.end(), [](float d) { return d > 0; });
    if (with_depth < kMinDepthFeatures) {
      result.reason = "initialising: only " + std::to_string(with_depth) + " features with depth";
      return result;
    }
    tutti::Keyframe k;
    k.frame_index = frame.index;
    k.stamp_s = frame.stamp_s;
    k.piece = piece_;
    k.features = frame.features;
    k.T_world_camera = start;
    last_keyframe_ = reference_ = map.AddKeyframe(k);
    mapper_.AddDepthLandmarks(reference_, 100, &map);
  }
  const tutti::Keyframe& k = map.keyframe(last_keyframe_);
  reference_landmarks_ =
      static_cast<int>(std::count_if(k.landmarks.begin(), k.landmarks.end(), [](int l) { return l >= 0; }));
  last_T_camera_world_ = k.T_world_camera.Inverse();
  last_stamp_ = frame.stamp_s;
  last_features_ = frame.features;
  last_matches_ = {last_features_.get(), k.landmarks};
  has_velocity_ = false;
  frames_since_keyframe_ = 0;
  Record(frame, last_T_camera_world_, last_keyframe_);
  state_ = TrackingState::kTracking;
  result.state = state_;
  result.T_world_camera = k.T_world_camera;
  result.keyframe = last_keyframe_;
  result.inliers = reference_landmarks_;
  return result;
}

// Frames from before the initialisation, from the first keyframe outwards on both sides; each starts from its
// neighbour.
void Odometry::Impl::PoseBackwards(const std::vector<TrackedFrame>& frames, int first_keyframe) {
  const tutti::Keyframe &k0 = map.keyframe(first_keyframe), &k1 = map.keyframe(first_keyframe + 1);
  const double span = std::max(1e-6, k1.stamp_s - k0.stamp_s);
  const Vector6d motion = LogSE3(k1.T_world_camera.Inverse() * k0.T_world_camera);
  std::vector<FrameRecord> posed;
  Pose neighbour = k0.T_world_camera.Inverse();
  bool backwards_alive = true;
  for (auto frame = frames.rbegin(); frame != frames.rend(); ++frame) {
    Pose T = neighbour;
    if (frame->index == k0.frame_index) {
      T = k0.T_world_camera.Inverse();
    } else {
      const bool between = frame->stamp_s > k0.stamp_s;
      if (!between && !backwards_alive) continue;
      if (between) T = ExpSE3(motion * ((frame->stamp_s - k0.stamp_s) / span)) * k0.T_world_camera.Inverse();
      FrameMatches seen{k0.features.get(), k0.landmarks};
      FrameMatches matches{frame->features.get(), std::vector<int>(frame->features->size(), -1)};
      MatchToLastFrame(map, rig.camera, T, seen, 30.0F, &matches);
      if (Refine(&matches, &T) < options.min_inliers) {
        if (!between) backwards_alive = false;
        continue;
      }
    }
    if (frame->stamp_s <= k0.stamp_s) neighbour = T;
    FrameRecord record;
    record.index = frame->index;
    record.stamp_s = frame->stamp_s;
    record.reference = first_keyframe;
    record.T_reference_frame = k0.T_world_camera.Inverse() * T.Inverse();
    posed.push_back(record);
  }
  for (auto r = posed.rbegin(); r != posed.rend(); ++r) {
    if (records.empty() || r->stamp_s > records.back().stamp_s) records.push_back(*r);
  }
}

Pose Odometry::Impl::Predict(double stamp_s) const {
  if (!has_velocity_) return last_T_camera_world_;
  // Beyond half a second a constant velocity is no better than standing still.
  const double dt = std::min(stamp_s - last_stamp_, 0.5);
  return ExpSE3(velocity_ * dt) * last_T_camera_world_;
}

int Odometry::Impl::Refine(FrameMatches* matches, Pose* T_camera_world) const {
  std::vector<PointObservation> observations;
  std::vector<std::size_t> feature;
  for (std::size_t f = 0; f < matches->landmarks.size(); ++f) {
    const int l = matches->landmarks[f];
    if (l < 0) continue;
    observations.push_back(
        Measured(map, *matches->features, {-1, static_cast<int>(f)}, l, options.pixel_sigma));
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

bool Odometry::Impl::TrackFromLastFrame(FrameMatches* matches, Pose* T_camera_world, const Pose& prediction) {
  const float base = rig.sensor == Sensor::kStereo ? 8.0F : 15.0F;
  for (const float radius : {base, 2 * base, 4 * base}) {
    std::fill(matches->landmarks.begin(), matches->landmarks.end(), -1);
    *T_camera_world = prediction;
    if (MatchToLastFrame(map, rig.camera, prediction, last_matches_, radius, matches) < kMinProjected)
      continue;
    if (Refine(matches, T_camera_world) >= 10) return true;
  }
  return false;
}

bool Odometry::Impl::TrackFromKeyframe(int keyframe, FrameMatches* matches, Pose* T_camera_world) {
  std::fill(matches->landmarks.begin(), matches->landmarks.end(), -1);
  if (MatchToKeyframe(map, map.keyframe(keyframe), matches) < 15) return false;
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (std::size_t f = 0; f < matches->landmarks.size(); ++f) {
    const int l = matches->landmarks[f];
    if (l < 0) continue;
    const Eigen::Vector3d& p = map.landmark(l).position;
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
  if (inliers.size() < 10) return false;
  const Eigen::Vector3d w(rvec.at<double>(0), rvec.at<double>(1), rvec.at<double>(2));
  *T_camera_world = Pose(ExpSO3(w), {tvec.at<double>(0), tvec.at<double>(1), tvec.at<double>(2)});
  if (!T_camera_world->IsFinite()) return false;
  return Refine(matches, T_camera_world) >= 10;
}

int Odometry::Impl::TrackLocalMap(FrameMatches* matches, Pose* T_camera_world) {
  std::map<int, int> votes = Votes(map, matches->landmarks);
  const int best = MostVoted(votes);
  if (best < 0) return 0;
  reference_ = best;
  std::vector<int> local;
  std::vector<std::pair<int, int>> order;
  for (const auto& [id, count] : votes) order.emplace_back(-count, -id);
  std::sort(order.begin(), order.end());
  const std::size_t limit = static_cast<std::size_t>(options.local_keyframes);
  for (const auto& [count, id] : order) {
    if (local.size() < limit) local.push_back(-id);
  }
  for (int near : map.BestCovisible(best, 10, 15)) {
    if (local.size() < limit && std::find(local.begin(), local.end(), near) == local.end())
      local.push_back(near);
  }
  std::vector<int> candidates;
  for (int id : local) {
    for (int l : map.keyframe(id).landmarks) {
      if (l >= 0) candidates.push_back(l);
    }
  }
  std::sort(candidates.begin(), candidates.end());
  candidates.erase(std::unique(candidates.begin(), candidates.end()), candidates.end());
  std::vector<int> have;
  for (int l : matches->landmarks) {
    if (l >= 0) have.push_back(l);
  }
  std::sort(have.begin(), have.end());
  std::vector<int> rest, visible = have;
  std::set_difference(candidates.begin(), candidates.end(), have.begin(), have.end(),
                      std::back_inserter(rest));
  MatchToLandmarks(map, rig.camera, *T_camera_world, rest, rig.sensor == Sensor::kRgbd ? 1.5F : 1.0F, matches,
                   &visible);
  const int inliers = Refine(matches, T_camera_world);
  for (int l : visible) ++map.landmark(l).visible;
  for (int l : matches->landmarks) {
    if (l >= 0) ++map.landmark(l).found;
  }
  return inliers;
}

TrackResult Odometry::Impl::TrackMap(TrackedFrame frame) {
  TrackResult result;
  FrameMatches matches{frame.features.get(), std::vector<int>(frame.features->size(), -1)};
  Pose T = last_T_camera_world_;
  bool tracked = false;
  int inliers = 0;
  {
    const ScopedStopwatch watch(&stages["track"]);
    if (state_ == TrackingState::kTracking) {
      tracked = TrackFromLastFrame(&matches, &T, Predict(frame.stamp_s));
      if (!tracked && has_velocity_) tracked = TrackFromLastFrame(&matches, &T, last_T_camera_world_);
    }
    if (!tracked) {
      std::vector<int> tries{reference_, last_keyframe_};
      const std::vector<int> more = map.BestCovisible(reference_, 3, 15);
      tries.insert(tries.end(), more.begin(), more.end());
      for (std::size_t i = 0; i < tries.size() && !tracked; ++i) {
        if (std::find(tries.begin(), tries.begin() + static_cast<std::ptrdiff_t>(i), tries[i]) !=
            tries.begin() + static_cast<std::ptrdiff_t>(i))
          continue;
        tracked = TrackFromKeyframe(tries[i], &matches, &T);
      }
    }
    if (tracked) {
      inliers = TrackLocalMap(&matches, &T);
      if (const auto moved = AlignFeatures(map, rig.camera, T, matches.landmarks, *matches.features)) {
        frame.features = moved;
        matches.features = moved.get();
        inliers = Refine(&matches, &T);
      }
      tracked = inliers >= (state_ == TrackingState::kLost ? 2 * options.min_inliers : options.min_inliers);
    }
  }
  if (!tracked || !T.IsFinite()) {
    result.inliers = inliers;
    result.reason = frame.features->size() < static_cast<std::size_t>(options.min_inliers)
                        ? "lost: only " + std::to_string(frame.features->size()) + " features in the image"
                        : "lost: only " + std::to_string(inliers) + " landmarks agree with a pose";
    state_ = TrackingState::kLost;
    result.state = state_;
    if (frame.stamp_s - last_stamp_ > options.relocalize_s) Lose(frame);
    return result;
  }
  const double dt = frame.stamp_s - last_stamp_;
  has_velocity_ = state_ == TrackingState::kTracking && dt > 0 && dt < 1.0;
  if (has_velocity_) velocity_ = LogSE3(T * last_T_camera_world_.Inverse()) / dt;
  state_ = TrackingState::kTracking;
  ++frames_since_keyframe_;
  result.state = state_;
  result.inliers = inliers;
  if (NeedKeyframe(frame, matches, inliers)) {
    result.keyframe = InsertKeyframe(frame, matches, T);
    const tutti::Keyframe& k = map.keyframe(result.keyframe);
    T = k.T_world_camera.Inverse();
    matches.landmarks = k.landmarks;
  }
  last_T_camera_world_ = T;
  last_stamp_ = frame.stamp_s;
  last_features_ = frame.features;
  last_matches_ = {last_features_.get(), std::move(matches.landmarks)};
  Record(frame, T, reference_);
  result.T_world_camera = T.Inverse();
  return result;
}

void Odometry::Impl::Lose(const TrackedFrame&) {
  // Nothing found for too long: a new piece of map starts; a loop closure may join the two later.
  ++piece_;
  state_ = TrackingState::kInitializing;
  initializer_.Reset();
  has_velocity_ = false;
}

bool Odometry::Impl::NeedKeyframe(const TrackedFrame& frame, const FrameMatches& matches, int inliers) const {
  const tutti::Keyframe& last = map.keyframe(last_keyframe_);
  const bool early = frames_since_keyframe_ < options.keyframe_min_frames;
  // Landmarks of the reference that are established: what one keyframe alone has seen (most of what depth
  // gives) may never be seen again, and would call for a keyframe all the time.
  const tutti::Keyframe& reference = map.keyframe(reference_);
  const std::size_t established = rig.sensor == Sensor::kMono && map.keyframes().size() > 2 ? 3 : 2;
  int reference_count = 0;
  for (int l : reference.landmarks) {
    if (l >= 0 && map.landmark(l).observations.size() >= established) ++reference_count;
  }
  const bool weak = inliers < options.keyframe_inlier_ratio * reference_count;
  const bool very_weak = inliers < 0.4 * reference_count || inliers < 3 * options.min_inliers;
  bool few_near = false;
  if (rig.sensor != Sensor::kMono) {
    const double far = rig.sensor == Sensor::kStereo ? options.max_depth_baselines * rig.baseline_m : 1e9;
    int near_tracked = 0, near_free = 0;
    for (std::size_t f = 0; f < matches.landmarks.size(); ++f) {
      const float inverse = matches.features->inverse_depth[f];
      if (inverse <= 0 || 1.0 / inverse > far) continue;
      ++(matches.landmarks[f] >= 0 ? near_tracked : near_free);
    }
    few_near = near_tracked < 100 && near_free > 70;
  }
  const double baseline =
      (map.keyframe(last_keyframe_).T_world_camera.translation - last_T_camera_world_.Inverse().translation)
          .norm();
  const bool moved = baseline > 0.02 * std::max(1e-6, map.MedianDepth(last_keyframe_));
  const bool due = frame.stamp_s - last.stamp_s > options.keyframe_max_interval_s && moved;
  if (early && !(very_weak && frames_since_keyframe_ >= 1)) return false;
  return weak || very_weak || due || few_near;
}

int Odometry::Impl::InsertKeyframe(const TrackedFrame& frame, const FrameMatches& matches,
                                   const Pose& T_camera_world) {
  tutti::Keyframe k;
  k.frame_index = frame.index;
  k.stamp_s = frame.stamp_s;
  k.piece = map.keyframe(reference_).piece;
  k.features = frame.features;
  k.T_world_camera = T_camera_world.Inverse();
  const int id = map.AddKeyframe(k);
  for (std::size_t f = 0; f < matches.landmarks.size(); ++f) {
    if (matches.landmarks[f] >= 0 && map.landmark(matches.landmarks[f]).alive)
      map.AddObservation(matches.landmarks[f], id, static_cast<int>(f));
  }
  mapper_.Process(id, &map, &stages);
  last_keyframe_ = reference_ = id;
  frames_since_keyframe_ = 0;
  return id;
}

void Odometry::Impl::Record(const TrackedFrame& frame, const Pose& T_camera_world, int reference) {
  FrameRecord record;
  record.index = frame.index;
  record.stamp_s = frame.stamp_s;
  record.reference = reference;
  record.T_reference_frame = map.keyframe(reference).T_world_camera.Inverse() * T_camera_world.Inverse();
  records.push_back(record);
}

void Odometry::Impl::MoveCurrent(const Pose& old_reference, const Similarity& S) {
  const Pose T_world_camera = last_T_camera_world_.Inverse();
  Pose relative = old_reference.Inverse() * T_world_camera;
  relative.translation *= S.scale;
  last_T_camera_world_ = (Pose(S.rotation, S.translation) * relative).Inverse();
  velocity_.head<3>() *= S.scale;
}

}  // namespace tutti
