#include "loopclosure/detector/hypothesis_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/numbers.h"
#include "loopclosure/filter/transition_model.h"

namespace tutti::internal {

double MassAround(const Belief& belief, int slot, const LocationMemory& memory) {
  double mass = 0;
  for (const auto& [near, level, loops] : memory.Neighbours(slot, kAboutHere))
    mass += PosteriorAt(belief, near);
  return std::min(1.0, mass);
}

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
    const std::vector<int> near = memory_.SlotsNear(slot, 1 + options_.verification.neighbours);
    covered.insert(covered.end(), near.begin(), near.end());
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

// Geometry's word on a candidate. Who returns was away in between: where the image halfway shows the same as
// the candidate does, the camera stands still, or what is seen moves along (a lorry ahead, people beside).
Verification HypothesisSearch::Look(const View& query, int candidate, int threads) const {
  constexpr int kRecent = 4;        // short-term memories: nothing stays in sight for longer
  constexpr double kTheSame = 0.5;  // of the inliers
  Verification verification = verify_(query, view_of_(candidate), threads);
  const int now = memory_.Find(query.id);  // < 0: an image by itself, which no other one leads to
  const int age = now - candidate;
  if (!verification.similar || age < 2 || age > kRecent * options_.stm_size) return verification;
  const int halfway = candidate + age / 2;
  const Verification between = verify_(query, view_of_(halfway), threads);
  if (!between.similar || between.inliers < kTheSame * verification.inliers) return verification;
  verification.similar = verification.accepted = false;
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

void HypothesisSearch::Take(Verification verification, LoopResult& result) {
  result.tried.push_back(std::move(verification));
  const Verification& tried = result.tried.back();
  const Verification& best = result.verification;
  const bool first = result.tried.size() == 1;
  if (first || (tried.similar && !best.similar) ||
      (tried.similar == best.similar && tried.inliers > best.inliers)) {
    result.verification = tried;
  }
}

void HypothesisSearch::Verify(const View& query, const Belief& belief, LoopResult& result) const {
  constexpr int kShowsSomething = 15;  // inliers
  const std::vector<int> places = TopPlaces(belief);
  for (const int place : places) {
    int inliers_here = 0;
    for (const int candidate : ViewsOf(place, belief)) {
      // Neighbours are worth a try where the place itself shows something, or for the best hypothesis.
      if (candidate != place && place != places.front() && inliers_here < kShowsSomething) break;
      const Verification& tried = Try(query, candidate, result);
      inliers_here = std::max(inliers_here, tried.inliers);
      if (tried.similar) break;
    }
    if (result.verification.accepted) break;
  }
  Decide(query, belief, result);
}

void HypothesisSearch::VerifyMore(int slot, const Belief& belief, LoopResult& result) const {
  const View& query = view_of_(slot);
  const std::vector<int> places = TopPlaces(belief);
  if (!places.empty()) {
    for (const int candidate : ViewsOf(places.front(), belief)) {
      if (Try(query, candidate, result).similar) break;
    }
  }
  Decide(query, belief, result);
}

void HypothesisSearch::Reconsider(const Belief& belief, LoopResult& result) const {
  Weigh(belief, result);
  result.probability = std::max(0.0, MostProbable(result).second);
}

Verification HypothesisSearch::WithMatches(int query, const Verification& verification) const {
  if (!verification.inlier_matches.empty()) return verification;
  const int slot = memory_.Find(verification.candidate);
  if (memory_.state(slot) != LocationState::kWorking) return verification;  // its view may be gone
  Verification full = verify_(view_of_(query), view_of_(slot), options_.threads);
  full.mass = verification.mass;
  return full;
}

// Chooses the most probable of the places that geometry finds similar, and the nearest of its views.
void HypothesisSearch::Decide(const View& query, const Belief& belief, LoopResult& result) const {
  constexpr double kWorthASearch = 0.5;  // probability: below, no other view of the place makes it a loop
  Weigh(belief, result);
  const auto [chosen, probability] = MostProbable(result);
  result.accepted = chosen != nullptr;
  if (!result.accepted) {
    result.reason = result.verification.reason;
    return;
  }
  result.verification = *chosen;
  result.probability = probability;
  if (probability < kWorthASearch) return;
  const Verification found = result.verification;
  const int nearest =
      FindNearestView(query, memory_.Find(found.candidate), memory_, view_of_,
                      [&](int slot) -> const Verification& { return TryWithMatches(query, slot, result); });
  Weigh(belief, result);
  // The nearest view is the loop, whichever of the views along the path tells best that it is one.
  result.probability = MostProbable(result).second;
  result.verification = *Tried(nearest, result);
  if (found.accepted && !result.verification.accepted)
    result.verification = *Tried(memory_.Find(found.candidate), result);
}

// What geometry finds similar, with its probability; null and -1 if it finds nothing.
std::pair<const Verification*, double> HypothesisSearch::MostProbable(const LoopResult& result) {
  std::pair<const Verification*, double> most(nullptr, -1);
  for (const Verification& tried : result.tried) {
    if (!tried.similar) continue;
    const double probability = LoopProbability(tried);
    if (probability > most.second) most = {&tried, probability};
  }
  return most;
}

// Does what Try does, but what was tried at first has no matches any more: they are found again.
const Verification& HypothesisSearch::TryWithMatches(const View& query, int candidate,
                                                     LoopResult& result) const {
  const Verification& tried = Try(query, candidate, result);
  if (!tried.similar || !tried.inlier_matches.empty()) return tried;
  const auto again = std::find_if(result.tried.begin(), result.tried.end(),
                                  [&](const Verification& v) { return v.candidate == tried.candidate; });
  *again = verify_(query, view_of_(candidate), options_.threads);
  return *again;
}

// The belief in the place of each that was tried, against a new place. What other places have does not count:
// a view that was seen several times has its belief divided, and geometry knows better which of them it is.
void HypothesisSearch::Weigh(const Belief& belief, LoopResult& result) const {
  for (Verification& tried : result.tried) {
    const double mass = MassAround(belief, memory_.Find(tried.candidate), memory_);
    tried.mass = mass > 0 ? mass / (mass + belief.new_place) : 0;
    if (tried.candidate == result.verification.candidate) result.verification.mass = tried.mass;
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

double LoopProbability(const Verification& verification) {
  const double mass = std::clamp(verification.mass, 1e-4, 1.0 - 1e-4);
  const double sure = std::clamp(-verification.log_nfa, 0.0, 300.0) / 100.0;
  const double logit = 3.345 + 1.379 * std::log(mass / (1.0 - mass)) + 0.889 * sure;
  return 1.0 / (1.0 + std::exp(-logit));
}

}  // namespace tutti::internal
