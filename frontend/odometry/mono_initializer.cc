#include "frontend/odometry/mono_initializer.h"

#include <algorithm>
#include <cstdio>
#include <limits>
#include <utility>

#include "core/numbers.h"
#include "frontend/map/bundle_adjustment.h"
#include "frontend/map/matcher.h"
#include "frontend/odometry/rolling_start.h"

namespace tutti {
namespace {
constexpr std::size_t kMaxPending = 100;  // frames kept to be posed backwards
constexpr int kMinMatches = 80;
constexpr std::size_t kMostReferences = 5;
constexpr double kReferencesApart_s = 0.2;
constexpr double kLongest_s = 3;      // views that are further apart only get worse
constexpr double kSurely = 30;        // chi-square by which a motion fits better than the reversed one
constexpr double kLeastNoise = 0.01;  // of a residual's square, in its variances

// Views with little perspective have a second explanation: the camera moved the opposite way, turned so that
// the mean flow is the same, and what is near is far (Szeliski and Kang, "Shape ambiguities in structure from
// motion", PAMI 1997). With inverse depths rho and their mean m,
//   rho' = 2 m - rho,  t' = -t,  R' = Exp(2 m (-t_y, t_x, 0)) R.
// It is a valley of its own, which an adjustment does not leave.
TwoViewResult Reversed(const TwoViewResult& view) {
  std::vector<double> inverse;
  for (std::size_t i = 0; i < view.points.size(); ++i) {
    if (view.valid[i]) inverse.push_back(1 / view.points[i].z());
  }
  const double mean = internal::Median(std::move(inverse));
  const Eigen::Vector3d t = view.T_second_first.translation;
  TwoViewResult out = view;
  out.T_second_first =
      Pose(ExpSO3(2 * mean * Eigen::Vector3d(-t.y(), t.x(), 0)) * view.T_second_first.rotation, -t);
  for (std::size_t i = 0; i < view.points.size(); ++i) {
    if (!view.valid[i]) continue;
    const Eigen::Vector3d& p = view.points[i];
    out.points[i] = p / (p.z() * std::max(0.05 * mean, 2 * mean - 1 / p.z()));
  }
  return out;
}

// Of the two newest keyframes.
Eigen::Vector3d DirectionOfPair(const Map& map) {
  const Keyframe &first = map.keyframe(map.KeyframeCount() - 2), &second = map.keyframe(first.id + 1);
  return (second.T_world_camera.translation - first.T_world_camera.translation).normalized();
}

}  // namespace

void MonoInitializer::Reset() {
  references_.clear();
  pending_.clear();
}

// Keeps those that still have enough in common with the frame. Matches of the first of them.
MonoInitializer::Matches MonoInitializer::FollowReferences(const TrackedFrame& frame) {
  const float radius = static_cast<float>(std::max(100, rig_.camera.width / 10));
  Matches first;
  std::vector<FirstView> kept;
  for (FirstView& reference : references_) {
    Matches matches = MatchTwoViews(*reference.frame.features, *frame.features, radius, &reference.centres);
    if (static_cast<int>(matches.size()) < kMinMatches) continue;
    if (kept.empty()) first = std::move(matches);
    kept.push_back(std::move(reference));
  }
  references_ = std::move(kept);
  return first;
}

void MonoInitializer::KeepAsReference(const TrackedFrame& frame) {
  const bool full = references_.size() >= kMostReferences;
  if (full ||
      (!references_.empty() && !(frame.stamp_s - references_.back().frame.stamp_s >= kReferencesApart_s)))
    return;
  references_.push_back({frame, {}});
  for (const cv::KeyPoint& k : frame.features->keypoints) references_.back().centres.push_back(k.pt);
}

// A rolling shutter bends a view by how the camera turns in it: as if all rows were read with the middle one.
TrackedFrame MonoInitializer::Straight(const TrackedFrame& frame) const {
  const RollingShutter shutter(rig_);
  if (!shutter.Rolls()) return frame;
  const std::optional<Vector6d> turn = TurnIn(rig_.camera, pending_, frame);
  if (!turn) return frame;
  TrackedFrame straight = frame;
  straight.features = shutter.Straighten(*frame.features, *turn, 1);
  return straight;
}

bool MonoInitializer::Offer(const TrackedFrame& seen, int piece, const Pose& T_world_camera,
                            double median_depth, Map* map, std::string* reason) {
  const TrackedFrame frame = Straight(seen);
  const auto wait = [&](const std::string& why) {
    *reason = why;
    pending_.push_back(seen);
    pending_.back().features = WithoutImages(*seen.features);
    if (pending_.size() > kMaxPending) pending_.erase(pending_.begin());
    return false;
  };
  if (frame.features->size() < static_cast<std::size_t>(kMinMatches)) {
    return wait("initialising: only " + std::to_string(frame.features->size()) + " features in the image");
  }
  const bool begins = references_.empty();
  const Matches matches = FollowReferences(frame);
  if (references_.empty()) {
    KeepAsReference(frame);
    return wait(begins ? "initialising: waiting for a second view"
                       : "initialising: too few matches with the first view; started again");
  }
  const FirstView reference = references_.front();
  std::vector<cv::Point2f> first, second;
  for (const auto& [a, b] : matches) {
    first.push_back(reference.frame.features->keypoints[static_cast<std::size_t>(a)].pt);
    second.push_back(frame.features->keypoints[static_cast<std::size_t>(b)].pt);
  }
  TwoViewOptions options;
  options.pixel_sigma = options_.pixel_sigma;
  const TwoViewResult view = EstimateTwoView(rig_.camera, first, second, options);
  if (!view.success) {
    if (frame.stamp_s - reference.frame.stamp_s > kLongest_s) references_.erase(references_.begin());
    KeepAsReference(frame);
    return wait("initialising: " + view.reason);
  }

  // The motion or its reversal, whichever fits better.
  Map trial = *map, reversed = *map;
  const auto add = [&](const TwoViewResult& motion, Map* made) {
    return AddPair(frame, piece, T_world_camera, median_depth, matches, motion, made);
  };
  double cost = add(view, &trial), other_cost = add(Reversed(view), &reversed);
  const bool opposite = DirectionOfPair(trial).dot(DirectionOfPair(reversed)) < 0;
  if (opposite && other_cost < cost) {
    std::swap(trial, reversed);
    std::swap(cost, other_cost);
  }
  const double sigma_deg = DirectionSigmaOfPair(trial) / internal::kRadians;
  if (!(sigma_deg <= options_.max_direction_sigma_deg)) {
    char text[120];
    std::snprintf(text, sizeof text,
                  "initialising: the direction of motion is known to %.1f deg only, %.1f deg are needed",
                  sigma_deg, options_.max_direction_sigma_deg);
    KeepAsReference(frame);
    return wait(text);
  }
  const auto points = static_cast<double>(std::count(view.valid.begin(), view.valid.end(), 1));
  const double noise = std::max(kLeastNoise, 2 * cost / std::max(1.0, points - 5));
  if (opposite && !(2 * (other_cost - cost) > kSurely * noise)) {
    KeepAsReference(frame);
    return wait("initialising: the opposite motion fits the two views as well");
  }
  *map = std::move(trial);
  return true;
}

// The reference and `frame` as keyframes, with their common landmarks, adjusted. Returns the cost.
double MonoInitializer::AddPair(const TrackedFrame& frame, int piece, const Pose& T_world_camera,
                                double median_depth, const Matches& matches, const TwoViewResult& view,
                                Map* map) const {
  const TrackedFrame& reference = references_.front().frame;
  std::vector<double> depths;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (view.valid[i]) depths.push_back(view.points[i].z());
  }
  const double scale = median_depth / internal::Median(std::move(depths));
  Pose T_second_first = view.T_second_first;
  T_second_first.translation *= scale;

