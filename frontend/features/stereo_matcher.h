// Depth of left features from a rectified stereo pair.
#pragma once

#include <vector>

#include "frontend/features/features.h"

namespace tutti {

/// Finds each left feature in the right image: best descriptor along its row, then the disparity at the
/// keypoint by a least-squares fit of a slanted surface on the feature's pyramid level. Fills inverse_depth,
/// its sigma, row_error_px and stereo_matches.
void MatchStereo(const std::vector<cv::Mat>& left_pyramid, const std::vector<cv::Mat>& right_pyramid,
                 const FrameFeatures& right, const CameraRig& rig, const OdometryOptions& options,
                 FrameFeatures* left);

}  // namespace tutti
