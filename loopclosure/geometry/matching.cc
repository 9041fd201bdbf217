#include "loopclosure/geometry/matching.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "loopclosure/vocabulary/distances.h"

namespace tutti {
namespace {

constexpr float kSamePlace = 4.0f;  // [px]
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Distances of one query row to all candidate rows, squared.
void Distances(const cv::Mat& query, int i, const cv::Mat& candidate, std::vector<float>& distances) {
  if (query.type() == CV_32F) {
    internal::SquaredDistances(query.ptr<float>(i), candidate.ptr<float>(), candidate.rows, candidate.cols,
                               candidate.step1(), distances.data());
    return;
  }
  internal::HammingDistances(query.ptr(i), candidate.ptr(), candidate.rows, candidate.cols, candidate.step[0],
                             distances.data());
  for (float& distance : distances) distance *= distance;
}

}  // namespace

std::vector<Match> MatchDescriptors(const cv::Mat& query, const cv::Mat& candidate,
                                    const std::vector<cv::Point2f>& candidate_points, double max_ratio) {
  std::vector<Match> matches;
  if (query.empty() || candidate.empty() || query.type() != candidate.type() ||
      query.cols != candidate.cols || (query.type() != CV_32F && query.type() != CV_8U) ||
      candidate_points.size() != static_cast<std::size_t>(candidate.rows)) {
    return matches;
  }
  const std::size_t count = static_cast<std::size_t>(candidate.rows);
  std::vector<float> distances(count);
  std::vector<float> nearest(count, kInfinity);             // to each candidate row, so far
  std::vector<std::int32_t> query_of_candidate(count, -1);  // the query row that it is the distance of
  for (int i = 0; i < query.rows; ++i) {
    Distances(query, i, candidate, distances);
    const float least = internal::UpdateNearest(distances.data(), candidate.rows, i, nearest.data(),
                                                query_of_candidate.data());
    const auto at = std::find(distances.begin(), distances.end(), least);
    if (at == distances.end()) continue;  // descriptors with NaN
    const std::size_t best = static_cast<std::size_t>(at - distances.begin());
    if (query_of_candidate[best] != i) continue;  // an earlier row is as near: never mutual
    float second = kInfinity;
    for (std::size_t j = 0; j < count; ++j) {
      if (distances[j] >= second) continue;
      const cv::Point2f apart = candidate_points[j] - candidate_points[best];
      if (apart.dot(apart) > kSamePlace * kSamePlace) second = distances[j];
    }
    const float ratio = second > 0.0f ? std::sqrt(least / second) : 1.0f;
    if (ratio <= max_ratio) matches.push_back({i, static_cast<int>(best), ratio});
  }
  std::vector<Match> mutual;
  for (const Match& match : matches) {
    if (query_of_candidate[static_cast<std::size_t>(match.candidate)] == match.query) mutual.push_back(match);
  }
  return mutual;
}

}  // namespace tutti
