// Essential and fundamental matrix and homography by RANSAC. Internal.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti::internal {

struct EpipolarSettings {
  double threshold_px = 1.5;
  std::uint64_t seed = 1;
};

struct EpipolarResult {
  std::vector<int> inliers;  ///< ascending; empty if no model was found
  Pose T_second_first;       ///< FitEssential: rotation and unit translation
};

/// OpenCV's USAC with a seed of its own and on one thread, so that the result is reproducible. At least 8
/// matches.
EpipolarResult FitFundamental(const std::vector<cv::Point2f>& first, const std::vector<cv::Point2f>& second,
                              const EpipolarSettings& settings);

/// Fits with calibration (the cameras may differ, and may distort); points behind a camera are no inliers.
EpipolarResult FitEssential(const std::vector<cv::Point2f>& first, const PinholeCamera& first_camera,
                            const std::vector<cv::Point2f>& second, const PinholeCamera& second_camera,
                            const EpipolarSettings& settings);

struct HomographyResult {
  std::vector<int> inliers;  ///< ascending; empty if no model was found
  bool turned = false;       ///< both cameras given: a rotation alone explains nearly
                             ///< all inliers
  Eigen::Quaterniond R_second_first = Eigen::Quaterniond::Identity();  ///< only if turned
};

/// The homography first -> second: of a flat scene, or of a camera that turned on the spot. Without both
/// cameras their distortion stays in the pixels. At least 8 matches.
HomographyResult FitHomography(const std::vector<cv::Point2f>& first,
                               const std::optional<PinholeCamera>& first_camera,
                               const std::vector<cv::Point2f>& second,
                               const std::optional<PinholeCamera>& second_camera,
                               const EpipolarSettings& settings);

}  // namespace tutti::internal
