// Matching of descriptors, and the matches of two views that verification works on. Internal.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "loopclosure/geometry/verification.h"

namespace tutti {

/// A pair of descriptors that are each other's nearest.
struct Match {
  int query = -1;      ///< row of the query's descriptors
  int candidate = -1;  ///< row of the candidate's
  float ratio = 1;     ///< d1 / d2 of the ratio test, 0 (certain) .. 1
};

/// Ratio test (Lowe 2004) and mutual check over all pairs, on true distance: CV_32F rows Euclidean, CV_8U
/// rows Hamming. The second neighbour is the nearest one at another place, more than 4 px from the first:
/// detectors give several keypoints for one place. `candidate_points`: one pixel per candidate row. In order
/// of the query rows; empty if the types or widths differ.
std::vector<Match> MatchDescriptors(const cv::Mat& query, const cv::Mat& candidate,
                                    const std::vector<cv::Point2f>& candidate_points, double max_ratio);

namespace internal {

/// A match of the pool, with what is known about its ends.
struct PooledMatch {
  cv::Point2f query, candidate;  ///< pixels [px]
  Eigen::Vector3f query_point,
      candidate_point;         ///< in the camera frame; NaN where unknown
  int query_feature = -1;      ///< of the caller's, -1: a member's
  int candidate_feature = -1;  ///< of the caller's, -1: a member's
  float ratio = 1;             ///< of distances, by which the match was chosen
};

/// The features of all members and the caller's matched (ratio test and mutual check) and pooled, one match
/// per place in either image, on at most `threads` threads.
std::vector<PooledMatch> PoolMatches(const View& query, const View& candidate, double max_ratio, int threads);

}  // namespace internal
}  // namespace tutti
