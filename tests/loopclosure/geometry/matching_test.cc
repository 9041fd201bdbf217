#include "loopclosure/geometry/matching.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <vector>

namespace tutti {
namespace {

constexpr double kRatio = 0.8;

// Descriptors of one value each.
cv::Mat ValuesOf(const std::vector<float>& values) { return cv::Mat(values, true); }

// Places far from each other.
std::vector<cv::Point2f> FarApart(int count) {
  std::vector<cv::Point2f> points;
  points.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) points.emplace_back(10.0f * static_cast<float>(i), 0.0f);
  return points;
}

TEST(MatchDescriptors, TheRatioIsOfTheDistancesToTheNearestTwo) {
  const std::vector<Match> matches =
      MatchDescriptors(ValuesOf({10}), ValuesOf({40, 13, 5}), FarApart(3), kRatio);  // 30, 3 and 5 away
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0].query, 0);
  EXPECT_EQ(matches[0].candidate, 1);
  EXPECT_NEAR(matches[0].ratio, 0.6, 1e-6);
  EXPECT_EQ(MatchDescriptors(ValuesOf({10}), ValuesOf({13.9f, 5}), FarApart(2), kRatio).size(), 1u);
  EXPECT_EQ(MatchDescriptors(ValuesOf({10}), ValuesOf({14.1f, 5}), FarApart(2), kRatio).size(), 0u);
}

TEST(MatchDescriptors, TheSecondNearestIsOfAnotherPlace) {
  const cv::Mat query = ValuesOf({10}), candidate = ValuesOf({11, 11, 20});
  EXPECT_EQ(MatchDescriptors(query, candidate, {{0, 0}, {2.4f, 3.1f}, {50, 0}}, kRatio).size(), 1u);
  EXPECT_EQ(MatchDescriptors(query, candidate, {{0, 0}, {2.5f, 3.2f}, {50, 0}}, kRatio).size(), 0u);
  // Without another place there is nothing to mistake it for.
  EXPECT_EQ(MatchDescriptors(query, ValuesOf({11}), FarApart(1), kRatio).at(0).ratio, 0);
}

TEST(MatchDescriptors, AreEachOthersNearest) {
  // Both of the query are nearest to the first candidate, which is nearest to the second of them.
  const std::vector<Match> matches =
      MatchDescriptors(ValuesOf({10, 11, 100}), ValuesOf({11.2f, 99}), FarApart(2), kRatio);
  ASSERT_EQ(matches.size(), 2u);
  EXPECT_EQ(matches[0].query, 1);
  EXPECT_EQ(matches[0].candidate, 0);
  EXPECT_EQ(matches[1].query, 2);
  EXPECT_EQ(matches[1].candidate, 1);
}

TEST(MatchDescriptors, OfAnotherTypeOrWidthOrWithoutPlacesAreNone) {
  const cv::Mat query = ValuesOf({10}), candidate = ValuesOf({11, 50});
  EXPECT_TRUE(MatchDescriptors(query, cv::Mat::zeros(2, 1, CV_8U), FarApart(2), kRatio).empty());
  EXPECT_TRUE(MatchDescriptors(query, cv::Mat::zeros(2, 2, CV_32F), FarApart(2), kRatio).empty());
  EXPECT_TRUE(MatchDescriptors(query, candidate, FarApart(1), kRatio).empty());
  EXPECT_TRUE(MatchDescriptors(cv::Mat(), candidate, FarApart(2), kRatio).empty());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(MatchDescriptors(ValuesOf({nan}), candidate, FarApart(2), kRatio).empty());
}

double Between(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, a.type() == CV_8U ? cv::NORM_HAMMING : cv::NORM_L2);
}

int NearestRow(const cv::Mat& row, const cv::Mat& rows) {
  int nearest = 0;
  for (int i = 1; i < rows.rows; ++i) {
    if (Between(row, rows.row(i)) < Between(row, rows.row(nearest))) nearest = i;
  }
  return nearest;
}

// This decides as the header has it, one pair after the other.
std::vector<Match> MatchesOf(const cv::Mat& query, const cv::Mat& candidate,
                             const std::vector<cv::Point2f>& points) {
  std::vector<Match> matches;
  for (int i = 0; i < query.rows; ++i) {
    const int best = NearestRow(query.row(i), candidate);
    if (NearestRow(candidate.row(best), query) != i) continue;
    double second = std::numeric_limits<double>::infinity();
    for (int j = 0; j < candidate.rows; ++j) {
      if (cv::norm(points[static_cast<std::size_t>(j)] - points[static_cast<std::size_t>(best)]) > 4)
        second = std::min(second, Between(query.row(i), candidate.row(j)));
    }
    const double least = Between(query.row(i), candidate.row(best));
    const double ratio = second > 0 ? least / second : 1;  // the same in two places: says nothing
    if (ratio <= kRatio) matches.push_back({i, best, static_cast<float>(ratio)});
  }
  return matches;
}

