#include "loopclosure/detector/hypothesis_search.h"

#include <gtest/gtest.h>

namespace tutti::internal {
namespace {

Verification Seen(double mass, double log_nfa) {
  Verification verification;
  verification.mass = mass;
  verification.log_nfa = log_nfa;
  return verification;
}

TEST(LoopProbability, GrowsWithBeliefAndWithWhatChanceCannotExplain) {
  EXPECT_LT(LoopProbability(Seen(0.2, -50)), LoopProbability(Seen(0.9, -50)));
  EXPECT_LT(LoopProbability(Seen(0.5, -10)), LoopProbability(Seen(0.5, -100)));
}

TEST(LoopProbability, NeedsBeliefAndGeometry) {
  const double threshold = LoopDetectorOptions().loop_threshold;
  EXPECT_GT(LoopProbability(Seen(0.95, -80)), threshold);
  EXPECT_LT(LoopProbability(Seen(0.5, 0)), threshold);     // sure of the place, and nothing to see of it
  EXPECT_LT(LoopProbability(Seen(0.01, -80)), threshold);  // a poster that hangs somewhere else, too
}

TEST(LoopProbability, IsAProbabilityForAnyInput) {
  for (const double mass : {0.0, 1.0}) {
    for (const double nfa : {-1e6, 0.0, 50.0}) {
      const double p = LoopProbability(Seen(mass, nfa));
      EXPECT_GT(p, 0.0);
      EXPECT_LT(p, 1.0 + 1e-12);
    }
  }
}

}  // namespace
}  // namespace tutti::internal
