#include "loopclosure/geometry/evidence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace tutti::internal {
namespace {

const cv::Size kImage(640, 480);  // diagonal 800

TEST(FitByChance, ExpectsTheShareOfTheImageAroundTheLineBeyondTheSample) {
  const double alpha = 2 * 1.5 * 800 / (640.0 * 480.0);
  EXPECT_NEAR(FitByChance(FitModel::kFundamental, 107, 50, 1.5, kImage).expected, 7 + 100 * alpha, 1e-9);
}

TEST(FitByChance, FalseAlarmsFollowTheFormula) {
  // 4 of 5 matches to a P3P model: 4 (5 - 3) C(5, 4) C(4, 3) alpha.
  const double alpha = 2 * 1.0 * 800 / (640.0 * 480.0);
  EXPECT_NEAR(FitByChance(FitModel::kPnp, 5, 4, 1.0, kImage).log_nfa, std::log10(160 * alpha), 1e-9);
}

TEST(FitByChance, AsManyAsExpectedAreNoSurpriseAndMoreAreASurerOne) {
  EXPECT_GT(FitByChance(FitModel::kFundamental, 100, 8, 1.5, kImage).log_nfa, 0);
  EXPECT_LT(FitByChance(FitModel::kFundamental, 100, 30, 1.5, kImage).log_nfa, -5);
  EXPECT_LT(FitByChance(FitModel::kFundamental, 100, 60, 1.5, kImage).log_nfa,
            FitByChance(FitModel::kFundamental, 100, 30, 1.5, kImage).log_nfa);
}

TEST(FitByChance, WithoutMatchesOrImageThereIsNothing) {
  EXPECT_EQ(FitByChance(FitModel::kEssential, 0, 0, 1.5, kImage).expected, 0);
  EXPECT_EQ(FitByChance(FitModel::kEssential, 50, 20, 1.5, {}).log_nfa, 0);
  EXPECT_EQ(FitByChance(FitModel::kEssential, 5, 5, 1.5, kImage).log_nfa, 0);
}

TEST(OccupiedCells, CountsEachCellOnceAndPixelsOutsideInTheNearest) {
  EXPECT_EQ(OccupiedCells({}, kImage), 0);
  EXPECT_EQ(OccupiedCells({{10, 10}, {70, 70}}, kImage), 1);
  EXPECT_EQ(OccupiedCells({{10, 10}, {90, 10}, {10, 90}}, kImage), 3);
  EXPECT_EQ(OccupiedCells({{10, 10}, {-5, -5}, {639.9f, 479.9f}, {700, 500}}, kImage), 2);
}

TEST(MotionSpread, IsZeroForWhatMovesAsOneAndTheDeviationElsewhere) {
  const std::vector<cv::Point2f> first = {{10, 10}, {100, 10}, {10, 100}, {50, 50}};
  EXPECT_NEAR(MotionSpread(first, {{15, 17}, {105, 17}, {15, 107}, {55, 57}}, kImage), 0, 1e-6);
  EXPECT_NEAR(MotionSpread(first, {{18, 10}, {92, 10}, {18, 100}, {42, 50}}, kImage), 0.01, 1e-6);
}

TEST(NarrowestSpread, PixelsOnALineOrInASpotAreNarrowWhereverTheyLie) {
  const cv::Size image(640, 480);
  std::vector<cv::Point2f> line, spot, wide;
  for (int i = 0; i < 100; ++i) {
    const int row = i / 10;
    const auto x = static_cast<float>(i % 10), y = static_cast<float>(row);
    line.emplace_back(6.4F * static_cast<float>(i), 4.8F * static_cast<float>(i));
    spot.emplace_back(500 + x, 100 + y);
    wide.emplace_back(64 * x, 48 * y);
  }
  EXPECT_NEAR(NarrowestSpread(line, image), 0, 1e-3);
  EXPECT_LT(NarrowestSpread(spot, image), 0.01);
  EXPECT_NEAR(NarrowestSpread(wide, image), 0.287, 1e-3);
  EXPECT_DOUBLE_EQ(NarrowestSpread({}, image), 0);
}

TEST(SpreadNeeded, InliersInAbundanceMayLieCloserTogether) {
  EXPECT_DOUBLE_EQ(SpreadNeeded(0.1, 12, 12), 0.1);
  EXPECT_DOUBLE_EQ(SpreadNeeded(0.1, 12, 18), 0.1);
  EXPECT_NEAR(SpreadNeeded(0.1, 12, 36), 0.0707, 1e-4);
  EXPECT_NEAR(SpreadNeeded(0.1, 12, 1000), 0.06, 1e-12);
}

constexpr float kCellSide = 80;  // of 8 by 6 on an image of 640 by 480 [px]

cv::Point2f MiddleOf(int row, int column) {
  return {(static_cast<float>(column) + 0.5f) * kCellSide, (static_cast<float>(row) + 0.5f) * kCellSide};
}

// With so many features in each cell, of a member, and of the caller.
View Evenly(int of_member, int of_caller) {
  View view;
  view.size = {640, 480};
  view.members.emplace_back();
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 8; ++column) {
      for (int i = 0; i < of_member; ++i) view.members[0].pixels.push_back(MiddleOf(row, column));
      for (int i = 0; i < of_caller; ++i) view.caller.pixels.push_back(MiddleOf(row, column));
    }
  }
  return view;
}

