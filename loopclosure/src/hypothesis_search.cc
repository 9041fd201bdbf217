#include "hypothesis_search.h"

#include <algorithm>

#include "tutti/loopclosure/transition_model.h"

namespace tutti::internal {
namespace {

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

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
    if (places.size() == wanted) break;
    if (std::find(covered.begin(), covered.end(), slot) != covered.end()) continue;
    places.push_back(slot);
    for (const auto& [near, level] : memory_.Neighbours(slot, 1 + options_.verification.neighbours)) {
      covered.push_back(near);
    }
  }
  return places;
}

// What came of a location, nullptr if it was not tried.
const Verification* HypothesisSearch::Tried(int slot, const LoopResult& result) const {
  const std::int64_t id = memory_.id(slot);
  for (const Verification& tried : result.tried) {
    if (tried.candidate == id) return &tried;
  }
  return nullptr;
}

// Tries a candidate unless it was tried before; keeps it as the best if it is.
const Verification& HypothesisSearch::Try(const View& query, int candidate, LoopResult& result) const {
  if (const Verification* before = Tried(candidate, result)) return *before;
  result.tried.push_back(verifier_.Verify(query, view_of_(candidate), options_.threads));
  const Verification& tried = result.tried.back();
  const Verification& best = result.verification;
  const bool first = result.tried.size() == 1;
  if (first || (tried.accepted && !best.accepted) ||
      (tried.accepted == best.accepted && tried.inliers > best.inliers)) {
    result.verification = tried;
  }
  return tried;
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
  for (const auto& [slot, level] : memory_.Neighbours(place, options_.verification.neighbours)) {
    if (slot != place) views.push_back(slot);
  }
  std::stable_sort(views.begin(), views.end(),
                   [&](int a, int b) { return PosteriorAt(belief, a) > PosteriorAt(belief, b); });
  if (views.size() > kMostNeighbours) views.resize(kMostNeighbours);
  views.insert(views.begin(), place);
  return views;
}

// From an accepted candidate along the path to the neighbour that shares the most with the query: the best
// constraint. Of views that share about as much, the nearest.
void HypothesisSearch::Climb(const View& query, LoopResult& result) const {
  constexpr int kSteps = 3;
  for (int step = 0; step < kSteps; ++step) {
    const std::int64_t start = result.verification.candidate;
    TryNeighbours(query, start, result);
    if (result.verification.candidate == start) break;
  }
  const double enough = options_.verification.nearer_share * result.verification.inliers;
  for (int step = 0; step < kSteps; ++step) {
    const std::int64_t start = result.verification.candidate;
    TakeNearer(enough, result);
    if (result.verification.candidate == start) return;
    const Verification nearer = result.verification;
    TryNeighbours(query, nearer.candidate, result);
    result.verification = nearer;
  }
}

// The views before and after one on the path. Keeps result.verification unless one has more inliers.
void HypothesisSearch::TryNeighbours(const View& query, std::int64_t id, LoopResult& result) const {
  for (const LocationMemory::Link& link : memory_.links(memory_.Find(id))) {
    if (link.type == LocationMemory::LinkType::kOdometry &&
        memory_.state(link.slot) == LocationMemory::State::kWorking)
      Try(query, link.slot, result);
  }
}

// True if the views before and after are both nearer by their directions: noise, not a path.
bool HypothesisSearch::NearerOnBothSides(const LoopResult& result) const {
  int nearer = 0;
  for (const LocationMemory::Link& link : memory_.links(memory_.Find(result.verification.candidate))) {
    if (link.type != LocationMemory::LinkType::kOdometry) continue;
    const Verification* tried = Tried(link.slot, result);
    if (tried != nullptr && tried->accepted && tried->ahead < result.verification.ahead) ++nearer;
  }
  return nearer > 1;
}

// Where no scale is known, the direction of the translation tells which view is nearer: on a path, the query
// lies ahead of the views that come too early, behind those that come too late, and beside the nearest.
void HypothesisSearch::TakeNearer(double enough, LoopResult& result) const {
  constexpr double kOnAPath = 0.95;  // elsewhere (hand-held) the direction says little about the distance
  constexpr double kClearly = 0.02;  // beyond the noise of the direction
  const auto scale_free = [](const Verification& v) {
    return v.type == ConstraintType::kEssential || v.type == ConstraintType::kFundamental;
  };
  if (!scale_free(result.verification) || result.verification.ahead < kOnAPath) return;
  if (NearerOnBothSides(result)) return;
  const Verification* nearest = &result.verification;
  for (const LocationMemory::Link& link : memory_.links(memory_.Find(result.verification.candidate))) {
    const Verification* tried = Tried(link.slot, result);
    if (tried == nullptr || !tried->accepted || !scale_free(*tried)) continue;
    if (tried->inliers >= enough && tried->ahead < nearest->ahead - kClearly) nearest = tried;
  }
  if (nearest != &result.verification) result.verification = Verification(*nearest);
}

}  // namespace tutti::internal
