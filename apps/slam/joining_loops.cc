#include "apps/slam/joining_loops.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "apps/slam/loop_constraint.h"
#include "apps/slam/loop_solver.h"
#include "apps/slam/missed_loops.h"
#include "apps/slam/odometry_uncertainty.h"
#include "core/numbers.h"

namespace tutti {
namespace {

constexpr double kDriftSigmas = 3;
constexpr std::size_t kClearly = 2;  // times as many places as the next set

using Pieces = std::pair<int, int>;  // of candidate and query

struct LoopSet {
  std::vector<std::size_t> loops;  // ascending
  std::size_t places = 0;
};

class SetFinder {
 public:
  SetFinder(const std::vector<LoopEdge>& loops, const LoopGate::Places& map, const PoseGraph& graph,
            const SlamOptions& options)
      : loops_(loops), map_(map), graph_(graph), options_(options) {}

  Pieces PiecesOf(const LoopEdge& loop) const { return {map_(loop.candidate).piece, map_(loop.query).piece}; }

  // Of these loops, which are between the same pieces: the sets that agree, the largest first.
  std::vector<LoopSet> Sets(const std::vector<std::size_t>& of) {
    std::vector<std::size_t> root(loops_.size());
    std::iota(root.begin(), root.end(), std::size_t{0});
    const auto find = [&root](std::size_t i) {
      while (root[i] != i) i = root[i];
      return i;
    };
    for (const std::size_t a : of) {
      for (const std::size_t b : of) {
        if (b >= a) break;
        const std::size_t x = find(a), y = find(b);
        if (x != y && Agree(loops_[b], loops_[a])) root[std::max(x, y)] = std::min(x, y);
      }
    }
    std::map<std::size_t, LoopSet> by_root;
    for (const std::size_t i : of) by_root[find(i)].loops.push_back(i);
    std::vector<LoopSet> sets;
    for (auto& [first, set] : by_root) {
      set.places = PlacesOf(set.loops);
      sets.push_back(std::move(set));
    }
    std::stable_sort(sets.begin(), sets.end(), [this](const LoopSet& a, const LoopSet& b) {
      return std::tuple(Confirmed(a), a.places, a.loops.size()) >
             std::tuple(Confirmed(b), b.places, b.loops.size());
    });
    return sets;
  }

  bool Confirmed(const LoopSet& set) const {
    return static_cast<int>(set.loops.size()) >= options_.loop_confirmations;
  }

 private:
  bool Agree(const LoopEdge& a, const LoopEdge& b) {
    const std::map<int, Way>&query_ways = Ways(a.query), &candidate_ways = Ways(a.candidate);
    const auto query_way = query_ways.find(b.query), candidate_way = candidate_ways.find(b.candidate);
    if (query_way == query_ways.end() || candidate_way == candidate_ways.end()) return false;
    const double scale = a.S_candidate_query.scale;
    const Way q = query_way->second, c = candidate_way->second;
    // What turns or scales one loop wrongly moves the other one, which stands that far away.
    const double edges = q.edges + c.edges, lever = std::max(q.length * scale, c.length);
    const auto drift = [edges](double loop, double edge) {
      return kDriftSigmas * std::sqrt(2 * loop * loop + edges * edge * edge);
    };
    const double turn_deg = drift(kLoopSigmaDeg, options_.odometry_sigma_deg);
    const double scales = graph_.kind() == GraphKind::kSim3 ? drift(kLoopSigmaScale, kOdometrySigmaScale) : 0;
    const double length = kDriftSigmas * options_.odometry_sigma_fraction * (q.length * scale + c.length) +
                          std::hypot(turn_deg * internal::kRadians, scales) * lever;
    return Within(LoopGate::Cycle(a, b, map_),
                  {LoopGate::kAgreement.fraction + length / a.depth,
                   LoopGate::kAgreement.angle_deg + turn_deg, LoopGate::kAgreement.log_scale + scales});
  }

  std::size_t PlacesOf(const std::vector<std::size_t>& of) const {
    std::vector<std::size_t> places;
    for (const std::size_t i : of) {
      const LoopEdge& loop = loops_[i];
      const bool another = std::all_of(places.begin(), places.end(), [&](std::size_t p) {
        const LoopEdge& place = loops_[p];
        return LoopGate::Apart(loop.candidate, place.candidate, map_) > place.depth &&
               LoopGate::Apart(loop.query, place.query, map_) * place.S_candidate_query.scale > place.depth;
      });
      if (another) places.push_back(i);
    }
    return places.size();
  }

  const std::map<int, Way>& Ways(int keyframe) {
    const auto [ways, is_new] = ways_.try_emplace(keyframe);
    if (is_new) ways->second = WaysFrom(keyframe, graph_);
    return ways->second;
  }

  const std::vector<LoopEdge>& loops_;
  const LoopGate::Places& map_;
  const PoseGraph& graph_;
  const SlamOptions& options_;
  std::map<int, std::map<int, Way>> ways_;
};

// By places; or by loops where they are many more, at more places: one camera's loops are off in scale now
// and then, and a few agree in that.
bool Outnumbers(const LoopSet& set, const LoopSet& other) {
  constexpr std::size_t kManyMore = 10;
  return set.places >= kClearly * other.places ||
         (set.places > other.places && set.loops.size() >= kManyMore * other.loops.size());
}

std::string Several(std::size_t count, const char* one) {
  return std::to_string(count) + " " + one + (count == 1 ? "" : "s");
}

std::string Counted(const LoopSet& set) {
  return Several(set.loops.size(), "loop") + " at " + Several(set.places, "place");
}

}  // namespace

JoiningLoops ChooseJoiningLoops(const std::vector<LoopEdge>& loops, const LoopGate::Places& map,
                                const PoseGraph& graph, const SlamOptions& options) {
  JoiningLoops out;
  out.reasons.resize(loops.size());
  out.reason = "no loop between them was verified";
  SetFinder finder(loops, map, graph, options);
  std::map<Pieces, std::vector<std::size_t>> between;
  for (std::size_t i = 0; i < loops.size(); ++i) between[finder.PiecesOf(loops[i])].push_back(i);
  std::size_t most = 0;  // loops of what is told as the reason
  for (const auto& [pieces, of] : between) {
    const std::vector<LoopSet> sets = finder.Sets(of);
    const LoopSet& best = sets.front();
    const bool rival = sets.size() > 1 && finder.Confirmed(sets[1]);
    std::string reason;
    if (!finder.Confirmed(best)) {
      reason = "no two of the " + Several(of.size(), "verified loop") + " between them agree";
      if (of.size() == 1) reason = "the only verified loop between them has no second one that agrees";
    } else if (rival && !Outnumbers(best, sets[1])) {
      reason =
          "the loops between them contradict each other, and neither side clearly outnumbers the other: " +
          Counted(best) + " against " + Counted(sets[1]) + ", where twice as many places are asked for";
    }
    if (reason.empty()) out.chosen.insert(out.chosen.end(), best.loops.begin(), best.loops.end());
    for (const LoopSet& set : sets) {
      if (&set == &best && reason.empty()) continue;
      const std::string outside = !reason.empty() ? reason
                                                  : "contradicts what joins the two maps: " + Counted(best) +
                                                        " against " + Counted(set);
      for (const std::size_t i : set.loops) out.reasons[i] = outside;
    }
    if (!reason.empty() && of.size() > most) {
      out.reason = reason;
      most = of.size();
    }
  }
  std::sort(out.chosen.begin(), out.chosen.end());
  if (!out.chosen.empty()) out.reason.clear();
  return out;
}

}  // namespace tutti
