#include "frontend/odometry/localizer.h"

#include <algorithm>
#include <map>

namespace tutti {
namespace {

constexpr int kTellingLandmarks = 200;      // landmarks that tell a pose; more of them hardly tell it better
constexpr double kLeastFeatures = 1.0 / 3;  // of those of the options
constexpr int kVeryFew = 3;                 // times the fewest inliers: landmarks that a fast turn may leave
constexpr int kFewWithDepth = 120;          // landmarks below which a sensor with depth makes new ones
constexpr double kWeakShare = 0.2;  // of the landmarks in view: with fewer there is doubt (PoseSearch)

}  // namespace

void Localizer::Begin(const Map& map) {
  keyframes_ = map.KeyframeCount();
  landmarks_ = map.LandmarkCount();
  keyframe_ = -1;
  beyond_ = false;
  Lost();
}

void Localizer::Lost() { features_ = options_.features; }

void Localizer::Found(const PoseFix& fix, const Map& map) {
  if (!Begun()) return;
  std::map<int, int> votes;
  int agree = 0;
  for (const int l : fix.matches.landmarks) {
    if (l < 0 || l >= landmarks_ || !map.landmark(l).alive) continue;
    ++agree;
    for (const Observation& o : map.landmark(l).observations) {
      if (o.keyframe < keyframes_) ++votes[o.keyframe];
    }
  }
  beyond_ = agree < 2 * options_.min_inliers;
  keyframe_ = -1;
  for (const auto& [id, count] : votes) {
    if (!beyond_ && (keyframe_ < 0 || count >= votes.at(keyframe_))) keyframe_ = id;
  }
  const double share = kTellingLandmarks / std::max(1.0, static_cast<double>(fix.inliers));
  const double needed = share * static_cast<double>(fix.frame.features->size());
  const double all = options_.features;
  features_ = static_cast<int>(std::clamp(needed, kLeastFeatures * all, all));
}

bool Localizer::MustExtend(const PoseFix& fix, std::int64_t frames_since_keyframe) const {
  if (fix.by_grey || (has_depth_ && !fix.frame.features->has_depth)) return false;
  if (fix.inliers < kVeryFew * options_.min_inliers) return true;
  const bool few = has_depth_ && fix.inliers < kFewWithDepth;
  return (few || fix.Share() < kWeakShare) && frames_since_keyframe >= options_.keyframe_min_frames;
}

}  // namespace tutti