std::vector<VerifiedMatch> MatchIn(int row, int column) {
  return {{MiddleOf(row, column), MiddleOf(row, column), -1, -1}};
}

TEST(StaysAtItsPixel, WithinItsDistanceWhicheverWay) {
  const auto stays = [](float dx, float dy) {
    return StaysAtItsPixel({{100 + dx, 50 + dy}, {100, 50}, -1, -1}, 2.0);
  };
  EXPECT_TRUE(stays(0, 0));
  EXPECT_TRUE(stays(1.9f, 0));
  EXPECT_TRUE(stays(0, -1.9f));
  EXPECT_TRUE(stays(-1.4f, 1.4f));
  EXPECT_FALSE(stays(1.5f, 1.5f));
  EXPECT_FALSE(stays(-2.1f, 0));
  EXPECT_FALSE(stays(0, 2.1f));
}

TEST(ShareApart, IsOfTheFeaturesBeyondTheCellsAroundTheMatches) {
  const View view = Evenly(2, 0);
  EXPECT_DOUBLE_EQ(ShareApart({}, view, view), 1);
  EXPECT_DOUBLE_EQ(ShareApart(MatchIn(2, 3), view, view), 39.0 / 48) << "three by three are near";
  EXPECT_DOUBLE_EQ(ShareApart(MatchIn(0, 0), view, view), 44.0 / 48);
  EXPECT_DOUBLE_EQ(ShareApart(MatchIn(5, 7), view, view), 44.0 / 48);
  EXPECT_DOUBLE_EQ(ShareApart(MatchIn(0, 4), view, view), 42.0 / 48);
  EXPECT_DOUBLE_EQ(ShareApart(MatchIn(3, 7), view, view), 42.0 / 48);
  std::vector<VerifiedMatch> two = MatchIn(0, 0);
  two.push_back(MatchIn(1, 1).front());
  EXPECT_DOUBLE_EQ(ShareApart(two, view, view), 39.0 / 48);
}

// What both images have in a cell counts.
TEST(ShareApart, CountsTheFewerOfTheTwoImagesFeaturesAndTheCallersToo) {
  View query = Evenly(1, 1), candidate = Evenly(3, 0);
  EXPECT_DOUBLE_EQ(ShareApart(MatchIn(2, 3), query, candidate), 39.0 / 48);
  for (int i = 0; i < 10; ++i) query.caller.pixels.push_back(MiddleOf(2, 3));
  EXPECT_DOUBLE_EQ(ShareApart(MatchIn(2, 3), query, candidate), 78.0 / 97) << "three there, two elsewhere";
  candidate.members[0].pixels.clear();
  EXPECT_EQ(ShareApart(MatchIn(2, 3), query, candidate), 0);
  candidate.size = {0, 0};
  EXPECT_EQ(ShareApart(MatchIn(2, 3), query, candidate), 0);
}

}  // namespace
}  // namespace tutti::internal
