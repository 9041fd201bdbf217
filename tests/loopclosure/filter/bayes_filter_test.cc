#include "loopclosure/filter/bayes_filter.h"

#include <gtest/gtest.h>

#include <functional>
#include <random>
#include <vector>

#include "tutti/core/error.h"

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

namespace tutti::internal {
namespace {

constexpr int kChain = 4;
constexpr int kSteps = Hindsight::kImages + 1;
constexpr double kToStayNew = 0.9;

// A chain of kChain locations, and as many images with random likelihoods as one waits for, and one before.
class HindsightTest : public ::testing::Test {
 protected:
  HindsightTest() : memory_(1) {
    for (int i = 0; i <= kChain; ++i) {
      memory_.Add(i);
      transition_.Update(memory_, memory_.Settle());
    }
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform(0.2, 3.0);
    for (int s = 0; s < kSteps; ++s) {
      Belief likelihood;
      likelihood.new_place = 1.0;
      for (int i = 0; i < kChain; ++i) likelihood.places.push_back(uniform(random));
      likelihoods_.push_back(likelihood);
    }
  }

  void Run(int steps, Hindsight* hindsight) {
    BayesFilter filter;
    for (int s = 0; s < steps; ++s) {
      const Belief& likelihood = likelihoods_[static_cast<std::size_t>(s)];
      filter.Step(transition_, memory_.working_memory(), likelihood);
      hindsight->Add(s, filter.posterior(), likelihood);
    }
    filtered_ = filter.posterior();
  }

  // p(to | from), -1: a new place.
  double Transition(int from, int to) const {
    if (from < 0) return to < 0 ? kToStayNew : (1 - kToStayNew) / kChain;
    if (to < 0) return TransitionModel::kToNewPlace;
    for (const auto& [slot, value] : transition_.Column(from)) {
      if (slot == to) return value;
    }
    return 0.0;
  }

  // The probability of each place at the first image, by all paths through the images: what smoothing has to
  // come to.
  std::vector<double> ByAllPaths() const {
    std::vector<double> first(kChain + 1, 0.0);  // the new place last
    const auto weight = [&](int s, int place) {
      const Belief& l = likelihoods_[static_cast<std::size_t>(s)];
      return place < 0 ? l.new_place : l.places[static_cast<std::size_t>(place)];
    };
    const std::function<double(int, int)> rest = [&](int s, int place) -> double {
      if (s + 1 == kSteps) return 1.0;
      double sum = 0;
      for (int next = -1; next < kChain; ++next)
        sum += Transition(place, next) * weight(s + 1, next) * rest(s + 1, next);
      return sum;
    };
    double all = 0;
    for (int place = -1; place < kChain; ++place) {
      double prior = 0;  // the filter starts from all as likely
      for (int before = -1; before < kChain; ++before) prior += Transition(before, place) / (kChain + 1);
      const double p = prior * weight(0, place) * rest(0, place);
      first[static_cast<std::size_t>(place < 0 ? kChain : place)] = p;
      all += p;
    }
    for (double& p : first) p /= all;
    return first;
  }

  TransitionModel transition_;
  LocationMemory memory_;
  std::vector<Belief> likelihoods_;
  Belief filtered_;
};

TEST_F(HindsightTest, WeighsAllPathsThroughTheImagesSince) {
  Hindsight hindsight;
  Run(kSteps, &hindsight);
  ASSERT_EQ(hindsight.Slot(), 0);
  const Belief smoothed = hindsight.Smoothed(transition_, memory_.working_memory());
  const std::vector<double> truth = ByAllPaths();
  for (int i = 0; i < kChain; ++i) {
    const std::size_t at = static_cast<std::size_t>(i);
    EXPECT_NEAR(smoothed.places[at], truth[at], 1e-12) << i;
  }
  EXPECT_NEAR(smoothed.new_place, truth.back(), 1e-12);
}

TEST_F(HindsightTest, APlaceThatTheNextImagesAreNotNearIsTakenBack) {
  for (int s = 0; s < kSteps; ++s) {
    likelihoods_[static_cast<std::size_t>(s)].places.assign(kChain, 0.1);
  }
  likelihoods_[0].places[2] = 8.0;
  Hindsight hindsight;
  Run(1, &hindsight);
  const double at_first = filtered_.places[2];
  EXPECT_GT(at_first, 0.75);
  Hindsight later;
  Run(kSteps, &later);
  EXPECT_LT(later.Smoothed(transition_, memory_.working_memory()).places[2], 0.7 * at_first);
}

TEST_F(HindsightTest, NothingIsSaidBeforeEnoughImagesCame) {
  Hindsight hindsight;
  Run(kSteps - 1, &hindsight);
  EXPECT_EQ(hindsight.Slot(), -1);
}

TEST_F(HindsightTest, GoesOnFromAFileAsIfNothingHadHappened) {
  Hindsight hindsight;
  Run(kSteps, &hindsight);
  Hindsight loaded;
  ReadStateBytes(StateBytes(hindsight), "test", loaded);
  const std::vector<int>& places = memory_.working_memory();
  EXPECT_EQ(loaded.Smoothed(transition_, places).places, hindsight.Smoothed(transition_, places).places);
  SharedObjectsIn none;
  const StateReader in("", "test", &none);
  EXPECT_NO_THROW(loaded.Check(kSteps, in));
  EXPECT_THROW(loaded.Check(kSteps - 1, in), InputError) << "a step at a location that is not there";
}

}  // namespace
}  // namespace tutti::internal
