#include "apps/slam/missed_loops.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>
#include <string>
#include <tuple>
#include <utility>

#include "apps/slam/loop_constraint.h"
#include "core/angle.h"
#include "loopclosure/filter/evidence.h"
#include "tutti/loopclosure/relative_pose.h"

namespace tutti {
namespace {

constexpr double kSigmas = 3;            // of the drift along the way
constexpr double kLongWay = 10;          // median depths: a loop is that many times more precise than the way
constexpr double kSameView_deg = 30;     // between the optical axes: ORB is found again up to about there
constexpr int kMinInliers = 12;          // chance lets about 5 fit
constexpr std::size_t kCandidates = 10;  // of a keyframe, the nearest

bool LookTheSameWay(const Pose& a, const Pose& b) {
  const double cosine = (a.rotation * Eigen::Vector3d::UnitZ()).dot(b.rotation * Eigen::Vector3d::UnitZ());
  return cosine >= std::cos(kSameView_deg * internal::kRadians);
}

using Neighbours = std::map<int, std::vector<std::pair<int, double>>>;  // node -> node, length

Neighbours NeighboursOf(const PoseGraph& graph) {
  Neighbours neighbours;
  for (const PoseGraphEdge& edge : graph.edges()) {
    // A loop ties two places; how far they are apart is no way that anything drifts along.
    const double length = edge.kind == EdgeKind::kLoop ? 0 : edge.measurement.translation.norm();
    neighbours[edge.from].emplace_back(edge.to, length);
    neighbours[edge.to].emplace_back(edge.from, length);
  }
  return neighbours;
}

std::map<int, Way> Ways(int node, const Neighbours& neighbours) {
  using Reached = std::tuple<double, int, int>;  // length, node, edges
  std::map<int, Way> ways;
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> open;
  open.emplace(0, node, 0);
  while (!open.empty()) {
    const auto [way, at, edges] = open.top();
    open.pop();
    if (!ways.emplace(at, Way{way, edges}).second) continue;
    const auto next = neighbours.find(at);
    if (next == neighbours.end()) continue;
    for (const auto& [to, length] : next->second) {
      if (ways.count(to) == 0) open.emplace(way + length, to, edges + 1);
    }
  }
  return ways;
}

// What is in one spot, a sign or a window that is there twice, is no place; nor does it tell a motion.
bool CoverBothImages(const std::vector<LandmarkMatch>& matches, const std::vector<int>& inliers,
                     const KeyframeView& candidate, const KeyframeView& query, const CameraRig& rig,
                     const VerificationOptions& verification) {
  std::vector<cv::Point2f> in_candidate, in_query;
  for (const int i : inliers) {
    const auto& [c, q] = matches[static_cast<std::size_t>(i)];
    in_candidate.push_back(candidate.keypoints[static_cast<std::size_t>(c)].pt);
    in_query.push_back(query.keypoints[static_cast<std::size_t>(q)].pt);
  }
  const cv::Size size(rig.camera.width, rig.camera.height);
  const double spread =
      std::min(internal::NarrowestSpread(in_candidate, size), internal::NarrowestSpread(in_query, size));
  return spread >=
         internal::SpreadNeeded(verification.min_spread, kMinInliers, static_cast<int>(inliers.size()));
}

}  // namespace

std::map<int, Way> WaysFrom(int node, const PoseGraph& graph) { return Ways(node, NeighboursOf(graph)); }

std::vector<MissedLoop> FindMissedLoops(const std::vector<StandingKeyframe>& keyframes,
                                        const PoseGraph& graph, const SlamOptions& options) {
  const Neighbours neighbours = NeighboursOf(graph);
  std::vector<MissedLoop> missed;
  for (const StandingKeyframe& query : keyframes) {
    if (!(query.depth > 0)) continue;
    const std::map<int, Way> ways = Ways(query.id, neighbours);
    std::vector<std::pair<double, int>> near;
    for (const StandingKeyframe& candidate : keyframes) {
      if (candidate.id >= query.id) break;
      if (candidate.piece != query.piece || !(candidate.depth > 0)) continue;
      const auto way = ways.find(candidate.id);
      if (way == ways.end() || way->second.length < kLongWay * candidate.depth) continue;
      const double apart = (candidate.T_world_camera.translation - query.T_world_camera.translation).norm();
      const double drift = kSigmas * options.odometry_sigma_fraction * way->second.length;
      if (apart > options.loop_apart_fraction * candidate.depth + drift) continue;
      if (!LookTheSameWay(candidate.T_world_camera, query.T_world_camera)) continue;
      near.emplace_back(apart, candidate.id);
    }
    if (near.empty()) continue;
    std::sort(near.begin(), near.end());
    if (near.size() > kCandidates) near.resize(kCandidates);
    missed.push_back({query.id, {}});
    for (const auto& [apart, id] : near) missed.back().candidates.push_back(id);
  }
  return missed;
}

Verification VerifyLandmarks(const KeyframeView& candidate, const KeyframeView& query, const CameraRig& rig,
                             const VerificationOptions& verification, std::uint64_t seed) {
  Verification out;
  out.candidate = candidate.frame_index;
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  const std::vector<LandmarkMatch> matches = LandmarkMatches(Verification(), candidate, query);
  for (const auto& [c, q] : matches) {
    const cv::Point2f pixel = query.keypoints[static_cast<std::size_t>(q)].pt;
    points.push_back(candidate.points[static_cast<std::size_t>(c)]);
    pixels.emplace_back(pixel.x, pixel.y);
  }
  out.matches = static_cast<int>(points.size());
  RelativePoseOptions options;
  options.min_inliers =
      std::max(kMinInliers, static_cast<int>(std::ceil(verification.min_inlier_ratio * out.matches)));
  options.seed = seed;
  const PnpResult found = SolvePnp(points, pixels, rig.camera, options);
  out.inliers = static_cast<int>(found.inliers.size());
  out.reason = found.reason;
  if (!found.success) return out;
  if (!CoverBothImages(matches, found.inliers, candidate, query, rig, verification)) {
    out.reason = "the matches cover too narrow a part of the image";
    return out;
  }
  out.accepted = true;
  out.type = rig.sensor == Sensor::kMono ? ConstraintType::kSimilarity : ConstraintType::kRigid;
  out.S_candidate_query = Similarity(found.T_camera_points.Inverse());
  out.information = found.information;
  return out;
}

}  // namespace tutti
