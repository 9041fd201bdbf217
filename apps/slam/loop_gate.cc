#include "apps/slam/loop_gate.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "backend/robust/pairwise_consistency.h"
#include "core/angle.h"

namespace tutti {
namespace {

constexpr double kWalkSigmas = 3;  // of the odometry's drift between two loops
// Limits grow to so many times what options say: farther apart, even a bad odometry's loops prove little.
constexpr double kMostGrowth = 4;

double Grown(double limit, double sigma) {
  return std::min(std::hypot(limit, kWalkSigmas * sigma), kMostGrowth * limit);
}

}  // namespace

double LoopGate::Apart(int x, int y, const Map& map) {
  return (map(x).T_world_camera.translation - map(y).T_world_camera.translation).norm();
}

Disagreement LoopGate::Cycle(const LoopEdge& a, const LoopEdge& b, const Map& map) {
  const auto between = [&map](int from, int to) {
    return Similarity(map(from).T_world_camera.Inverse() * map(to).T_world_camera);
  };
  return Measure(internal::LoopCycle(a.S_candidate_query, between(a.query, b.query), b.S_candidate_query,
                                     between(b.candidate, a.candidate)),
                 a.depth);
}

// A random walk: rotations between keyframes add up by their squares, and turn what lies behind them.
Disagreement LoopGate::Limits(const LoopEdge& a, const LoopEdge& b, const Map& map) const {
  const double steps = std::abs(a.query - b.query) + std::abs(a.candidate - b.candidate);
  const double turn_rad = step_.rotation_rad * std::sqrt(steps),
               at_candidates = Apart(a.candidate, b.candidate, map);
  const double shift = std::hypot(step_.fraction * (Apart(a.query, b.query, map) + at_candidates),
                                  turn_rad * (b.S_candidate_query.translation.norm() + at_candidates));
  Disagreement limits;
  limits.fraction = Grown(options_.loop_agree_fraction, shift / a.depth);
  limits.angle_deg = Grown(options_.loop_agree_deg, turn_rad * internal::kDegrees);
  limits.log_scale = options_.loop_agree_scale;
  return limits;
}

bool LoopGate::Near(const LoopEdge& a, const LoopEdge& b) const {
  const auto within = [&](std::int64_t x, std::int64_t y) {
    return std::llabs(x - y) <= options_.loop_confirmation_frames;
  };
  return within(a.query_frame, b.query_frame) && within(a.candidate_frame, b.candidate_frame);
}

bool LoopGate::SideBySide(const LoopEdge& a, const LoopEdge& b, const Map& map) {
  return Apart(a.query, b.query, map) <= a.depth && Apart(a.candidate, b.candidate, map) <= a.depth;
}

bool LoopGate::Agree(const LoopEdge& a, const LoopEdge& b, const Map& map) const {
  const bool odometry_between =
      map(a.query).piece == map(b.query).piece && map(a.candidate).piece == map(b.candidate).piece;
  return odometry_between && Within(Cycle(a, b, map), Limits(a, b, map));
}

// Nothing between pieces.
std::optional<Similarity> LoopGate::InMap(const LoopEdge& loop, const Map& map) {
  const Place q = map(loop.query), c = map(loop.candidate);
  if (q.piece != c.piece) return std::nullopt;
  return Similarity(q.T_world_camera.Inverse() * c.T_world_camera);
}

std::optional<Disagreement> LoopGate::WithMap(const LoopEdge& loop, const Map& map) const {
  const std::optional<Similarity> T_query_candidate = InMap(loop, map);
  if (!T_query_candidate) return std::nullopt;
  return Measure(loop.S_candidate_query * *T_query_candidate, loop.depth);
}

bool LoopGate::Fulfilled(const LoopEdge& loop, const Map& map) const {
  const std::optional<Disagreement> d = WithMap(loop, map);
  return d && d->fraction < options_.loop_defer_fraction && d->angle_deg < options_.loop_defer_deg &&
         d->log_scale < options_.loop_defer_fraction;
}

bool LoopGate::WithinNoise(const std::vector<LoopEdge>& loops, const Map& map) const {
  constexpr double kCoordinates = 6;  // one camera's seventh, the scale, only makes it stricter
  double sum = 0;
  for (const LoopEdge& loop : loops) {
    const std::optional<Similarity> T_query_candidate = InMap(loop, map);
    if (!T_query_candidate) return false;
    // As the pose graph has it (PoseGraphEdge): in the query's frame.
    const Similarity E = (*T_query_candidate * loop.S_candidate_query).Inverse();
    Vector7d error;
    error << E.translation, LogSO3(E.rotation), std::log(E.scale);
    sum += error.dot(loop.information * error);
  }
  return sum <= kCoordinates * static_cast<double>(loops.size());
}

std::vector<LoopEdge> LoopGate::Offer(const LoopEdge& loop, const std::vector<LoopEdge>& accepted,
                                      const Map& map, bool across) {
  const auto agrees_with = [&](const LoopEdge& other) {
    if (other.candidate == loop.candidate && other.query == loop.query) return false;
    return (Near(loop, other) || (across && SideBySide(loop, other, map))) && Agree(loop, other, map);
  };
  std::vector<LoopEdge> entering;
  std::vector<LoopEdge> still_waiting;
  int agreeing = 1;
  for (const LoopEdge& other : waiting_) {
    const bool agrees = agrees_with(other);
    agreeing += agrees ? 1 : 0;
    (agrees ? entering : still_waiting).push_back(other);
  }
  for (const LoopEdge& other : accepted) {
    if (agrees_with(other)) ++agreeing;
  }
  if (agreeing < options_.loop_confirmations && !Fulfilled(loop, map)) {
    waiting_.push_back(loop);
    return {};
  }
  waiting_ = std::move(still_waiting);
  entering.push_back(loop);
  return entering;
}

}  // namespace tutti
