// The rules that make one belief of the members' beliefs.
#pragma once

#include <vector>

#include "loopclosure/memory/belief.h"
#include "loopclosure/memory/location_memory.h"
#include "tutti/loopclosure/detector_options.h"

namespace tutti {

/// What the ensemble believes.
struct CombinedBelief {
  double hypothesis = 0;  ///< H
  int best = -1;          ///< slot, -1 if none
  Belief belief;          ///< what ranks the candidates
};

/// Mean rule: Ens(L) = 1/d sum_i p((S^i)_t | (L^i)^t) over the d members that took part, virtual place
/// included (loop-closure.md eq. 2; the paper's choice).
Belief CombineMean(const std::vector<const Belief*>& members);

/// Product rule: p(i) ~ prod_k max(p_k(i), 1e-9), virtual place included, renormalised (section 4).
Belief CombineProduct(const std::vector<const Belief*>& members, const std::vector<int>& working_memory);

/// Logarithmic opinion pool (Genest & Zidek 1986): p(i) ~ prod_k max(p_k(i), 1e-9)^(1/d) over the d members
/// that took part, virtual place included, renormalised. Unlike the product it does not count the members as
/// independent.
Belief CombineLogPool(const std::vector<const Belief*>& members, const std::vector<int>& working_memory);

/// Majority vote (section 4): each member with H >= threshold votes for its best location; votes within two
/// graph levels agree; H = share of agreeing members x their mean H, 0 below two votes.
CombinedBelief CombineMajority(const std::vector<const Belief*>& members, double threshold,
                               const LocationMemory& memory);

/// One call for every rule. kJoint, kNaive and kSingle have a single belief, which is the result. `members`
/// holds those that took part; none: H = 0. `threshold`: of a vote.
CombinedBelief Combine(CombinationRule rule, const std::vector<const Belief*>& members, double threshold,
                       const LocationMemory& memory);

}  // namespace tutti
