// From a belief to a verified loop: which places to verify, in which order.
#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "core/numbers.h"
#include "loopclosure/geometry/verification.h"
#include "loopclosure/memory/belief.h"
#include "loopclosure/memory/location_memory.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// Step 6 of loop-closure.md section 1: the top few hypotheses and their neighbours, not only the best.
class HypothesisSearch {
 public:
  /// Verifies a pair of views, query and candidate, on so many threads.
  using VerifyPair = std::function<Verification(const View&, const View&, int)>;

  HypothesisSearch(const LoopDetectorOptions& options, const LocationMemory& memory, VerifyPair verify,
                   std::function<const View&(int)> view_of)
      : options_(options), memory_(memory), verify_(std::move(verify)), view_of_(std::move(view_of)) {}

  /// Fills verification, tried, accepted and reason of `result`.
  void Verify(const View& query, const Belief& belief, LoopResult& result) const;
  /// Does so for the location `query`, with a belief that came later: adds what was not tried before.
  void VerifyMore(int query, const Belief& belief, LoopResult& result) const;
  /// Only the probability of what was chosen, with a belief that came later.
  void Reconsider(const Belief& belief, LoopResult& result) const;
  /// This verification of the location `query`, with its matches.
  Verification WithMatches(int query, const Verification& verification) const;

 private:
  std::vector<int> TopPlaces(const Belief& belief) const;
  std::vector<int> ViewsOf(int place, const Belief& belief) const;
  const Verification* Tried(int slot, const LoopResult& result) const;
  Verification Look(const View& query, int candidate, int threads) const;
  const Verification& Try(const View& query, int candidate, LoopResult& result) const;
  static void Take(Verification verification, LoopResult& result);
  void Decide(const View& query, const Belief& belief, LoopResult& result) const;
  void Weigh(const Belief& belief, LoopResult& result) const;
  static std::pair<const Verification*, double> MostProbable(const LoopResult& result);
  const Verification& TryWithMatches(const View& query, int candidate, LoopResult& result) const;

  const LoopDetectorOptions& options_;
  const LocationMemory& memory_;
  VerifyPair verify_;
  std::function<const View&(int)> view_of_;
};

/// Graph levels within which locations are about one place.
inline constexpr int kAboutHere = 4;

/// Belief in all places about a slot, 0..1.
double MassAround(const Belief& belief, int slot, const LocationMemory& memory);

/// 0 for a place that the belief does not reach.
inline double PosteriorAt(const Belief& belief, int slot) {
  const std::size_t i = Index(slot);
  return i < belief.places.size() ? belief.places[i] : 0.0;
}

/// Probability that the image shows the place that geometry has looked at, by logistic regression on
///   logit of Verification::mass, the posterior around the place against a new place,
///   -log_nfa, 0 to 300: how little chance explains the inliers; more of it says no more.
/// The inliers' share of the matches, spread of the motion, coverage of the image, the inliers as a share of
/// those with the image before, and how many images before and after agree were in the regression, too, and
/// add nothing to these two. Its three numbers come from bench/fit_loop_probability: of loops whose motion
/// geometry knows, by the detector before this fit, in synthetic worlds and changes of real images with seeds
/// that no table is measured on, and in the unchanged real images, which tables show, too
/// (docs/loop-closure.md section 5).
double LoopProbability(const Verification& verification);

/// Verifies the query with the location in a slot; a slot may be asked for again.
using LookAtSlot = std::function<const Verification&(int)>;

/// From `start`, the slot of an accepted view, along the stored path to the view that is nearest to the query
/// (docs/loop-closure.md section 5), mostly by three or four looks: two views of the path tell how far off
/// the nearest is. `start` where nothing nearer is found.
int FindNearestView(const View& query, int start, const LocationMemory& memory,
                    const std::function<const View&(int)>& view_of, const LookAtSlot& look);

}  // namespace tutti::internal
