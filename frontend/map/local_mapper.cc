#include "frontend/map/local_mapper.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "core/stopwatch.h"
#include "frontend/geometry/pose_solver.h"
#include "frontend/geometry/two_view.h"
#include "frontend/map/fuse.h"
#include "frontend/map/matcher.h"
#include "frontend/map/measured.h"
#include "frontend/map/patch_aligner.h"

namespace tutti {
namespace {
constexpr int kImages = 12;            // newest keyframes that keep their images
constexpr double kMaxCosine = 0.9996;  // 1.6 deg of parallax at least, for a depth from two views
// Strict: so many standard deviations of parallax. Most landmarks are made as soon as their parallax is large
// enough, which is when noise makes it too large: too near, so that one camera's scale shrinks.
constexpr double kMinParallaxSigmas = 8;
constexpr double kFirstDepth = 10;  // in baselines, where poses are known and landmarks are not
constexpr int kEnough = 3;          // times the fewest inliers: a keyframe with so many landmarks is strict
}  // namespace

int LocalMapper::AddDepthLandmarks(int id, int at_least, Map* map) {
  const Keyframe& k = map->keyframe(id);
  const FrameFeatures& features = *k.features;
  std::vector<std::pair<float, int>> order;  // depth, feature
  for (std::size_t i = 0; i < features.size(); ++i) {
    if (features.inverse_depth[i] > 0)
      order.emplace_back(1.0F / features.inverse_depth[i], static_cast<int>(i));
  }
  std::sort(order.begin(), order.end());
  const double far = rig_.sensor == Sensor::kStereo ? options_.max_depth_baselines * rig_.baseline_m : 1e9;
  int count = 0, made = 0;
  for (const auto& [depth, feature] : order) {
    if (depth > far && count >= at_least) break;
    // A depth that is uncertain by half its value is none.
    const std::size_t f = static_cast<std::size_t>(feature);
    if (features.inverse_depth_sigma[f] > 0.3F * features.inverse_depth[f]) continue;
    ++count;
    if (k.landmarks[f] >= 0) continue;
    const cv::KeyPoint& p = features.keypoints[f];
    const Eigen::Vector3d point = rig_.camera.Unproject({p.pt.x, p.pt.y}) * double(depth);
    const int landmark = map->AddLandmark(k.T_world_camera * point, id, feature);
    map->UpdateLandmark(landmark);
    recent_.emplace_back(landmark, id);
    ++made;
  }
  return made;
}

void LocalMapper::CullRecent(int id, Map* map) {
  // Two views with little parallax give depths that are too large on average, and scale drifts with them:
  // mono landmarks must prove themselves in a third keyframe.
  const std::size_t too_few = rig_.sensor == Sensor::kMono ? 2 : 1;
  std::vector<std::pair<int, int>> keep;
  for (const auto& [landmark_id, born] : recent_) {
    const Landmark& l = map->landmark(landmark_id);
    if (!l.alive) continue;
    if (4 * l.found < l.visible || (id - born >= 2 && l.observations.size() <= too_few)) {
      map->RemoveLandmark(landmark_id);
    } else if (id - born < 3) {
      keep.emplace_back(landmark_id, born);
    }
  }
  recent_ = std::move(keep);
}

// Where two features meet that are of one point, in the world. `strict`: only with their patches aligned, and
// a parallax far above the noise.
std::optional<Eigen::Vector3d> LocalMapper::PointOf(const Keyframe& a, int fa, const Keyframe& b, int fb,
                                                    const Map& map, bool strict) const {
  const Pose T_b_a = b.T_world_camera.Inverse() * a.T_world_camera;
  const cv::KeyPoint &ka = a.features->keypoints[static_cast<std::size_t>(fa)],
                     &kb = b.features->keypoints[static_cast<std::size_t>(fb)];
  const double scale_a = map.scales()[static_cast<std::size_t>(ka.octave)],
               scale_b = map.scales()[static_cast<std::size_t>(kb.octave)];
  const Eigen::Vector3d ra = rig_.camera.Unproject({ka.pt.x, ka.pt.y});
  Eigen::Vector3d rb = rig_.camera.Unproject({kb.pt.x, kb.pt.y});
  const auto cosine = [&] { return ra.normalized().dot((T_b_a.rotation.conjugate() * rb).normalized()); };
  if (!strict && cosine() > kMaxCosine) return std::nullopt;
  if (strict) {
    const Eigen::Vector3d about = tutti::Triangulate(ra, rb, T_b_a);
    if (!about.allFinite()) return std::nullopt;
    const auto pixel = FindPoint(rig_.camera, *a.features, fa, *b.features, fb, T_b_a, about);
    if (!pixel) return std::nullopt;
    rb = rig_.camera.Unproject(*pixel);
    const double sigma_px = options_.pixel_sigma * std::hypot(scale_a, scale_b);
    if (rig_.camera.fx * std::acos(std::min(1.0, cosine())) < kMinParallaxSigmas * sigma_px)
      return std::nullopt;
  }
  if (cosine() < 0) return std::nullopt;
  const Eigen::Vector3d in_a = tutti::Triangulate(ra, rb, T_b_a);
  if (!in_a.allFinite()) return std::nullopt;
  const Eigen::Vector3d point = a.T_world_camera * in_a;
  for (const auto& [frame, feature, scale] : {std::tuple{&a, fa, scale_a}, std::tuple{&b, fb, scale_b}}) {
    const PointObservation o = Measured(*frame->features, feature, point, options_.pixel_sigma * scale);
    Eigen::Vector3d r;
    if (!ReprojectionResidual(rig_.camera, frame->T_world_camera.Inverse(), o, &r, nullptr) ||
        r.squaredNorm() > ChiSquareBound(o))
      return std::nullopt;
  }
  // The corner's scale in both images must agree with its distances.
  const double ratio =
      (point - b.T_world_camera.translation).norm() / (point - a.T_world_camera.translation).norm();
  const double octaves = scale_a / scale_b;
  const double factor = 1.5 * options_.scale_factor;
  if (ratio * factor < octaves || ratio > octaves * factor) return std::nullopt;
  return point;
}

// Keyframes that new landmarks are made with.
std::vector<int> LocalMapper::Neighbours(int id, int count, const Map& map) const {
  if (!keeps_poses_) return map.BestCovisible(id, count, 15);
  std::vector<int> before;
  for (int k = id - 1; k >= 0 && static_cast<int>(before.size()) < count; --k) {
    if (map.keyframe(k).piece == map.keyframe(id).piece && map.keyframe(k).replaced_by < 0)
      before.push_back(k);
  }
  return before;
}

int LocalMapper::Triangulate(int id, Map* map) {
  const bool mono = rig_.sensor == Sensor::kMono;
  const int neighbours = mono ? 8 : 4;  // depths are measured: most landmarks are there already
  const std::vector<int>& seen = std::as_const(*map).keyframe(id).landmarks;
  auto known = std::count_if(seen.begin(), seen.end(), [](int l) { return l >= 0; });
  int made = 0;
  for (int other : Neighbours(id, neighbours, *map)) {
    const double baseline =
        (map->keyframe(id).T_world_camera.translation - map->keyframe(other).T_world_camera.translation)
            .norm();
    double median_depth = map->MedianDepth(other);
    if (median_depth <= 0 && keeps_poses_) median_depth = kFirstDepth * baseline;
    if (median_depth <= 0) continue;
    if (mono ? baseline < 0.01 * median_depth : baseline < rig_.baseline_m) continue;
    const auto pairs =
        MatchEpipolar(*map, rig_.camera, map->keyframe(id), map->keyframe(other), median_depth);
    for (const auto& [fa, fb] : pairs) {
      const bool strict = mono && known >= kEnough * options_.min_inliers;
      const Map& now = *map;
      const auto point = PointOf(now.keyframe(id), fa, now.keyframe(other), fb, now, strict);
      if (!point) continue;
      const int landmark = map->AddLandmark(*point, id, fa);
      map->AddObservation(landmark, other, fb);
      map->UpdateLandmark(landmark);
      recent_.emplace_back(landmark, id);
      ++made;
      ++known;
    }
  }
  return made;
}

// What was found by corners alone, in this keyframe or in older ones, gets its precise position.
void LocalMapper::Align(int id, Map* map) {
  std::vector<int> window = map->BestCovisible(id, kImages, 15);
  window.push_back(id);
  for (int k : window) {
    if (k < kept_keyframes_) continue;
    const Keyframe& frame = map->keyframe(k);
    if (!frame.features->pyramid) continue;
    auto moved =
        AlignFeatures(*map, rig_.camera, frame.T_world_camera.Inverse(), frame.landmarks, *frame.features);
    if (moved) map->keyframe(k).features = moved;
  }
  if (id - kImages < kept_keyframes_) return;
  Keyframe& old = map->keyframe(id - kImages);
  old.features = WithoutImages(*old.features);
}

void LocalMapper::Process(int id, Map* map, StageTimes* stages) {
  {
    const ScopedStopwatch watch(stages, Lane::kMapping, "map");
    for (int l : map->keyframe(id).landmarks) {
      if (l >= 0) map->UpdateLandmark(l);
    }
    if (!keeps_poses_) CullRecent(id, map);
    const auto timed = [&](const char* name, auto&& step) {
      const ScopedSpan span(stages->recorder, Lane::kMapping, name);
      step();
    };
    timed("triangulate", [&] { Triangulate(id, map); });
    timed("fuse", [&] { FuseNeighbours(rig_.camera, id, map, kept_landmarks_); });
    timed("align", [&] { Align(id, map); });
  }
  if (keeps_poses_) {
    recent_.clear();
    return;
  }
  const ScopedStopwatch watch(stages, Lane::kMapping, "local_ba");
  BundleAdjustmentOptions ba;
  ba.keyframes = options_.ba_keyframes;
  ba.kept_keyframes = kept_keyframes_;
  ba.kept_landmarks = kept_landmarks_;
  ba.pixel_sigma = options_.pixel_sigma;
  ba.metric = rig_.sensor != Sensor::kMono;
  ba.only_aligned = !ba.metric;
  ba.lens.value = lens_.Remaining().value;  // known and fixed: a lens that each window fits for itself bends
  ba.observe_lens = lens_.Enabled() && kept_keyframes_ == 0;  // the map
  const BundleAdjustmentReport report = AdjustLocally(rig_.camera, id, ba, map);
  if (report.lens_seen) lens_.Learn(*report.lens_seen, report.keyframes + report.fixed, map);
}

}  // namespace tutti
