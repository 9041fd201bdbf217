// When a tracked frame becomes a keyframe: by what the map still has to show.
#include <algorithm>
#include <array>

#include "frontend/odometry/odometry_impl.h"

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

}  // namespace

// Landmarks of the reference that are established: what one keyframe alone has seen (most of what depth
// gives) may never be seen again, and would call for a keyframe all the time.
int Odometry::Impl::EstablishedLandmarks(int keyframe) const {
  const std::size_t established = rig.sensor == Sensor::kMono && map().KeyframeCount() > 2 ? 3 : 2;
  const std::vector<int>& landmarks = map().keyframe(keyframe).landmarks;
  return static_cast<int>(std::count_if(landmarks.begin(), landmarks.end(), [&](int l) {
    return l >= 0 && map().landmark(l).observations.size() >= established;
  }));
}

// Depth makes landmarks of what is new in the image at once: is it time for that?
Odometry::Impl::DepthNeed Odometry::Impl::NeedForDepth(const FrameMatches& matches) const {
  DepthNeed need;
  if (rig.sensor == Sensor::kMono) return need;
  const double far = rig.sensor == Sensor::kStereo ? options.max_depth_baselines * rig.baseline_m : 1e9;
  int near_tracked = 0, near_free = 0;
  std::vector<char> near(matches.landmarks.size(), 0);
  for (std::size_t f = 0; f < matches.landmarks.size(); ++f) {
    const float inverse = matches.features->inverse_depth[f];
    if (inverse <= 0 || 1.0 / inverse > far) continue;
    near[f] = 1;
    ++(matches.landmarks[f] >= 0 ? near_tracked : near_free);
  }
  need.few_near = near_tracked < kFewNear && near_free > kManyNearFree;
  need.uncovered = UncoveredShare(matches, rig.camera, near) > options.keyframe_uncovered_ratio;
  return need;
}

bool Odometry::Impl::NeedKeyframe(const TrackedFrame& frame, const FrameMatches& matches, int inliers) const {
  const tutti::Keyframe& last = map().keyframe(last_keyframe_);
  const int established = EstablishedLandmarks(reference_);
  const bool weak = inliers < options.keyframe_inlier_ratio * established;
  const bool very_weak = inliers < 0.4 * established || inliers < 3 * options.min_inliers;
  const bool early = frames_since_keyframe_ < options.keyframe_min_frames;
  if (early && !(very_weak && frames_since_keyframe_ >= 1)) return false;
  const DepthNeed need = NeedForDepth(matches);
  if (very_weak || need.few_near) return true;
  // In a place seen before, after a loop, the map has the landmarks that come next already.
  const bool known = last_keyframe_ - reference_ > kKeyframesApart &&
                     frame.stamp_s - map().keyframe(reference_).stamp_s > kSecondsApart;
  if (known) return false;
  const double baseline =
      (last.T_world_camera.translation - last_T_camera_world_.Inverse().translation).norm();
  const bool moved = baseline > 0.02 * std::max(1e-6, map().MedianDepth(last_keyframe_));
  return weak || need.uncovered || (frame.stamp_s - last.stamp_s > options.keyframe_max_interval_s && moved);
}

}  // namespace tutti
