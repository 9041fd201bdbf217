// LoopQuery::pose_prior: what the odometry knows of where the camera can be.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include "core/state_archive.h"
#include "loopclosure/filter/pose_track.h"
#include "tests/loopclosure/detector/two_laps.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using internal::ApplyGains;
using internal::PoseTrack;

PosePrior PriorAt(double x, double sigma_m = 2.0, double drift = 0.01) {
  PosePrior prior;
  prior.position_m = {x, 0, 0};
  prior.sigma_m = sigma_m;
  prior.drift = drift;
  return prior;
}

// A corridor of 30 different doors, 1 m apart, but for two that are the same one: 5 and 22. Then the camera
// is brought back and sees that door three times.
constexpr int kDoors = 30, kTwin = 5, kOtherTwin = 22;

LoopResult SeeTheDoorAgain(const std::function<std::optional<PosePrior>(double x)>& prior, double x) {
  LoopDetectorOptions options = testing::SmallOptions();
  options.verification.enabled = false;
  options.link_threshold = 1.0;
  options.keep_posterior = true;
  LoopDetector detector(options);
  LoopResult result;
  for (int i = 0; i < kDoors + 3; ++i) {
    const bool back = i >= kDoors;
    LoopQuery query;
    query.id = i;
    query.image =
        testing::TexturedImage(static_cast<std::uint32_t>(back || i == kOtherTwin ? kTwin : i), 240, 180);
    query.pose_prior = prior(back ? x : i);
    result = detector.Detect(query);
  }
  return result;
}

double PosteriorAt(const LoopResult& result, std::int64_t id) {
  for (const auto& [location, p] : result.posterior_by_location) {
    if (location == id) return p;
  }
  return 0;
}

TEST(PosePrior, OfTwoPlacesThatLookAlikeTheNearerOneWins) {
  const auto prior = [](double x) { return PriorAt(x); };
  EXPECT_EQ(SeeTheDoorAgain(prior, kTwin + 0.5).candidate, kTwin);
  EXPECT_EQ(SeeTheDoorAgain(prior, kOtherTwin - 0.5).candidate, kOtherTwin);
}

TEST(PosePrior, WithAHugeUncertaintyNothingChanges) {
  const LoopResult without = SeeTheDoorAgain([](double) { return std::nullopt; }, 0);
  const LoopResult with = SeeTheDoorAgain([](double x) { return PriorAt(x, 1e6); }, kTwin);
  EXPECT_EQ(with.best, without.best);
  EXPECT_NEAR(with.hypothesis, without.hypothesis, 1e-6);
  for (const std::int64_t door : {kTwin, kOtherTwin})
    EXPECT_NEAR(PosteriorAt(with, door), PosteriorAt(without, door), 1e-6);
}

TEST(PosePrior, PositionsOfAnotherWorldSayNothing) {
  int images = 0;
  const auto lost = [&images](double x) {
    PosePrior prior = PriorAt(x);
    prior.frame = images++ < kDoors ? 0 : 1;
    return prior;
  };
  int others = 0;
  const auto silent = [&others](double x) {
    return others++ < kDoors ? std::optional<PosePrior>(PriorAt(x)) : std::nullopt;
  };
  const LoopResult without = SeeTheDoorAgain(silent, 0);
  const LoopResult with = SeeTheDoorAgain(lost, kTwin);
  EXPECT_EQ(with.hypothesis, without.hypothesis);
  EXPECT_EQ(with.posterior_by_location, without.posterior_by_location);
}

TEST(PoseTrack, GainsAreOneInTheMeanAndBounded) {
  PoseTrack track;
  std::vector<int> places;
  for (int i = 0; i < 200; ++i) {
    track.Add(i, PriorAt(i, 1.0, 0.0));
    places.push_back(i);
  }
  track.Add(200, PriorAt(3, 1.0, 0.0));
  const std::vector<double> gains = track.Gains(places);
  const auto [least, most] = std::minmax_element(gains.begin(), gains.begin() + 200);
  EXPECT_EQ(*most, PoseTrack::kMostGain);
  EXPECT_EQ(most - gains.begin(), 3);
  EXPECT_GT(*least, 0.3);  // the far ones are nearly all there are: they lose little in the mean
  EXPECT_LT(*least, 1.0);
}

