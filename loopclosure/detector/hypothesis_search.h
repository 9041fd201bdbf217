// From a belief to a verified loop: which places to verify, in which order.
#pragma once

#include <functional>
#include <utility>
#include <vector>

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
  /// The same of the location `query`, with a belief that came later: adds what was not tried before.
  void VerifyMore(int query, const Belief& belief, LoopResult& result) const;
  /// Only the probability of what was chosen, with a belief that came later.
  void Reconsider(const Belief& belief, LoopResult& result) const;
  /// The same verification of the location `query`, with its matches.
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
  const std::size_t i = static_cast<std::size_t>(slot);
  return i < belief.places.size() ? belief.places[i] : 0.0;
}

}  // namespace tutti::internal
