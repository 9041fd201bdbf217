#include "loopclosure/filter/hypothesis_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "loopclosure/detector/parallel.h"
#include "loopclosure/filter/transition_model.h"
#include "loopclosure/index.h"

namespace tutti::internal {
namespace {

constexpr int kPatience = 3;                     // locations in vain on a way along the path
constexpr double kBeside = 22.0 * M_PI / 180.0;  // so much aside is near enough: the way off is short

using internal::Index;

// Only the direction of the translation is known.
bool ScaleFree(const Verification& v) {
  return v.type == ConstraintType::kEssential || v.type == ConstraintType::kFundamental;
}

// Angle of the translation to the candidate's optical axis, 0 to pi/2 [rad].
double Aside(const Verification& v) { return std::acos(std::clamp(v.ahead, 0.0, 1.0)); }

// One camera lies ahead of the other, or behind it.
bool IsAhead(const Verification& v) {
  constexpr double kMostAside = 18.0 * M_PI / 180.0;
  return v.accepted && ScaleFree(v) && Aside(v) <= kMostAside;
}

}  // namespace

// Best places by posterior, apart from each other, best first.
std::vector<int> HypothesisSearch::TopPlaces(const Belief& belief) const {
  std::vector<int> order;
  for (const int slot : memory_.working_memory()) {
    if (PosteriorAt(belief, slot) > 0.0) order.push_back(slot);
  }
  const std::size_t wanted = Index(options_.verification.max_hypotheses);
  // Within a place its neighbours follow closely: look at enough of the best to find `wanted` places.
  const std::size_t looked_at = std::min(order.size(), wanted * (2 * Index(TransitionModel::kLevels) + 1));
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(looked_at), order.end(),
                    [&](int a, int b) {
                      const double pa = belief.places[Index(a)];
                      const double pb = belief.places[Index(b)];
                      return pa != pb ? pa > pb : a > b;
                    });
  order.resize(looked_at);
  std::vector<int> places;
  std::vector<int> covered;
  for (const int slot : order) {
    if (places.size() == wanted && options_.island_levels == 0) break;
    if (std::find(covered.begin(), covered.end(), slot) != covered.end()) continue;
    places.push_back(slot);
    for (const auto& [near, level, loops] : memory_.Neighbours(slot, 1 + options_.verification.neighbours)) {
      covered.push_back(near);
    }
  }
  if (options_.island_levels > 0) RankByIsland(belief, places);
  places.resize(std::min(places.size(), wanted));
  return places;
}

