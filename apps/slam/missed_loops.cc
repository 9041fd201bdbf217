#include "apps/slam/missed_loops.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>
#include <tuple>
#include <utility>

#include "apps/slam/loop_constraint.h"
#include "core/numbers.h"

namespace tutti {
namespace {

constexpr double kSigmas = 3;            // of the drift along the way
constexpr double kLongWay = 10;          // median depths: a loop is that many times more precise than the way
constexpr double kSameView_deg = 30;     // between the optical axes: ORB is found again up to about there
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
      if (apart > kMostLoopApart * candidate.depth + drift) continue;
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

}  // namespace tutti
