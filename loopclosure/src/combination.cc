#include "tutti/loopclosure/combination.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tutti {

Belief CombineMean(const std::vector<const Belief*>& members, const std::vector<double>& weights) {
  Belief mean;
  if (members.empty()) return mean;
  std::size_t slots = 0;
  for (const Belief* member : members) slots = std::max(slots, member->places.size());
  mean.new_place = 0.0;
  mean.places.assign(slots, 0.0);
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (std::size_t k = 0; k < members.size(); ++k) {
    const Belief& member = *members[k];
    const double share = weights.empty() ? 1.0 / static_cast<double>(members.size()) : weights[k] / sum;
    mean.new_place += share * member.new_place;
    for (std::size_t i = 0; i < member.places.size(); ++i) mean.places[i] += share * member.places[i];
  }
  return mean;
}

double Certainty(const Belief& belief, const std::vector<int>& working_memory) {
  constexpr double kFloor = 0.05;
  const auto entropy = [](double p) { return p > 0 ? -p * std::log(p) : 0.0; };
  double sum = entropy(belief.new_place);
  for (const int slot : working_memory) {
    const std::size_t i = static_cast<std::size_t>(slot);
    if (i < belief.places.size()) sum += entropy(belief.places[i]);
  }
  const double largest = std::log(1.0 + static_cast<double>(working_memory.size()));
  return largest > 0 ? std::clamp(1.0 - sum / largest, kFloor, 1.0) : 1.0;
}

Belief CombineProduct(const std::vector<const Belief*>& members, const std::vector<int>& working_memory) {
  constexpr double kFloor = 1e-9;
  Belief product;
  if (members.empty()) return product;
  std::size_t slots = 0;
  for (const Belief* member : members) slots = std::max(slots, member->places.size());
  product.places.assign(slots, 0.0);
  product.new_place = 1.0;
  for (const Belief* member : members) product.new_place *= std::max(member->new_place, kFloor);
  for (const int slot : working_memory) {
    const std::size_t i = static_cast<std::size_t>(slot);
    double value = 1.0;
    for (const Belief* member : members) {
      value *= std::max(i < member->places.size() ? member->places[i] : 0.0, kFloor);
    }
    product.places[i] = value;
  }
  product.Normalise();
  return product;
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
    const std::vector<std::pair<int, int>> near = memory.Neighbours(best, kAgreementLevels);
    std::vector<const Belief*> group;
    double sum = 0.0;
    for (const Belief* voter : voters) {
      const int vote = voter->Best();
      if (std::any_of(near.begin(), near.end(), [vote](const auto& n) { return n.first == vote; })) {
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
                       const LocationMemory& memory, const std::vector<double>& weights) {
  if (rule == CombinationRule::kMajority) return CombineMajority(members, threshold, memory);
  CombinedBelief result;
  if (members.empty()) return result;
  result.belief = rule == CombinationRule::kProduct ? CombineProduct(members, memory.working_memory())
                                                    : CombineMean(members, weights);
  result.hypothesis = std::clamp(result.belief.Hypothesis(), 0.0, 1.0);
  result.best = result.belief.Best();
  return result;
}

}  // namespace tutti