// Widths that are multiples of what an instruction works on, and others.
TEST(MatchDescriptors, OfAnyWidthAreThoseOfTheDefinition) {
  std::mt19937 random(1);
  for (const int type : {CV_32F, CV_8U}) {
    for (const int width : {1, 7, 16, 24, 32, 37, 64, 128}) {
      cv::Mat candidate(60, width, CV_32F), query(40, width, CV_32F);
      std::vector<cv::Point2f> points;
      for (int j = 0; j < candidate.rows; ++j) {
        for (int c = 0; c < width; ++c) candidate.at<float>(j, c) = static_cast<float>(random() % 256);
        const auto y = static_cast<float>(random() % 30), x = static_cast<float>(random() % 30);
        points.emplace_back(x, y);
      }
      for (int i = 0; i < query.rows; ++i) {  // each is like one of the candidates, more or less
        for (int c = 0; c < width; ++c) {
          const bool other = random() % 40 < static_cast<std::uint32_t>(i);
          query.at<float>(i, c) = other ? static_cast<float>(random() % 256) : candidate.at<float>(i, c) + 1;
        }
      }
      candidate.convertTo(candidate, type);
      query.convertTo(query, type);
      const std::vector<Match> ours = MatchDescriptors(query, candidate, points, kRatio);
      const std::vector<Match> expected = MatchesOf(query, candidate, points);
      ASSERT_EQ(ours.size(), expected.size()) << width << " values of type " << type;
      EXPECT_GT(ours.size(), width > 1 ? 3u : 0u) << width << " values of type " << type;
      for (std::size_t m = 0; m < ours.size(); ++m) {
        EXPECT_EQ(ours[m].query, expected[m].query);
        EXPECT_EQ(ours[m].candidate, expected[m].candidate);
        EXPECT_NEAR(ours[m].ratio, expected[m].ratio, 1e-5);
      }
    }
  }
}

}  // namespace
}  // namespace tutti

namespace tutti::internal {
namespace {

// Features with a descriptor of one value each.
View::Set SetOf(const std::vector<cv::Point2f>& pixels, const std::vector<float>& values) {
  View::Set set;
  set.pixels = pixels;
  set.descriptors = cv::Mat(values, true);
  return set;
}

std::vector<PooledMatch> Pool(const View& query, const View& candidate) {
  return PoolMatches(query, candidate, 0.8, 1);
}

TEST(MatchPool, HasTheMatchesOfEveryMemberTheMostCertainFirst) {
  View query, candidate;
  query.members = {SetOf({{100, 50}}, {10}), SetOf({{200, 60}}, {10})};
  candidate.members = {SetOf({{110, 50}, {300, 300}}, {12, 14}), SetOf({{210, 60}, {310, 300}}, {11, 20})};
  const std::vector<PooledMatch> pool = Pool(query, candidate);
  ASSERT_EQ(pool.size(), 2u);
  EXPECT_EQ(pool[0].query, cv::Point2f(200, 60));
  EXPECT_EQ(pool[0].candidate, cv::Point2f(210, 60));
  EXPECT_NEAR(pool[0].ratio, 0.1, 1e-6);
  EXPECT_EQ(pool[1].candidate, cv::Point2f(110, 50));
  EXPECT_NEAR(pool[1].ratio, 0.5, 1e-6);
  for (const PooledMatch& match : pool) {
    EXPECT_EQ(match.query_feature, -1);
    EXPECT_FALSE(match.query_point.allFinite());
  }
}

// Places are cells of 4 px.
TEST(MatchPool, HasOneMatchOfAPlaceInEitherImage) {
  const auto size = [](const cv::Point2f& in_query, const cv::Point2f& in_candidate) {
    View query, candidate;
    query.members = {SetOf({{100, 60}}, {10}), SetOf({in_query}, {10})};
    candidate.members = {SetOf({{200, 80}}, {11}), SetOf({in_candidate}, {11})};
    return Pool(query, candidate).size();
  };
  EXPECT_EQ(size({150, 60}, {250, 80}), 2u);
  EXPECT_EQ(size({103.9f, 63.9f}, {250, 80}), 1u);
  EXPECT_EQ(size({104.1f, 60}, {250, 80}), 2u);
  EXPECT_EQ(size({100, 59.9f}, {250, 80}), 2u);
  EXPECT_EQ(size({150, 60}, {203.9f, 83.9f}), 1u);
  EXPECT_EQ(size({150, 60}, {200, 84.1f}), 2u);
}

TEST(MatchPool, TheCallersComeFirstUnderTheirNumbersAndWithTheirPoints) {
  View query, candidate;
  query.members = {SetOf({{100, 60}, {140, 60}}, {10, 50})};
  candidate.members = {SetOf({{200, 80}, {240, 80}}, {10.1f, 50.1f})};  // nearly certain
  query.caller = SetOf({{101, 61}}, {10});
  query.caller.numbers = {7};
  query.caller.points = {{1, 2, 3}};
  candidate.caller = SetOf({{300, 300}, {201, 81}}, {14, 12});
  candidate.caller.points = {{7, 8, 9}, {4, 5, 6}};
  const std::vector<PooledMatch> pool = Pool(query, candidate);
  ASSERT_EQ(pool.size(), 2u) << "the member's first match is at the place of the caller's";
  EXPECT_EQ(pool[0].query_feature, 7);
  EXPECT_EQ(pool[0].candidate_feature, 1);
  EXPECT_EQ(pool[0].query_point, Eigen::Vector3f(1, 2, 3));
  EXPECT_EQ(pool[0].candidate_point, Eigen::Vector3f(4, 5, 6));
  EXPECT_EQ(pool[1].query, cv::Point2f(140, 60));
}

}  // namespace
}  // namespace tutti::internal
