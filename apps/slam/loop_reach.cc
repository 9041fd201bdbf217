#include "apps/slam/loop_reach.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <utility>
#include <vector>

#include "apps/slam/loop_solver.h"

namespace tutti {
namespace {

std::vector<int> KeyframesOfPiece(int piece, const Map& map) {
  std::vector<int> ids;
  for (const int id : map.KeyframeIds()) {
    if (map.keyframe(id).piece == piece) ids.push_back(id);
  }
  return ids;
}

double Step(int a, int b, const Map& map) {
  return (map.keyframe(a).T_world_camera.translation - map.keyframe(b).T_world_camera.translation).norm();
}

// The two keyframes are of one submap.
double WayBetween(int from, int to, const Map& map) {
  const auto [first, last] = std::minmax(from, to);
  const std::vector<int> ids = KeyframesOfPiece(map.keyframe(from).piece, map);
  double way = 0;
  for (std::size_t i = 1; i < ids.size(); ++i) {
    if (ids[i - 1] >= first && ids[i] <= last) way += Step(ids[i - 1], ids[i], map);
  }
  return way;
}

// The query in the candidate's frame, by the map; both are of one piece.
Pose InMap(const LoopEdge& loop, const Map& map) {
  return map.keyframe(loop.candidate).T_world_camera.Inverse() * map.keyframe(loop.query).T_world_camera;
}

bool OfOnePiece(const LoopEdge& loop, const Map& map) {
  return map.keyframe(loop.candidate).piece == map.keyframe(loop.query).piece;
}

// Where the tracking was lost: the keyframes next to the shortest gap between the pieces of a loop's ends.
struct Gap {
  int candidate_side = -1, query_side = -1;
  double seconds = 0;
};

std::optional<Gap> ShortestGap(const LoopEdge& loop, const Map& map) {
  const int ours = map.keyframe(loop.candidate).piece, theirs = map.keyframe(loop.query).piece;
  std::optional<Gap> gap;
  int before = -1;
  for (const int id : map.KeyframeIds()) {
    const int piece = map.keyframe(id).piece;
    if (piece != ours && piece != theirs) continue;
    const int last = std::exchange(before, id);
    if (last < 0 || map.keyframe(last).piece == piece) continue;
    const double seconds = map.keyframe(id).stamp_s - map.keyframe(last).stamp_s;
    if (seconds <= 0 || (gap && gap->seconds <= seconds)) continue;
    gap = piece == theirs ? Gap{last, id, seconds} : Gap{id, last, seconds};
  }
  return gap;
}

// The speed of the camera in its faster moments [map units/s]; 0: not known.
double FastSpeed(int piece, const Map& map) {
  constexpr double kFaster = 0.9;  // quantile
  const std::vector<int> ids = KeyframesOfPiece(piece, map);
  std::vector<double> speeds;
  for (std::size_t i = 1; i < ids.size(); ++i) {
    const double seconds = map.keyframe(ids[i]).stamp_s - map.keyframe(ids[i - 1]).stamp_s;
    if (seconds > 0) speeds.push_back(Step(ids[i - 1], ids[i], map) / seconds);
  }
  if (speeds.empty()) return 0;
  const auto at =
      speeds.begin() + static_cast<std::ptrdiff_t>(kFaster * static_cast<double>(speeds.size() - 1));
  std::nth_element(speeds.begin(), at, speeds.end());
  return *at;
}

// Lengths in the units of the candidate's piece.
std::string WhyNoWayAcross(const LoopEdge& loop, const Map& map, Sensor sensor) {
  constexpr double kMuchFaster = 2;    // than in its faster moments
  constexpr double kOfTheDepth = 0.5;  // of the scene: for what moves by jerks
  constexpr double kDrift = 0.05;      // of the ways from the gap to the loop's ends
  constexpr double kDriftOfOneCamera = 0.3;
  const std::optional<Gap> gap = ShortestGap(loop, map);
  if (!gap) return "";
  const double scale = loop.S_candidate_query.scale;
  const double speed = std::max(FastSpeed(map.keyframe(loop.candidate).piece, map),
                                scale * FastSpeed(map.keyframe(loop.query).piece, map));
  if (!(speed > 0)) return "";
  const Similarity by_loop = Similarity(map.keyframe(loop.candidate).T_world_camera) *
                             loop.S_candidate_query *
                             Similarity(map.keyframe(loop.query).T_world_camera.Inverse());
  const double jump = (by_loop * map.keyframe(gap->query_side).T_world_camera.translation -
                       map.keyframe(gap->candidate_side).T_world_camera.translation)
                          .norm();
  const double drift = sensor == Sensor::kMono ? kDriftOfOneCamera : kDrift;
  const double ways = WayBetween(gap->candidate_side, loop.candidate, map) +
                      scale * WayBetween(gap->query_side, loop.query, map);
  if (jump <= kMuchFaster * speed * gap->seconds + drift * ways + kOfTheDepth * loop.depth) return "";
  std::array<char, 160> text{};
  std::snprintf(
      text.data(), text.size(),
      "the camera would have jumped by %.1f %s while tracking was lost for %.1f s: another place that "
      "looks like it",
      jump, sensor == Sensor::kMono ? "units of the map" : "m", gap->seconds);
  return text.data();
}

}  // namespace

bool InReach(const LoopEdge& loop, const Map& map) {
  constexpr double kMostDrift = 0.5;  // share of the way
  if (!OfOnePiece(loop, map)) return true;
  const double off = (loop.S_candidate_query.translation - InMap(loop, map).translation).norm();
  return off <= kMostDrift * WayBetween(loop.candidate, loop.query, map) + loop.depth;
}

std::string WhyImpossible(const LoopEdge& loop, const Map& map, Sensor sensor) {
  constexpr double kMostTurnedDeg = 60;
  if (!OfOnePiece(loop, map)) return WhyNoWayAcross(loop, map, sensor);
  const Similarity off = loop.S_candidate_query * Similarity(InMap(loop, map).Inverse());
  const double turned_deg = Measure(off, loop.depth).angle_deg;
  if (turned_deg <= kMostTurnedDeg) return "";
  return "the map would have to turn by " + std::to_string(std::lround(turned_deg)) +
         " deg: another place that looks like it";
}

}  // namespace tutti
