#include "loop_probability.h"

#include <algorithm>
#include <cmath>

namespace tutti::internal {

double LoopProbability(const Verification& verification) {
  const double p = std::clamp(verification.mass, 1e-4, 1.0 - 1e-4);
  const double logit = std::log(p / (1.0 - p)) + 2.0 * std::log((verification.coverage + 1) / 12.0) + 2.0;
  return 1.0 / (1.0 + std::exp(-logit));
}

}  // namespace tutti::internal
