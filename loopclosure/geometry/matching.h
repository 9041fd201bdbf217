// Matching of two sets of descriptors.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

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

}  // namespace tutti
