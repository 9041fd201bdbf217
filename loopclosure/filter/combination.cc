#include "loopclosure/filter/combination.h"

#include <algorithm>
#include <cmath>

#include "core/numbers.h"

namespace tutti {

namespace {

std::size_t SlotsOf(const std::vector<const Belief*>& members) {
  std::size_t slots = 0;
  for (const Belief* member : members) slots = std::max(slots, member->places.size());
  return slots;
}

// prod_k max(p_k, 1e-9)^exponent, renormalised.
Belief PowerProduct(const std::vector<const Belief*>& members, const std::vector<int>& working_memory,
                    double exponent) {
  constexpr double kFloor = 1e-9;
  Belief product;
  if (members.empty()) return product;
  product.places.assign(SlotsOf(members), 0.0);
  const auto power = [exponent](double value) { return exponent == 1.0 ? value : std::pow(value, exponent); };
  product.new_place = 1.0;
  for (const Belief* member : members) product.new_place *= power(std::max(member->new_place, kFloor));
  for (const int slot : working_memory) {
    const std::size_t i = internal::Index(slot);
    double value = 1.0;
    for (const Belief* member : members) {
      value *= power(std::max(i < member->places.size() ? member->places[i] : 0.0, kFloor));
    }
    product.places[i] = value;
  }
  product.Normalise();
  return product;
}

}  // namespace

Belief CombineMean(const std::vector<const Belief*>& members) {
  Belief mean;
  if (members.empty()) return mean;
  mean.new_place = 0.0;
  mean.places.assign(SlotsOf(members), 0.0);
  const double share = 1.0 / static_cast<double>(members.size());
  for (const Belief* member : members) {
    mean.new_place += share * member->new_place;
    for (std::size_t i = 0; i < member->places.size(); ++i) mean.places[i] += share * member->places[i];
  }
  return mean;
}

Belief CombineProduct(const std::vector<const Belief*>& members, const std::vector<int>& working_memory) {
  return PowerProduct(members, working_memory, 1.0);
}

Belief CombineLogPool(const std::vector<const Belief*>& members, const std::vector<int>& working_memory) {
  return PowerProduct(members, working_memory,
                      1.0 / static_cast<double>(std::max<std::size_t>(1, members.size())));
}

CombinedBelief CombineMajority(const std::vector<const Belief*>& members, double threshold,
                               const LocationMemory& memory) {
  constexpr int kAgreementLevels = 2;
  CombinedBelief result;
  std::vector<const Belief*> voters;
  for (const Belief* member : members) {
    if (member->Hypothesis() >= threshold && member->Best() >= 0) voters.push_back(member);
  }
  // The largest group around one voter's choice wins; of equal ones that with the larger mean H, then the
  // first member's.
  for (const Belief* centre : voters) {
    const int best = centre->Best();
    const std::vector<LocationMemory::Neighbour> near = memory.Neighbours(best, kAgreementLevels);
    std::vector<const Belief*> group;
    double sum = 0.0;
    for (const Belief* voter : voters) {
      const int vote = voter->Best();
      if (std::any_of(near.begin(), near.end(), [vote](const auto& n) { return n.slot == vote; })) {
        group.push_back(voter);
        sum += voter->Hypothesis();
      }
    }
    if (group.size() < 2) continue;
    const double hypothesis = sum / static_cast<double>(members.size());  // share x mean H
    if (hypothesis > result.hypothesis) {
      result.hypothesis = hypothesis;
      result.best = best;
      result.belief = CombineMean(group);
    }
  }
  if (result.best < 0) {
    result.belief = CombineMean(members);
    result.best = result.belief.Best();
  }
  return result;
}

CombinedBelief Combine(CombinationRule rule, const std::vector<const Belief*>& members, double threshold,
                       const LocationMemory& memory) {
  if (rule == CombinationRule::kMajority) return CombineMajority(members, threshold, memory);
  CombinedBelief result;
  if (members.empty()) return result;
  const std::vector<int>& places = memory.working_memory();
  result.belief = rule == CombinationRule::kProduct   ? CombineProduct(members, places)
                  : rule == CombinationRule::kLogPool ? CombineLogPool(members, places)
                                                      : CombineMean(members);
  result.hypothesis = std::clamp(result.belief.Hypothesis(), 0.0, 1.0);
  result.best = result.belief.Best();
  return result;
}

}  // namespace tutti
