// The rules that make one belief of the members' beliefs.
#pragma once

#include <vector>

#include "tutti/loopclosure/belief.h"
#include "tutti/loopclosure/detector_options.h"
#include "tutti/loopclosure/location_memory.h"

namespace tutti {

/// What the ensemble believes.
struct CombinedBelief {
  double hypothesis = 0;  ///< H
  int best = -1;          ///< slot, -1 if none
  Belief belief;          ///< what ranks the candidates
};

/// Mean rule: Ens(L) = 1/d sum_i p((S^i)_t | (L^i)^t) over the d members that took part, virtual place
/// included (loop-closure.md eq. 2; the paper's choice). With weights, one above 0 for each member, the
/// weighted mean.
Belief CombineMean(const std::vector<const Belief*>& members, const std::vector<double>& weights = {});

/// How little a belief is spread: 1 minus its entropy as a share of the largest one possible over the new
/// place and `working_memory`; from 0.05 to 1.
double Certainty(const Belief& belief, const std::vector<int>& working_memory);

/// Product rule: p(i) ~ prod_k max(p_k(i), 1e-9), virtual place included, renormalised (section 4).
Belief CombineProduct(const std::vector<const Belief*>& members, const std::vector<int>& working_memory);

/// Majority vote (section 4): each member with H >= threshold votes for its best location; votes within two
/// graph levels agree; H = share of agreeing members x their mean H, 0 below two votes.
CombinedBelief CombineMajority(const std::vector<const Belief*>& members, double threshold,
                               const LocationMemory& memory);

/// One call for every rule. kNaive and kSingle have a single belief, which is the result. `members` holds
/// those that took part; none: H = 0. `weights`: of the mean, none for equal ones.
CombinedBelief Combine(CombinationRule rule, const std::vector<const Belief*>& members, double threshold,
                       const LocationMemory& memory, const std::vector<double>& weights = {});

}  // namespace tutti
