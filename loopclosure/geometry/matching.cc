#include "loopclosure/geometry/matching.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "loopclosure/features/distances.h"
#include "loopclosure/features/whole_rows.h"

namespace tutti {
namespace {

constexpr float kSamePlace = 4.0f;  // [px]
constexpr float kInfinity = std::numeric_limits<float>::infinity();

using internal::WholeRows;

// Squared distances of query rows, one after the other, to all candidate rows; times some constant.
class Distances {
 public:
  Distances(const cv::Mat& query, const cv::Mat& candidate) : query_(query), candidate_(candidate) {
    for (std::vector<float>& distances : distances_)
      distances.resize(static_cast<std::size_t>(candidate.rows));
    if (query.type() != CV_32F) return;
    for (const float scale : {1.0f, WholeRows::kSignedSquares}) {
      whole_query_ = WholeRows::Of(query, scale);
      const std::optional<WholeRows> whole = whole_query_ ? WholeRows::Of(candidate, scale) : std::nullopt;
      if (whole) columns_.emplace(*whole);
      if (columns_) return;
    }
  }

  // Of row i; for i = 0, 1, 2, ... in this order.
  const std::vector<float>& To(int i) {
    std::vector<float>& first = distances_.front();
    if (columns_) {
      if (i % WholeRows::kTogether == 0) whole_query_->Distances(i, *columns_, distances_);
      return distances_.at(static_cast<std::size_t>(i % WholeRows::kTogether));
    }
    if (query_.type() == CV_32F) {
      internal::SquaredDistances(query_.ptr<float>(i), candidate_.ptr<float>(), candidate_.rows,
                                 candidate_.cols, candidate_.step1(), first.data());
      return first;
    }
    internal::HammingDistances(query_.ptr(i), candidate_.ptr(), candidate_.rows, candidate_.cols,
                               candidate_.step[0], first.data());
    for (float& distance : first) distance *= distance;
    return first;
  }

 private:
  const cv::Mat& query_;
  const cv::Mat& candidate_;
  std::optional<WholeRows> whole_query_;
  std::optional<WholeRows::Columns> columns_;
  WholeRows::Block distances_;
};

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
  Distances all_distances(query, candidate);
  std::vector<float> x, y;
  for (const cv::Point2f& point : candidate_points) {
    x.push_back(point.x);
    y.push_back(point.y);
  }
  std::vector<float> nearest(count, kInfinity);             // to each candidate row, so far
  std::vector<std::int32_t> query_of_candidate(count, -1);  // the query row that it is the distance of
  for (int i = 0; i < query.rows; ++i) {
    const std::vector<float>& distances = all_distances.To(i);
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
    if (query_of_candidate[static_cast<std::size_t>(match.candidate)] == match.query) mutual.push_back(match);
  }
  return mutual;
}

}  // namespace tutti
