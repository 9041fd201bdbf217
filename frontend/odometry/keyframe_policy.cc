#include "frontend/odometry/keyframe_policy.h"

#include <algorithm>
#include <array>

namespace tutti {
namespace {

// A reference keyframe from an earlier visit: so many keyframes before the newest, and so long ago [s].
constexpr int kKeyframesApart = 10;
constexpr double kSecondsApart = 10;
// The image in cells; one with so many features and no landmark is uncovered.
constexpr int kCellColumns = 8, kCellRows = 6;
constexpr int kMinCellFeatures = 3;
constexpr int kFewNear = 100;      // near landmarks below which a keyframe is made
constexpr int kManyNearFree = 70;  // if it would bring more than these
// One camera from frame to frame. At 10 Hz a car moves its view by 0.02 to 0.06 (0.064 in the fastest 2 %);
// kitti_00_head keeps less than 0.6 of the landmarks in 2 % of the frames then, and in half at 3.3 Hz.
constexpr double kFarStep = 0.07;       // that the view moves, of its width: each frame is a keyframe
constexpr double kLeastKept = 0.5;      // of the landmarks that the frame before saw
constexpr double kLeastNext = 1.25;     // landmarks left in the next frame, in units of those a pose needs
constexpr double kLongestStep_s = 1.0;  // between frames that are compared

// Share of the cells with something to see where no landmark was found. `counts`: by feature, what could
// become a landmark.
double UncoveredShare(const FrameMatches& matches, const PinholeCamera& camera,
                      const std::vector<char>& counts) {
  std::array<int, kCellColumns * kCellRows> landmarks{}, features{};
  for (std::size_t f = 0; f < matches.landmarks.size(); ++f) {
    const cv::Point2f pt = matches.features->keypoints[f].pt;
    const int column = std::clamp(static_cast<int>(pt.x * kCellColumns / static_cast<float>(camera.width)), 0,
                                  kCellColumns - 1);
    const int row =
        std::clamp(static_cast<int>(pt.y * kCellRows / static_cast<float>(camera.height)), 0, kCellRows - 1);
    const auto cell = static_cast<std::size_t>(row) * kCellColumns + static_cast<std::size_t>(column);
    if (matches.landmarks[f] >= 0) ++landmarks[cell];
    if (counts[f]) ++features[cell];
  }
  int seen = 0, uncovered = 0;
  for (std::size_t cell = 0; cell < features.size(); ++cell) {
    if (landmarks[cell] == 0 && features[cell] < kMinCellFeatures) continue;
    ++seen;
    if (landmarks[cell] == 0) ++uncovered;
  }
  return seen == 0 ? 0 : static_cast<double>(uncovered) / seen;
}

// Depth makes landmarks of what is new in the image at once: is it time for that?
struct DepthNeed {
  bool few_near = false, uncovered = false;  // as KeyframeNeed says
};

DepthNeed NeedForDepth(const FrameMatches& matches, const CameraRig& rig, const OdometryOptions& options) {
  if (rig.sensor == Sensor::kMono) return {};
  const double far = rig.sensor == Sensor::kStereo ? options.max_depth_baselines * rig.baseline_m : 1e9;
  int near_tracked = 0, near_free = 0;
  std::vector<char> near(matches.landmarks.size(), 0);
  for (std::size_t f = 0; f < matches.landmarks.size(); ++f) {
    const float inverse = matches.features->inverse_depth[f];
    if (inverse <= 0 || 1.0 / inverse > far) continue;
    near[f] = 1;
    ++(matches.landmarks[f] >= 0 ? near_tracked : near_free);
  }
  return {near_tracked < kFewNear && near_free > kManyNearFree,
          UncoveredShare(matches, rig.camera, near) > options.keyframe_uncovered_ratio};
}

// One camera makes landmarks of what two keyframes see, and trusts them after a third: where little stays in
// view from frame to frame, that has to be every frame. Whether it is tells the step that was just made, for
// a map that gets thin lowers what a share of its landmarks is.
KeyframeNeed NeedForNext(const Map& map, const PoseFix& fix, const LastFrame& before, const CameraRig& rig,
                         const OdometryOptions& options) {
  if (rig.sensor != Sensor::kMono || fix.frame.stamp_s - before.frame.stamp_s > kLongestStep_s)
    return KeyframeNeed::kNone;
  const std::vector<int>& seen = before.matches.landmarks;
  const auto known = std::count_if(seen.begin(), seen.end(), [](int l) { return l >= 0; });
  const double kept = fix.inliers / std::max(1.0, static_cast<double>(known));
  if (std::min(1.0, kept) * fix.inliers < kLeastNext * options.min_inliers) return KeyframeNeed::kThin;
  const Pose step = fix.T_camera_world * before.T_camera_world.Inverse();
  const double depth = std::max(1e-6, map.MedianDepth(before.newest_keyframe));
  const double moved = (step.Angle() + step.translation.norm() / depth) * rig.camera.fx / rig.camera.width;
  return kept < kLeastKept || moved > kFarStep ? KeyframeNeed::kVeryWeak : KeyframeNeed::kNone;
}

}  // namespace

// What one keyframe alone has seen (most of what depth gives) may never be seen again, and would call for a
// keyframe all the time.
int KeyframePolicy::Established(const Map& map, int keyframe) const {
  const std::size_t views = rig_.sensor == Sensor::kMono && map.KeyframeCount() > 2 ? 3 : 2;
  const std::vector<int>& landmarks = map.keyframe(keyframe).landmarks;
  return static_cast<int>(std::count_if(landmarks.begin(), landmarks.end(), [&](int l) {
    return l >= 0 && map.landmark(l).observations.size() >= views;
  }));
}

KeyframeNeed KeyframePolicy::Need(const Map& map, const PoseFix& fix, const LastFrame& before) const {
  if (rig_.sensor != Sensor::kMono && !fix.frame.features->has_depth) return KeyframeNeed::kNone;
  if (fix.by_grey)  // there are no landmarks
    return fix.sharp && rig_.sensor != Sensor::kMono ? KeyframeNeed::kVeryWeak : KeyframeNeed::kNone;
  const KeyframeNeed next = NeedForNext(map, fix, before, rig_, options_);
  if (next != KeyframeNeed::kNone) return next;
  const int established = Established(map, fix.reference);
  const bool very_weak = fix.inliers < 0.4 * established || fix.inliers < 3 * options_.min_inliers;
  if (very_weak) return KeyframeNeed::kVeryWeak;
  if (before.frames_since_keyframe + 1 < options_.keyframe_min_frames) return KeyframeNeed::kNone;
  const DepthNeed need = NeedForDepth(fix.matches, rig_, options_);
  if (need.few_near) return KeyframeNeed::kFewNear;
  // In a place seen before, after a loop, the map has the landmarks that come next already.
  const Keyframe &reference = map.keyframe(fix.reference), &newest = map.keyframe(before.newest_keyframe);
  const double stamp_s = fix.frame.stamp_s;
  if (newest.id - reference.id > kKeyframesApart && stamp_s - reference.stamp_s > kSecondsApart)
    return KeyframeNeed::kNone;
  if (fix.inliers < options_.keyframe_inlier_ratio * established) return KeyframeNeed::kWeak;
  if (need.uncovered) return KeyframeNeed::kUncovered;
  if (!(stamp_s - newest.stamp_s > options_.keyframe_max_interval_s)) return KeyframeNeed::kNone;
  const Pose T_world_before = before.T_camera_world.Inverse();
  const double baseline = (newest.T_world_camera.translation - T_world_before.translation).norm();
  const bool moved = baseline > 0.02 * std::max(1e-6, map.MedianDepth(newest.id));
  return moved ? KeyframeNeed::kInterval : KeyframeNeed::kNone;
}

}  // namespace tutti