  Keyframe k0, k1;
  k0.frame_index = reference.index;
  k0.stamp_s = reference.stamp_s;
  k0.features = reference.features;
  k0.T_world_camera = T_world_camera;
  k1.frame_index = frame.index;
  k1.stamp_s = frame.stamp_s;
  k1.features = frame.features;
  k1.T_world_camera = T_world_camera * T_second_first.Inverse();
  k0.piece = k1.piece = piece;
  const int a = map->AddKeyframe(k0), b = map->AddKeyframe(k1);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (!view.valid[i]) continue;
    const int landmark =
        map->AddLandmark(T_world_camera * Eigen::Vector3d(view.points[i] * scale), a, matches[i].first);
    map->AddObservation(landmark, b, matches[i].second);
    map->UpdateLandmark(landmark);
  }
  BundleAdjustmentOptions ba;
  ba.iterations = 20;
  ba.pixel_sigma = options_.pixel_sigma;
  const BundleAdjustmentReport report = AdjustWindow(rig_.camera, {b}, {a}, ba, map);
  return report.usable ? report.final_cost : std::numeric_limits<double>::infinity();
}

// Of the two newest keyframes; what the adjustment removed no longer counts.
double MonoInitializer::DirectionSigmaOfPair(const Map& map) const {
  const Keyframe &first = map.keyframe(map.KeyframeCount() - 2), &second = map.keyframe(first.id + 1);
  const Pose T_first_world = first.T_world_camera.Inverse();
  std::vector<TwoViewPoint> points;
  for (const int id : map.LandmarksOf({second.id})) {
    const Landmark& l = map.landmark(id);
    if (l.observations.size() != 2) continue;
    const auto sigma = [&](const Keyframe& k, const Observation& o) {
      return options_.pixel_sigma * map.RelativeSigma(*k.features, k.id, o.feature, id);
    };
    points.push_back(
        {T_first_world * l.position, sigma(first, l.observations[0]), sigma(second, l.observations[1])});
  }
  return DirectionSigma(rig_.camera, second.T_world_camera.Inverse() * first.T_world_camera, points);
}

}  // namespace tutti
