#include <cmath>
#include <cstdio>

#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

std::string Range(const Trajectory& trajectory) {
  char text[96];
  std::snprintf(text, sizeof text, "%.3f .. %.3f s", trajectory.front().stamp_s, trajectory.back().stamp_s);
  return text;
}

/// Position of the nearest time stamp; the first of two that are equally near.
std::size_t Nearest(const Trajectory& sorted, double stamp_s) {
  std::size_t low = 0, high = sorted.size();
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    sorted[middle].stamp_s < stamp_s ? low = middle + 1 : high = middle;
  }
  if (low == sorted.size()) return low - 1;
  if (low > 0 && stamp_s - sorted[low - 1].stamp_s <= sorted[low].stamp_s - stamp_s) return low - 1;
  return low;
}

void RequirePoses(const Trajectory& reference, const Trajectory& estimate) {
  if (reference.empty()) throw InputError("evaluation: the reference holds no pose");
  if (estimate.empty()) throw InputError("evaluation: the estimate holds no pose");
}

void Add(AssociatedPoses& out, const Trajectory& reference, const Trajectory& estimate, std::size_t r,
         std::size_t e) {
  out.indices.emplace_back(r, e);
  out.stamps_s.push_back(estimate[e].stamp_s);
  out.reference.push_back(reference[r].pose);
  out.estimate.push_back(estimate[e].pose);
}

}  // namespace

AssociatedPoses AssociateByTime(const Trajectory& reference, const Trajectory& estimate,
                                double max_difference_s) {
  RequirePoses(reference, estimate);
  const bool estimate_is_longer = estimate.size() > reference.size();
  // Loop over the shorter (the estimate, if they are equally long: evo loops over its second trajectory
  // then).
  const Trajectory& shorter = estimate_is_longer ? reference : estimate;
  const Trajectory& longer = estimate_is_longer ? estimate : reference;
  AssociatedPoses out;
  for (std::size_t s = 0; s < shorter.size(); ++s) {
    const std::size_t l = Nearest(longer, shorter[s].stamp_s);
    if (std::abs(longer[l].stamp_s - shorter[s].stamp_s) > max_difference_s) continue;
    estimate_is_longer ? Add(out, reference, estimate, s, l) : Add(out, reference, estimate, l, s);
  }
  if (out.indices.empty()) {
    char limit[32];
    std::snprintf(limit, sizeof limit, "%g", max_difference_s);
    throw InputError("evaluation: no two poses are within " + std::string(limit) +
                     " s of each other: the reference spans " + Range(reference) + ", the estimate " +
                     Range(estimate) + "; check that the files belong together and use the same clock");
  }
  return out;
}

AssociatedPoses AssociateByIndex(const Trajectory& reference, const Trajectory& estimate) {
  RequirePoses(reference, estimate);
  if (reference.size() != estimate.size()) {
    throw InputError("evaluation: the reference has " + std::to_string(reference.size()) +
                     " poses and the estimate " + std::to_string(estimate.size()) +
                     "; poses without time stamps are paired line by line and the counts must agree");
  }
  AssociatedPoses out;
  for (std::size_t k = 0; k < reference.size(); ++k) Add(out, reference, estimate, k, k);
  return out;
}

}  // namespace tutti
