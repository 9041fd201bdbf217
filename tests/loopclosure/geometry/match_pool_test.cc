#include "loopclosure/geometry/matching.h"

#include <gtest/gtest.h>

#include <vector>

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
