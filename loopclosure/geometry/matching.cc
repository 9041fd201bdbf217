#include "loopclosure/geometry/matching.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/numbers.h"
#include "loopclosure/features/distances.h"
#include "loopclosure/features/whole_rows.h"

namespace tutti {
namespace {

constexpr float kSamePlace = 4.0f;  // [px]
constexpr float kInfinity = std::numeric_limits<float>::infinity();

}  // namespace

std::vector<Match> MatchDescriptors(const cv::Mat& query, const cv::Mat& candidate,
                                    const std::vector<cv::Point2f>& candidate_points, double max_ratio) {
  std::vector<Match> matches;
  if (query.empty() || candidate.empty() || query.type() != candidate.type() ||
      query.cols != candidate.cols || (query.type() != CV_32F && query.type() != CV_8U) ||
      candidate_points.size() != internal::Index(candidate.rows)) {
    return matches;
  }
  const std::size_t count = internal::Index(candidate.rows);
  internal::RowDistances all_distances(query, candidate);
  std::vector<float> x, y;
  for (const cv::Point2f& point : candidate_points) {
    x.push_back(point.x);
    y.push_back(point.y);
  }
  std::vector<float> nearest(count, kInfinity);             // to each candidate row, so far
  std::vector<std::int32_t> query_of_candidate(count, -1);  // the query row that it is the distance of
  for (int i = 0; i < query.rows; ++i) {
    const std::vector<float>& distances = all_distances.To(i, candidate.rows);
    const float least = internal::UpdateNearest(distances.data(), candidate.rows, i, nearest.data(),
                                                query_of_candidate.data());
    const auto at = std::find(distances.begin(), distances.end(), least);
    if (at == distances.end()) continue;  // descriptors with NaN
    const std::size_t best = static_cast<std::size_t>(at - distances.begin());
    if (query_of_candidate[best] != i) continue;  // an earlier row is as near: never mutual
    const float second =
        internal::NearestElsewhere(distances.data(), x.data(), y.data(), candidate.rows,
                                   candidate_points[best].x, candidate_points[best].y, kSamePlace);
    const float ratio = second > 0.0f ? std::sqrt(least / second) : 1.0f;
    if (ratio <= max_ratio) matches.push_back({i, static_cast<int>(best), ratio});
  }
  std::vector<Match> mutual;
  for (const Match& match : matches) {
    if (query_of_candidate[internal::Index(match.candidate)] == match.query) mutual.push_back(match);
  }
  return mutual;
}

}  // namespace tutti
