// The plane of the ground before a camera, from the grey values of two images: how high the camera is above
// it, in units of the way between them.
//
// S. Song, M. Chandraker, C. Guest, "High Accuracy Monocular SFM and Scale Correction for Autonomous
// Driving", PAMI 2016, on what the height is good for; the alignment is direct, by Gauss-Newton.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti {

struct GroundPlane {
  Eigen::Vector3d normal_by_height;  ///< n / h: its points X in the first camera have n . X = h
  double correlation = 0;            ///< of the grey values that it brings together

  double Height() const { return 1 / normal_by_height.norm(); }
};

/// How far to each side the ground is looked at [heights].
inline constexpr double kGroundAside = 1.2;

/// Where a camera looks, along a ground of this normal (of length 1). 0: it looks straight down.
Eigen::Vector3d AheadOnGround(const Eigen::Vector3d& normal);

/// The ground between 3 and 8 heights ahead of the first camera, and kGroundAside to each side. Images are
/// CV_8U and rectified. None: too little of it is in both images, or the search came to no end.
std::optional<GroundPlane> AlignGround(const PinholeCamera& camera, const cv::Mat& first,
                                       const cv::Mat& second, const Pose& T_second_first,
                                       const Eigen::Vector3d& start);

/// The direction of a ground that the camera drives along, in the first camera: at right angles to the way,
/// and as nearly below as can be (the camera's y). So a camera may look up or down. None: it did not move, or
/// it moved more along its y axis than across it.
std::optional<Eigen::Vector3d> NormalBelow(const Pose& T_second_first);

/// A plane of that direction whose height is not known at all, for AlignGround to start with: the one whose
/// grey values agree best. None: they agree nowhere.
std::optional<GroundPlane> SearchGround(const PinholeCamera& camera, const cv::Mat& first,
                                        const cv::Mat& second, const Pose& T_second_first);

}  // namespace tutti
