#include "frontend/odometry/pose_search.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "frontend/geometry/pose_solver.h"
#include "frontend/map/measured.h"
#include "frontend/map/patch_aligner.h"
#include "frontend/odometry/reach.h"

namespace tutti {
namespace {

constexpr int kMinProjected = 20;            // matches by projection below which the search is widened
constexpr double kAlikeShare = 0.25;         // of what the last frame saw, whose patches agree with a motion
constexpr int kMinInKeyframe = 15;           // matches with a keyframe that may show the same place
constexpr int kMinGuess = 10;                // inliers of a guess
constexpr int kRecentKeyframes = 10;         // that a frame without a pose is compared with
constexpr std::size_t kLocalKeyframes = 40;  // whose landmarks are looked for in a frame
constexpr double kSameGuess = 1.0;           // guesses that differ by less in the image are one [px]
constexpr double kSurePrediction = 0.5;      // a velocity is likely to hold for so long [s]
constexpr double kLeastShare = 0.14;         // of the landmarks in view that must be found again;
constexpr double kSureShare = 0.2;           // with so many nothing else needs to be tried
constexpr double kShareForAJump = 0.5;       // and with so many the motion so far may be wrong
constexpr double kProvisional = 0.8;         // of the inliers that a pose needs, where one camera expects it

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

// Where the camera may be, likeliest first: it went on as before, or stopped, or turned as an IMU says. After
// lost frames the IMU comes first. Before that it comes last: where the motion leads, images are found
// without it, and sharp recordings were worse (1.4 times the ATE on two rendered flights) when it came first.
std::vector<Pose> Predictions(const LastFrame& last, const TrackedFrame& frame, bool lost) {
  std::vector<Pose> predictions;
  const double since = frame.Time() - last.frame.Time();
  const auto by_imu = [&] {
    if (!frame.turn) return;
    predictions.push_back(last.After(std::min(since, kVelocityHolds), *frame.turn));
    if (since > kSurePrediction) predictions.push_back(last.After(0, *frame.turn));
  };
  if (lost) by_imu();
  if (last.velocity) predictions.push_back(last.After(std::min(since, kVelocityHolds)));
  if (last.velocity && since > kSurePrediction) predictions.push_back(last.After(kSurePrediction));
  predictions.push_back(last.T_camera_world);
  if (!lost) by_imu();
  return predictions;
}

}  // namespace

// The guesses for one frame so far.
struct PoseSearch::Contest {
  bool Convinces(const PoseFix& fix) const { return IsBetter(fix, best) && IsWithinReach(fix); }
  bool IsBetter(const PoseFix& fix, const std::optional<PoseFix>& than) const {
    const int enough = std::max(least_inliers, than ? than->inliers + 1 : 1);
    return fix.inliers >= enough && fix.Share() >= kLeastShare;
  }
  bool IsWithinReach(const PoseFix& fix) const {
    return !reach || reach->Has(fix.T_camera_world) || fix.Share() >= kShareForAJump;
  }
  // Soon it is a keyframe, which sees more.
  bool IsProvisional(const PoseFix& fix, int min_inliers) const {
    const double enough = std::max(kProvisional * min_inliers, provisional ? provisional->inliers + 1.0 : 0);
    return fix.inliers >= enough && fix.Share() >= kLeastShare && reach && reach->Has(fix.T_camera_world);
  }

