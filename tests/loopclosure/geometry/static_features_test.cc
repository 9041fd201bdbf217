// What of two images does not move with the camera.
#include "loopclosure/geometry/evidence.h"

#include <gtest/gtest.h>

#include <vector>

namespace tutti::internal {
namespace {

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

// Of a cell counts what both images have there.
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