TEST(PoseTrack, TheLongerTheWayTheLessItKnows) {
  PoseTrack track;
  track.Add(0, PriorAt(0, 1.0, 0.1));
  track.Add(1, PriorAt(4, 1.0, 0.1));
  const std::vector<double> early = (track.Add(2, PriorAt(0, 1.0, 0.1)), track.Gains({0, 1}));
  track.Add(3, PriorAt(100, 1.0, 0.1));
  const std::vector<double> late = (track.Add(4, PriorAt(0, 1.0, 0.1)), track.Gains({0, 1}));
  EXPECT_GT(early[0] / early[1], 2 * late[0] / late[1]);
  EXPECT_GT(late[0], late[1]);
}

TEST(PoseTrack, APlaceNearByGainsNothingByThatAlone) {
  Belief likelihood;
  likelihood.places = {0.4, 1.0, 3.0, 3.0, 0.4};
  ApplyGains({5, 5, 5, 0.5, 0.5}, {0, 1, 2, 3, 4}, likelihood);
  EXPECT_EQ(likelihood.places, (std::vector<double>{0.4, 1.0, 11.0, 1.5, 0.2}));
}

TEST(PoseTrack, PositionsOfAnotherWorldAreForgotten) {
  PoseTrack track;
  for (int slot = 0; slot < 3; ++slot) track.Add(slot, PriorAt(slot));
  ASSERT_FALSE(track.Gains({0, 1}).empty());
  track.Forget();
  track.Add(3, PriorAt(1000));  // of the new world, in which nothing is known
  EXPECT_TRUE(track.Gains({0, 1, 2}).empty());
  track.Add(4, PriorAt(1001));
  EXPECT_FALSE(track.Gains({0, 1, 2, 3}).empty());
}

// Steps of 3 m along a way; the newest is back at the start. Of the places one has no position, one another
// world's.
TEST(PoseTrack, GainsFollowTheEquation) {
  constexpr double kSigma = 2, kDrift = 0.05;
  PoseTrack track;
  const std::vector<int> places = {0, 1, 2, 3, 4, 5};
  for (const int slot : places) {
    std::optional<PosePrior> prior = PriorAt(3.0 * slot, kSigma, kDrift);
    if (slot == 2) prior.reset();
    if (slot == 4) prior->frame = 7;
    track.Add(slot, prior);
  }
  track.Add(6, PriorAt(12, kSigma, kDrift));
  // The way: 3 m to slot 1, 6 m to 3; what follows the other world begins anew, and slot 6 is 3 m on.
  const std::vector<double> way = {0, 3, 0, 9, 0, 9, 12};
  std::vector<double> expected(7, 1.0);
  double sum = 0;
  const std::vector<int> known = {0, 1, 3, 5};
  for (const int slot : known) {
    const auto i = static_cast<std::size_t>(slot);
    const double off = (12 - 3.0 * slot) / (kSigma + kDrift * (way[6] - way[i]));
    expected[i] = std::exp(std::max(-3.0, -0.5 * off * off));
    sum += expected[i];
  }
  for (const int slot : known) expected[static_cast<std::size_t>(slot)] *= 4 / sum;
  const std::vector<double> gains = track.Gains(places);
  ASSERT_EQ(gains.size(), expected.size());
  for (std::size_t i = 0; i < gains.size(); ++i) EXPECT_NEAR(gains[i], expected[i], 1e-12) << i;

  PoseTrack loaded;
  internal::ReadStateBytes(internal::StateBytes(track), "memory", loaded);
  EXPECT_EQ(loaded.Gains(places), gains);
  for (PoseTrack* both : {&track, &loaded}) both->Add(7, PriorAt(9, kSigma, kDrift));
  EXPECT_EQ(loaded.Gains(places), track.Gains(places));
}

}  // namespace
}  // namespace tutti
