// The matches of two views that verification works on. Internal.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "loopclosure/geometry/verification.h"

namespace tutti::internal {

/// A match of the pool, with what is known about its ends.
struct PooledMatch {
  cv::Point2f query, candidate;  ///< pixels [px]
  Eigen::Vector3f query_point,
      candidate_point;         ///< in the camera frame; NaN where unknown
  int query_feature = -1;      ///< of the caller's, -1: a member's
  int candidate_feature = -1;  ///< of the caller's, -1: a member's
  float ratio = 1;             ///< of distances, by which the match was chosen
};

/// The features of all members and the caller's matched (ratio test and mutual
/// check) and pooled, one match per place in either image, on at most `threads`
/// threads.
std::vector<PooledMatch> PoolMatches(const View& query, const View& candidate, double max_ratio, int threads);

}  // namespace tutti::internal
