#include "loopclosure/filter/bayes_filter.h"

#include <gtest/gtest.h>

namespace tutti {
namespace {

class BayesFilterTest : public ::testing::Test {
 protected:
  void Grow(int n) {
    for (int i = 0; i < n; ++i) {
      memory_.Add(memory_.size());
      model_.Update(memory_, memory_.Settle());
    }
  }
  Belief Ones() const {
    Belief likelihood;
    likelihood.new_place = 1.0;
    likelihood.places.assign(static_cast<std::size_t>(memory_.size()), 1.0);
    return likelihood;
  }
  LocationMemory memory_{1};
  TransitionModel model_;
  BayesFilter filter_;
};

TEST_F(BayesFilterTest, BelievesInANewPlaceBeforeTheFirstStep) {
  EXPECT_EQ(filter_.posterior().new_place, 1.0);
  EXPECT_EQ(filter_.posterior().Hypothesis(), 0.0);
  EXPECT_EQ(filter_.posterior().Best(), -1);
}

TEST_F(BayesFilterTest, FirstStepStartsUniform) {
  Grow(10);  // nine in WM, and the virtual place
  filter_.Step(model_, memory_.working_memory(), Ones());
  EXPECT_NEAR(filter_.posterior().new_place, 0.9 * 0.1 + 0.1 * 0.9, 1e-12);
  EXPECT_NEAR(filter_.posterior().Hypothesis(), 0.82, 1e-12);
}

TEST_F(BayesFilterTest, PosteriorSumsToOneAndFollowsTheLikelihood) {
  Grow(20);
  Belief likelihood = Ones();
  likelihood.places[7] = 5.0;
  for (int i = 0; i < 4; ++i) filter_.Step(model_, memory_.working_memory(), likelihood);
  double sum = filter_.posterior().new_place;
  for (const double p : filter_.posterior().places) sum += p;
  EXPECT_NEAR(sum, 1.0, 1e-12);
  EXPECT_EQ(filter_.posterior().Best(), 7);
}

TEST_F(BayesFilterTest, ALocationThatIsNewInWorkingMemoryEntersWithNothing) {
  Grow(10);
  Belief likelihood = Ones();
  likelihood.new_place = 1e9;  // drives everything to the virtual place
  filter_.Step(model_, memory_.working_memory(), likelihood);
  const double before = filter_.posterior().new_place;
  Grow(1);
  filter_.Step(model_, memory_.working_memory(), Ones());
  // What it has now came through the transition alone.
  EXPECT_NEAR(filter_.posterior().places[9], 0.1 / 10 * before, 1e-6);
}

TEST_F(BayesFilterTest, WorksWithoutAnyLocation) {
  filter_.Step(model_, {}, Belief());
  EXPECT_EQ(filter_.posterior().new_place, 1.0);
  EXPECT_EQ(filter_.posterior().Hypothesis(), 0.0);
}

TEST(Belief, TiesGoToTheNewestLocation) {
  Belief belief;
  belief.places = {0.2, 0.4, 0.4, 0.0};
  EXPECT_EQ(belief.Best(), 2);
}

}  // namespace
}  // namespace tutti
