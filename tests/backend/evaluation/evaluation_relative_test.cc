// Which poses are compared with each other, on steps of any length.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "tutti/backend/evaluation.h"

namespace tutti {
namespace {

using PosePairs = std::vector<std::pair<std::size_t, std::size_t>>;

// A way of uneven steps and turns to the left, at uneven times.
class UnevenSteps : public ::testing::Test {
 protected:
  UnevenSteps() {
    std::mt19937 random(8);
    const auto between = [&random](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    double x = 0, heading = 0, stamp = 50;
    for (int k = 0; k < 60; ++k) {
      poses_.push_back(Pose(ExpSO3({0, 0, heading * M_PI / 180}), {x, 0, 0}));
      stamps_.push_back(stamp);
      path_.push_back(x);
      headings_.push_back(heading);
      x += between(0.1, 1.5);
      heading += between(0, 3);  // less than half a turn together
      stamp += between(0.05, 0.4);
    }
  }

  PosePairs PairsOf(DeltaUnit unit, double delta, bool all) {
    options_.rpe_unit = unit;
    options_.rpe_delta = delta;
    options_.rpe_all_pairs = all;
    return RelativePairs(poses_, stamps_, options_);
  }

  EvaluationOptions options_;
  std::vector<Pose> poses_;
  std::vector<double> stamps_, path_, headings_;
};

// Of each start the end that is nearest to as far as asked for, unless that is off by more than the
// tolerance.
PosePairs NearestEnds(const std::vector<double>& measure, double delta, double tolerance) {
  PosePairs pairs;
  for (std::size_t i = 0; i + 1 < measure.size(); ++i) {
    const auto off = [&](std::size_t j) { return std::abs(measure[j] - measure[i] - delta); };
    std::size_t best = i + 1;
    for (std::size_t j = i + 1; j < measure.size(); ++j) best = off(j) < off(best) ? j : best;
    if (off(best) <= tolerance * delta) pairs.emplace_back(i, best);
  }
  return pairs;
}

// Ends follow each other: a piece ends where it is as long as asked for.
PosePairs Pieces(const std::vector<double>& measure, double delta, std::size_t first) {
  PosePairs pairs;
  for (std::size_t from = first, to = first + 1; to < measure.size(); ++to) {
    if (measure[to] - measure[from] < delta) continue;
    pairs.emplace_back(from, to);
    from = to;
  }
  return pairs;
}

TEST_F(UnevenSteps, AllPairsAreOfTheNearestEndsWithinTheTolerance) {
  for (const double tolerance : {0.03, 0.1}) {
    options_.rpe_tolerance = tolerance;
    for (const double delta : {1.0, 3.0, 5.0}) {
      EXPECT_EQ(PairsOf(DeltaUnit::kMetres, delta, true), NearestEnds(path_, delta, tolerance)) << delta;
      EXPECT_EQ(PairsOf(DeltaUnit::kSeconds, delta, true), NearestEnds(stamps_, delta, tolerance)) << delta;
    }
  }
}

TEST_F(UnevenSteps, PiecesFollowEachOther) {
  const PosePairs metres = PairsOf(DeltaUnit::kMetres, 4, false);
  ASSERT_GT(metres.size(), 5u);
  EXPECT_EQ(metres, Pieces(path_, 4, metres.front().first));
  EXPECT_EQ(metres.front().first, Pieces(path_, 4, 0).front().second) << "as evo: from the first cut on";
  EXPECT_EQ(PairsOf(DeltaUnit::kSeconds, 1, false), Pieces(stamps_, 1, 0));
  EXPECT_EQ(PairsOf(DeltaUnit::kDegrees, 10, false), Pieces(headings_, 10, 0));
  EXPECT_EQ(PairsOf(DeltaUnit::kRadians, 10 * M_PI / 180, false), Pieces(headings_, 10, 0));
}

TEST_F(UnevenSteps, AllPairsThatTurnAsFarCount) {
  options_.rpe_tolerance = 0.1;
  PosePairs expected;
  for (std::size_t i = 0; i < headings_.size(); ++i) {
    for (std::size_t j = i + 1; j < headings_.size(); ++j) {
      if (std::abs(headings_[j] - headings_[i] - 20) <= 2) expected.emplace_back(i, j);
    }
  }
  EXPECT_GT(expected.size(), 40u);
  EXPECT_EQ(PairsOf(DeltaUnit::kDegrees, 20, true), expected);
  EXPECT_EQ(PairsOf(DeltaUnit::kRadians, 20 * M_PI / 180, true), expected);
}

TEST_F(UnevenSteps, FramesAreCountedFromTheFirst) {
  const PosePairs pieces = PairsOf(DeltaUnit::kFrames, 7, false), all = PairsOf(DeltaUnit::kFrames, 7, true);
  ASSERT_EQ(pieces.size(), 8u);
  ASSERT_EQ(all.size(), 53u);
  for (std::size_t k = 0; k < all.size(); ++k) EXPECT_EQ(all[k], std::make_pair(k, k + 7));
  for (std::size_t k = 0; k < pieces.size(); ++k) EXPECT_EQ(pieces[k], std::make_pair(7 * k, 7 * k + 7));
}

// Starts are `step` apart, and every length that fits counts: 0.02 degrees a metre turn as far as that.
TEST(EvaluateSegments, OfAKnownTurnAndStretch) {
  std::vector<PoseMatrix> reference, estimate;
  for (int k = 0; k <= 200; ++k) {
    reference.push_back({Eigen::Matrix3d::Identity(), {1.0 * k, 0, 0}});
    estimate.push_back({ExpSO3({0, 0, 0.02 * M_PI / 180 * k}).toRotationMatrix(), {1.0 * k, 0, 0}});
  }
  const SegmentErrors errors = EvaluateSegments(reference, estimate, {10, 50}, 4);
  EXPECT_EQ(errors.segments, 48u + 38u) << "0, 4 ... 188, and 0 ... 148";
  // A segment ends at the first pose beyond its length, a metre further.
  EXPECT_NEAR(errors.rotation_deg_per_m, 0.02 * (48 * 11.0 / 10 + 38 * 51.0 / 50) / 86, 1e-6);
}

// Of a path of 100 m: those of 10, 20, 30, 40 and 50 m, from each pose on, that end a metre further.
TEST(EvaluateDrift, IsOfTheTenthsOfThePathUpToItsHalf) {
  std::vector<PoseMatrix> reference, estimate;
  for (int k = 0; k <= 100; ++k) {
    reference.push_back({Eigen::Matrix3d::Identity(), {1.0 * k, 0, 0}});
    estimate.push_back({Eigen::Matrix3d::Identity(), {1.1 * k, 0, 0}});
  }
  std::size_t segments = 0;
  double percent = 0;
  for (const std::size_t length : {10u, 20u, 30u, 40u, 50u}) {
    const std::size_t starts = 100 - length;
    segments += starts;
    percent +=
        static_cast<double>(starts) * 10 * static_cast<double>(length + 1) / static_cast<double>(length);
  }
  const SegmentErrors drift = EvaluateDrift(reference, estimate);
  EXPECT_EQ(drift.segments, segments);
  EXPECT_NEAR(drift.translation_percent, percent / static_cast<double>(segments), 1e-9);
  EXPECT_EQ(EvaluateDrift({reference[0]}, {estimate[0]}).segments, 0u);
}

}  // namespace
}  // namespace tutti