// Best first by the posterior of all that lie near each.
void HypothesisSearch::RankByIsland(const Belief& belief, std::vector<int>& places) const {
  std::vector<std::pair<double, int>> ranked;
  for (const int place : places) {
    double sum = 0;
    for (const auto& [slot, level, loops] : memory_.Neighbours(place, options_.island_levels)) {
      sum += PosteriorAt(belief, slot);
    }
    ranked.emplace_back(sum, place);
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  for (std::size_t i = 0; i < places.size(); ++i) places[i] = ranked[i].second;
}

// What came of a location, nullptr if it was not tried.
const Verification* HypothesisSearch::Tried(int slot, const LoopResult& result) const {
  const std::int64_t id = memory_.id(slot);
  for (const Verification& tried : result.tried) {
    if (tried.candidate == id) return &tried;
  }
  return nullptr;
}

// Geometry's word on a candidate. Who returns was away in between: where the image halfway shows the same as
// the candidate does, the camera stands still, or what is seen moves along (a lorry ahead, people beside).
Verification HypothesisSearch::Look(const View& query, int candidate, int threads) const {
  constexpr int kRecent = 4;        // short-term memories: nothing stays in sight for longer
  constexpr double kTheSame = 0.5;  // of the inliers
  Verification verification = verify_(query, view_of_(candidate), threads);
  const int now = memory_.Find(query.id);  // < 0: an image by itself, which no other one leads to
  const int age = now - candidate;
  if (!verification.accepted || age < 2 || age > kRecent * options_.stm_size) return verification;
  const int halfway = candidate + age / 2;
  const Verification between = verify_(query, view_of_(halfway), threads);
  if (!between.accepted || between.inliers < kTheSame * verification.inliers) return verification;
  verification.accepted = false;
  verification.reason = "what matches was in sight all the time since (image " +
                        std::to_string(memory_.id(halfway)) + " shows it, too): no return";
  return verification;
}

// Tries a candidate unless it was tried before; keeps it as the best if it is.
const Verification& HypothesisSearch::Try(const View& query, int candidate, LoopResult& result) const {
  if (Tried(candidate, result) == nullptr) {
    Take(Look(query, candidate, options_.threads), result);
  }
  return *Tried(candidate, result);
}

// Tries several at the same time: what comes of it is as one after the other.
void HypothesisSearch::TryAll(const View& query, const std::vector<int>& candidates,
                              LoopResult& result) const {
  std::vector<int> untried;
  for (const int slot : candidates) {
    if (Tried(slot, result) == nullptr) untried.push_back(slot);
  }
  if (untried.empty()) return;
  const int count = static_cast<int>(untried.size());
  const int threads_each = std::max(1, options_.threads / count);
  std::vector<Verification> verifications(untried.size());
  RunParallel(count, options_.threads,
              [&](int i) { verifications[Index(i)] = Look(query, untried[Index(i)], threads_each); });
  for (Verification& verification : verifications) Take(std::move(verification), result);
}

void HypothesisSearch::Take(Verification verification, LoopResult& result) {
  result.tried.push_back(std::move(verification));
  const Verification& tried = result.tried.back();
  const Verification& best = result.verification;
  const bool first = result.tried.size() == 1;
  if (first || (tried.accepted && !best.accepted) ||
      (tried.accepted == best.accepted && tried.inliers > best.inliers)) {
    result.verification = tried;
  }
}

void HypothesisSearch::Verify(const View& query, const Belief& belief, LoopResult& result) const {
  const VerificationOptions& options = options_.verification;
  const std::vector<int> places = TopPlaces(belief);
  for (const int place : places) {
    int inliers_here = 0;
    for (const int candidate : ViewsOf(place, belief)) {
      // Neighbours are worth a try where the place itself shows something, or for the best hypothesis.
      if (candidate != place && place != places.front() && inliers_here < options.min_inliers / 2) break;
      inliers_here = std::max(inliers_here, Try(query, candidate, result).inliers);
      if (result.verification.accepted) break;
    }
    if (result.verification.accepted) break;
  }
  result.accepted = result.verification.accepted;
  if (result.accepted) {
    Climb(query, result);
  } else {
    result.reason = result.verification.reason;
  }
}

// The place itself, then the best of its neighbours by posterior. A place that was visited often has many,
// which show the same.
std::vector<int> HypothesisSearch::ViewsOf(int place, const Belief& belief) const {
  constexpr std::size_t kMostNeighbours = 3;
  std::vector<int> views;
  for (const auto& [slot, level, loops] : memory_.Neighbours(place, options_.verification.neighbours)) {
    if (slot != place) views.push_back(slot);
  }
  std::stable_sort(views.begin(), views.end(),
                   [&](int a, int b) { return PosteriorAt(belief, a) > PosteriorAt(belief, b); });
  if (views.size() > kMostNeighbours) views.resize(kMostNeighbours);
  views.insert(views.begin(), place);
  return views;
}

// From an accepted candidate along the path, both ways, to the view that shares the most with the query: the
// best constraint. A few that share less lie between: number of inliers is noisy. Of views that share about
// as much, the nearest.
void HypothesisSearch::Climb(const View& query, LoopResult& result) const {
  constexpr int kReach = 8;              // locations each way
  constexpr double kAboutAsMany = 0.75;  // with fewer, what shares the most is behind
  std::vector<PathWalk> walks;
  const int start = memory_.Find(result.verification.candidate);
  for (const int neighbour : OnThePath(start)) walks.push_back({start, neighbour, 0});
  for (int step = 0; step < kReach && !walks.empty(); ++step) {
    std::vector<int> next;
    next.reserve(walks.size());
    for (const PathWalk& walk : walks) next.push_back(walk.next);
    TryAll(query, next, result);
    std::vector<PathWalk> going_on;
    for (PathWalk& walk : walks) {
      const bool best = result.verification.candidate == memory_.id(walk.next);
      walk.in_vain = best ? 0 : walk.in_vain + 1;
      const int inliers = Tried(walk.next, result)->inliers;
      if (inliers < kAboutAsMany * result.verification.inliers || walk.in_vain == kPatience) continue;
      Advance(walk);
      if (walk.next >= 0) going_on.push_back(walk);
    }
    walks = std::move(going_on);
  }
  TakeNearest(query, result);
}

// Its neighbours by odometry that are candidates.
std::vector<int> HypothesisSearch::OnThePath(int slot) const {
  std::vector<int> slots;
  for (const LocationMemory::Link& link : memory_.links(slot)) {
    if (link.type == LocationMemory::LinkType::kOdometry &&
        memory_.state(link.slot) == LocationMemory::State::kWorking)
      slots.push_back(link.slot);
  }
  return slots;
}

// One location further in the direction of the walk; next < 0 at its end.
void HypothesisSearch::Advance(PathWalk& walk) const {
  const std::vector<int> on = OnThePath(walk.next);
  const auto further = std::find_if(on.begin(), on.end(), [&](int slot) { return slot != walk.last; });
  walk.last = std::exchange(walk.next, further == on.end() ? -1 : *further);
}

// Where no scale is known, the direction of the translation tells which view is nearer: on a path, the query
// lies ahead of the views that come too early, behind those that come too late, and beside the nearest.
void HypothesisSearch::TakeNearest(const View& query, LoopResult& result) const {
  if (!ScaleFree(result.verification) || Aside(result.verification) > kBeside) return;
  const int best = memory_.Find(result.verification.candidate);
  std::vector<int> nearer;
  for (const int neighbour : OnThePath(best)) {
    // Of a camera that is held by hand and moves anywhere, the direction says little about the distance.
    if (!IsAhead(verify_(view_of_(neighbour), view_of_(best), options_.threads))) continue;
    const int nearest = Nearest(query, {best, neighbour, 0}, result);
    if (nearest != best) nearer.push_back(nearest);
  }
  // Nearer on both sides is noise, not a path.
  result.verification = *Tried(nearer.size() == 1 ? nearer.front() : best, result);
}

// Away from the best view as long as the views show about as much: the one that the query lies most aside of,
// the best view itself if of none clearly.
int HypothesisSearch::Nearest(const View& query, PathWalk walk, LoopResult& result) const {
  constexpr int kReach = 5;                        // locations
  constexpr double kClearly = 2.0 * M_PI / 180.0;  // beyond the noise of the direction
  const Verification* best = Tried(walk.last, result);
  const double enough = options_.verification.nearer_share * best->inliers;
  double aside = Aside(*best);
  const double clearly = aside + kClearly;
  int nearest = walk.last;
  for (int step = 0; step < kReach && walk.in_vain < kPatience && aside < kBeside && walk.next >= 0; ++step) {
    const Verification& view = Try(query, walk.next, result);
    if (!view.accepted || !ScaleFree(view) || view.inliers < enough) break;
    ++walk.in_vain;
    if (Aside(view) > std::max(aside, clearly)) {
      aside = Aside(view);
      nearest = walk.next;
      walk.in_vain = 0;
    }
    Advance(walk);
  }
  return nearest;
}

}  // namespace tutti::internal
