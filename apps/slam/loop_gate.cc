#include "apps/slam/loop_gate.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "backend/robust/loop_agreement.h"
#include "core/numbers.h"

namespace tutti {
namespace {

constexpr double kWalkSigmas = 3;  // of the odometry's drift between two loops
// Limits grow to so many times kAgreement: farther apart, even a bad odometry's loops prove little.
constexpr double kMostGrowth = 4;
// Of the median scene depth, or turned by this: what was seen from close by or fills the middle of the one
// image is gone or elsewhere in the other.
constexpr double kApartFraction = 0.3;
constexpr double kApartDeg = 20;
constexpr double kLoosely = 2;  // times the limits; then one witness more is asked for

double Grown(double limit, double sigma, double times) {
  return std::min(times * std::hypot(limit, kWalkSigmas * sigma), kMostGrowth * limit);
}

}  // namespace

double LoopGate::Apart(int x, int y, const Places& map) {
  return (map(x).T_world_camera.translation - map(y).T_world_camera.translation).norm();
}

Disagreement LoopGate::Cycle(const LoopEdge& a, const LoopEdge& b, const Places& map) {
  const auto between = [&map](int from, int to) {
    return Similarity(map(from).T_world_camera.Inverse() * map(to).T_world_camera);
  };
  return Measure(internal::LoopCycle(a.S_candidate_query, between(a.query, b.query), b.S_candidate_query,
                                     between(b.candidate, a.candidate)),
                 a.depth);
}

// A random walk: rotations between keyframes add up by their squares, and turn what lies behind them.
Disagreement LoopGate::Limits(const LoopEdge& a, const LoopEdge& b, const Places& map, double times) const {
  const double steps = std::abs(a.query - b.query) + std::abs(a.candidate - b.candidate);
  const double turn_rad = step_.rotation_rad * std::sqrt(steps),
               at_candidates = Apart(a.candidate, b.candidate, map);
  const double shift = std::hypot(step_.fraction * (Apart(a.query, b.query, map) + at_candidates),
                                  turn_rad * (b.S_candidate_query.translation.norm() + at_candidates));
  Disagreement limits;
  limits.fraction = Grown(kAgreement.fraction, shift / a.depth, times);
  limits.angle_deg = Grown(kAgreement.angle_deg, turn_rad * internal::kDegrees, times);
  limits.log_scale = kAgreement.log_scale;
  return limits;
}

bool LoopGate::Near(const LoopEdge& a, const LoopEdge& b) const {
  const auto within = [&](std::int64_t x, std::int64_t y) {
    return std::llabs(x - y) <= options_.loop_confirmation_frames;
  };
  return within(a.query_frame, b.query_frame) && within(a.candidate_frame, b.candidate_frame);
}

bool LoopGate::SideBySide(const LoopEdge& a, const LoopEdge& b, const Places& map) {
  return Apart(a.query, b.query, map) <= a.depth && Apart(a.candidate, b.candidate, map) <= a.depth;
}

bool LoopGate::Agree(const LoopEdge& a, const LoopEdge& b, const Places& map, double times) const {
  const bool odometry_between =
      map(a.query).piece == map(b.query).piece && map(a.candidate).piece == map(b.candidate).piece;
  return odometry_between && Within(Cycle(a, b, map), Limits(a, b, map, times));
}

// Nothing between pieces.
std::optional<Similarity> LoopGate::InMap(const LoopEdge& loop, const Places& map) {
  const Place q = map(loop.query), c = map(loop.candidate);
  if (q.piece != c.piece) return std::nullopt;
  return Similarity(q.T_world_camera.Inverse() * c.T_world_camera);
}

std::optional<Disagreement> LoopGate::WithMap(const LoopEdge& loop, const Places& map) const {
  const std::optional<Similarity> T_query_candidate = InMap(loop, map);
  if (!T_query_candidate) return std::nullopt;
  return Measure(loop.S_candidate_query * *T_query_candidate, loop.depth);
}

bool LoopGate::Fulfilled(const LoopEdge& loop, const Places& map) const {
  const std::optional<Disagreement> d = WithMap(loop, map);
  return d && d->fraction < options_.loop_defer_fraction && d->angle_deg < options_.loop_defer_deg &&
         d->log_scale < options_.loop_defer_fraction;
}

bool LoopGate::WithinNoise(const std::vector<LoopEdge>& loops, const Places& map) const {
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

bool LoopGate::Independent(const LoopEdge& a, const LoopEdge& b, const Places& map) {
  const auto differ = [&](int x, int y) {
    if (map(x).piece != map(y).piece || Apart(x, y, map) >= kApartFraction * a.depth) return true;
    const Pose turn = map(x).T_world_camera.Inverse() * map(y).T_world_camera;
    return LogSO3(turn.rotation).norm() * internal::kDegrees >= kApartDeg;
  };
  return differ(a.query, b.query) && differ(a.candidate, b.candidate);
}

LoopGate::Admitted LoopGate::Admit(const LoopEdge& loop, const std::vector<LoopEdge>& waiting,
                                   const std::vector<LoopEdge>& accepted, const Places& map, bool across,
                                   const Trusts& trusts) const {
  const auto trust_in = [&trusts](const LoopEdge& l) { return trusts ? trusts(l) : Trust::kSure; };
  const Trust trust = trust_in(loop);
  const bool loop_is_weak = trust == Trust::kWeak;
  const int needed = trust == Trust::kSure   ? options_.loop_confirmations
                     : trust == Trust::kWeak ? std::max(2, options_.loop_confirmations)
                                             : options_.loop_confirmations + 1;
  // Those that agree within so many times the limits; without loops if they are too few.
  const auto agreeing = [&](double times, int enough) {
    Admitted admitted;
    int count = 1;
    bool proven = !loop_is_weak;  // a strong one is among them
    const auto agrees = [&](const LoopEdge& other, Trust in_other) {
      if (other.candidate == loop.candidate && other.query == loop.query) return false;
      const bool near = Near(loop, other) || (across && SideBySide(loop, other, map));
      if (!near || !Agree(loop, other, map, times)) return false;
      const bool doubted = trust != Trust::kSure || in_other != Trust::kSure;
      if (doubted && !Independent(loop, other, map)) return true;
      ++count;
      proven = proven || in_other != Trust::kWeak;
      if (!admitted.witness || in_other != Trust::kWeak) admitted.witness = other;
      return true;
    };
    for (const LoopEdge& other : waiting) {
      if (agrees(other, trust_in(other))) admitted.loops.push_back(other);
    }
    for (const LoopEdge& other : accepted)
      agrees(other, Trust::kSure);  // it was proven, and the map bears it
    admitted.loops.push_back(loop);
    return proven && count >= enough ? admitted : Admitted();
  };
  Admitted admitted = agreeing(1, needed);
  if (admitted.loops.empty()) admitted = agreeing(kLoosely, needed + 1);
  if (admitted.loops.empty() && Fulfilled(loop, map)) {
    // Of a weak one that the map says already, the others learn nothing.
    if (!loop_is_weak) admitted = agreeing(1, 0);
    if (loop_is_weak) admitted.loops = {loop};
    admitted.witness.reset();
  }
  return admitted;
}

}  // namespace tutti