  const Map& map;
  int least_inliers;
  double depth;                        // of what is in view [m]
  std::optional<Reach> reach = {};     // by a motion that was steady
  std::vector<Pose> offered = {};      // what would show the same is not settled again
  std::optional<PoseFix> best = {};    // none: no guess has convinced yet
  std::optional<PoseFix> beyond = {};  // one camera: would convince but for the reach, which knows no metres
  std::optional<PoseFix> provisional = {};  // one camera: would convince but for few inliers, where expected
};

std::optional<PoseFix> PoseSearch::Find(const Map& map, const TrackedFrame& frame, const LastFrame& last,
                                        bool lost) const {
  if (last.reference < 0) return std::nullopt;
  const double depth = std::max(1e-6, map.MedianDepth(last.reference));
  Contest contest{map, lost ? 2 * options_.min_inliers : options_.min_inliers, depth,
                  last.steady ? ReachOf(last, frame.Time(), depth, rig_.sensor) : std::nullopt};
  const float base = rig_.sensor == Sensor::kStereo ? 8.0F : 15.0F;
  const std::vector<Pose> predictions = Predictions(last, frame, lost);
  // Corners near a place may all be those of the next of equal windows, and one camera measures no depths
  // that say so. What is alike just where the motion leads is the right window.
  if (rig_.sensor == Sensor::kMono && (last.velocity || (lost && frame.turn)) &&
      Offer(GuessFromPatches(map, frame, last, predictions.front()), &contest))
    return contest.best;
  for (const Pose& prediction : predictions) {
    for (const float radius : {base, 2 * base, 4 * base}) {
      if (Offer(GuessFromLastFrame(map, frame, last, prediction, radius), &contest)) return contest.best;
    }
  }
  std::vector<int> near{last.reference, last.newest_keyframe};
  for (int covisible : map.BestCovisible(last.reference, 3, 15)) near.push_back(covisible);
  const auto settled = [&](int keyframe) { return Offer(GuessFromKeyframe(map, frame, keyframe), &contest); };
  for (auto here = near.begin(); here != near.end(); ++here) {
    if (std::find(near.begin(), here, *here) == here && settled(*here)) return contest.best;
  }
  // What the loop detector does not know yet; a doubtful pose from here is as good as one from there.
  const int oldest = std::max(0, last.newest_keyframe - kRecentKeyframes);
  for (int k = last.newest_keyframe - 1; k >= oldest && !contest.best; --k) {
    if (map.keyframe(k).replaced_by >= 0) continue;
    if (std::find(near.begin(), near.end(), k) == near.end() && settled(k)) break;
  }
  if (contest.best) return std::move(contest.best);
  return contest.beyond || lost ? std::move(contest.beyond) : std::move(contest.provisional);
}

std::optional<PoseFix> PoseSearch::FindAt(const Map& map, const TrackedFrame& frame, int keyframe) const {
  if (keyframe < 0 || keyframe >= map.KeyframeCount()) return std::nullopt;
  Contest contest{map, 2 * options_.min_inliers, 1.0};
  Offer(GuessFromKeyframe(map, frame, map.PresentKeyframe(keyframe)), &contest);
  return contest.best;
}

int PoseSearch::Refine(const Map& map, FrameMatches* matches, Pose* T_camera_world) const {
  std::vector<PointObservation> observations;
  std::vector<std::size_t> feature;
  for (std::size_t f = 0; f < matches->landmarks.size(); ++f) {
    const int l = matches->landmarks[f];
    if (l < 0) continue;
    observations.push_back(
        Measured(map, *matches->features, {-1, static_cast<int>(f)}, l, options_.pixel_sigma));
    feature.push_back(f);
  }
  if (observations.size() < 6) return 0;
  std::vector<char> inlier;
  const int inliers = RefinePose(rig_.camera, observations, T_camera_world, &inlier);
  for (std::size_t i = 0; i < feature.size(); ++i) {
    if (!inlier[i]) matches->landmarks[feature[i]] = -1;
  }
  return inliers;
}

// The camera went on as before: what the last frame saw is alike where it should be by now.
std::optional<PoseFix> PoseSearch::GuessFromPatches(const Map& map, const TrackedFrame& frame,
                                                    const LastFrame& last, const Pose& prediction) const {
  std::vector<int> seen;
  std::copy_if(last.matches.landmarks.begin(), last.matches.landmarks.end(), std::back_inserter(seen),
               [](int l) { return l >= 0; });
  const std::vector<PatchView> views = FindPatches(map, rig_.camera, prediction, seen, *frame.features);
  std::vector<PointObservation> observations;
  for (const PatchView& view : views) {
    PointObservation o;
    o.point = map.landmark(view.landmark).position;
    o.pixel = view.pixel;
    o.pixel_sigma = options_.pixel_sigma * options_.aligned_sigma * view.scale;
    observations.push_back(o);
  }
  Pose T_camera_world = prediction;
  std::vector<char> inlier;
  const int needed =
      std::max(kMinProjected, static_cast<int>(kAlikeShare * static_cast<double>(seen.size())));
  if (static_cast<int>(views.size()) < needed ||
      RefinePose(rig_.camera, observations, &T_camera_world, &inlier) < needed)
    return std::nullopt;
  return GuessFromLandmarks(map, frame, seen, T_camera_world, 1.0F);
}

// The corners of these landmarks are where a pose shows them.
std::optional<PoseFix> PoseSearch::GuessFromLandmarks(const Map& map, const TrackedFrame& frame,
                                                      const std::vector<int>& landmarks,
                                                      const Pose& T_camera_world, float radius_factor) const {
  PoseFix fix(frame);
  fix.T_camera_world = T_camera_world;
  std::vector<int> visible;
  if (MatchToLandmarks(map, rig_.camera, T_camera_world, landmarks, radius_factor, &fix.matches, &visible) <
          kMinProjected ||
      Refine(map, &fix.matches, &fix.T_camera_world) < kMinGuess)
    return std::nullopt;
  return fix;
}

std::optional<PoseFix> PoseSearch::GuessFromLastFrame(const Map& map, const TrackedFrame& frame,
                                                      const LastFrame& last, const Pose& prediction,
                                                      float radius_px) const {
  PoseFix fix(frame);
  fix.T_camera_world = prediction;
  if (MatchToLastFrame(map, rig_.camera, prediction, last.matches, radius_px, &fix.matches) < kMinProjected ||
      Refine(map, &fix.matches, &fix.T_camera_world) < kMinGuess)
    return std::nullopt;
  return fix;
}

std::optional<PoseFix> PoseSearch::GuessFromKeyframe(const Map& map, const TrackedFrame& frame,
                                                     int keyframe) const {
  PoseFix fix(frame);
  if (MatchToKeyframe(map, map.keyframe(keyframe), &fix.matches) < kMinInKeyframe) return std::nullopt;
  std::vector<Eigen::Vector3d> points;
  std::vector<cv::Point2f> pixels;
  for (std::size_t f = 0; f < fix.matches.landmarks.size(); ++f) {
    if (fix.matches.landmarks[f] < 0) continue;
    points.push_back(map.landmark(fix.matches.landmarks[f]).position);
    pixels.push_back(frame.features->keypoints[f].pt);
  }
  const std::optional<Pose> pose = SolvePnp(rig_.camera, points, pixels, kMinGuess);
  if (!pose) return std::nullopt;
  fix.T_camera_world = *pose;
  if (Refine(map, &fix.matches, &fix.T_camera_world) < kMinGuess) return std::nullopt;
  return fix;
}

// Landmarks of the keyframes around a guess that should be seen from there and are not matched yet.
std::vector<int> PoseSearch::LocalLandmarks(const Map& map, const PoseFix& fix,
                                            const std::map<int, int>& votes) const {
  std::vector<int> local;
  std::vector<std::pair<int, int>> order;
  order.reserve(votes.size());
  for (const auto& [id, count] : votes) order.emplace_back(-count, -id);
  std::sort(order.begin(), order.end());
  for (const auto& [count, id] : order) {
    if (local.size() < kLocalKeyframes) local.push_back(-id);
  }
  for (int near : map.BestCovisible(fix.reference, 10, 15)) {
    if (local.size() < kLocalKeyframes && std::find(local.begin(), local.end(), near) == local.end())
      local.push_back(near);
  }
  const std::vector<int> candidates = map.LandmarksOf(local);
  std::vector<int> rest;
  std::set_difference(candidates.begin(), candidates.end(), fix.visible.begin(), fix.visible.end(),
                      std::back_inserter(rest));
  return rest;
}

// Refines a guess on all that the local map has to show; false if that is nothing.
bool PoseSearch::Settle(const Map& map, PoseFix* fix) const {
  const std::map<int, int> votes = Votes(map, fix->matches.landmarks);
  fix->reference = MostVoted(votes);
  if (fix->reference < 0 || !fix->T_camera_world.IsFinite()) return false;
  for (int l : fix->matches.landmarks) {
    if (l >= 0) fix->visible.push_back(l);
  }
  std::sort(fix->visible.begin(), fix->visible.end());
  MatchToLandmarks(map, rig_.camera, fix->T_camera_world, LocalLandmarks(map, *fix, votes),
                   rig_.sensor == Sensor::kRgbd ? 1.5F : 1.0F, &fix->matches, &fix->visible);
  fix->inliers = Refine(map, &fix->matches, &fix->T_camera_world);
  fix->found = fix->matches.landmarks;
  if (const auto moved = AlignFeatures(map, rig_.camera, fix->T_camera_world, fix->matches.landmarks,
                                       *fix->frame.features)) {
    fix->frame.features = moved;
    fix->matches.features = moved.get();
    fix->inliers = Refine(map, &fix->matches, &fix->T_camera_world);
  }
  return fix->T_camera_world.IsFinite();
}

std::optional<PoseFix> PoseSearch::FindNear(const Map& map, const TrackedFrame& frame, int keyframe,
                                            const Pose& T_camera_world) const {
  Contest contest{map, options_.min_inliers, std::max(1e-6, map.MedianDepth(keyframe))};
  std::vector<int> near = map.BestCovisible(keyframe, 10, 15);
  near.push_back(keyframe);
  const std::vector<int> landmarks = map.LandmarksOf(near);
  for (const float radius : {2.0F, 5.0F}) {
    if (Offer(GuessFromLandmarks(map, frame, landmarks, T_camera_world, radius), &contest)) break;
  }
  return contest.best;
}

bool PoseSearch::SettleAgain(const Map& map, PoseFix* fix) const {
  fix->visible.clear();
  return Settle(map, fix);
}

// Settles a guess and keeps it if it is the best so far; true once there is no doubt left.
bool PoseSearch::Offer(std::optional<PoseFix> guess, Contest* contest) const {
  if (!guess) return false;
  const auto same = [&](const Pose& other) {
    const Vector6d d = LogSE3(guess->T_camera_world * other.Inverse());
    return rig_.camera.fx * (d.tail<3>().norm() + d.head<3>().norm() / contest->depth) < kSameGuess;
  };
  if (std::any_of(contest->offered.begin(), contest->offered.end(), same)) return false;
  contest->offered.push_back(guess->T_camera_world);
  if (!Settle(contest->map, &*guess)) return false;
  if (contest->Convinces(*guess)) {
    contest->best = std::move(guess);
  } else if (rig_.sensor == Sensor::kMono && contest->IsBetter(*guess, contest->beyond)) {
    contest->beyond = std::move(guess);
  } else if (rig_.sensor == Sensor::kMono && contest->IsProvisional(*guess, options_.min_inliers)) {
    contest->provisional = std::move(guess);
  }
  return contest->best && contest->best->Share() >= kSureShare;
}

}  // namespace tutti
