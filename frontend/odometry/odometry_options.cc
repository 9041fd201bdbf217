#include "tutti/frontend/odometry_options.h"

namespace tutti {

std::string OdometryOptions::Validate() const {
  if (features < 100) return "odometry.features must be at least 100";
  if (pyramid_levels < 1 || pyramid_levels > 16) return "odometry.pyramid_levels must be 1 to 16";
  if (!(scale_factor > 1.01 && scale_factor <= 2.0))
    return "odometry.scale_factor must be above 1.01 and at most 2";
  if (fast_threshold < 1 || fast_threshold_min < 1 || fast_threshold_min > fast_threshold) {
    return "odometry.fast_threshold_min must be at least 1 and at most odometry.fast_threshold";
  }
  if (!(lens_sigma >= 0)) return "odometry.lens_sigma must not be negative";
  if (!(aligned_sigma > 0 && aligned_sigma <= 1))
    return "odometry.aligned_sigma must be above 0 and at most 1";
  if (!(stereo_sigma_px > 0) || !(rgbd_inverse_sigma > 0) || !(pixel_sigma > 0))
    return "odometry: every sigma must be positive";
  if (!(max_depth_baselines > 1)) return "odometry.max_depth_baselines must be above 1";
  if (min_inliers < 8) return "odometry.min_inliers must be at least 8";
  if (!(relocalize_s >= 0)) return "odometry.relocalize_s must not be negative";
  if (!(keyframe_inlier_ratio > 0 && keyframe_inlier_ratio < 1))
    return "odometry.keyframe_inlier_ratio must lie between 0 and 1";
  if (!(keyframe_uncovered_ratio > 0 && keyframe_uncovered_ratio <= 1))
    return "odometry.keyframe_uncovered_ratio must be above 0 and at most 1";
  if (!(keyframe_max_interval_s > 0)) return "odometry.keyframe_max_interval_s must be positive";
  if (mapping_delay_frames < 0) return "odometry.mapping_delay_frames must not be negative";
  if (keyframe_min_frames < 0) return "odometry.keyframe_min_frames must not be negative";
  if (local_keyframes < 1 || triangulation_neighbours < 1)
    return "odometry.local_keyframes and triangulation_neighbours must be at least 1";
  if (!(min_parallax_deg > 0)) return "odometry.min_parallax_deg must be positive";
  if (ba_keyframes < 2 || ba_fixed_keyframes < 0 || ba_iterations < 1) {
    return "odometry.ba_keyframes must be at least 2, ba_fixed_keyframes at least 0, ba_iterations at least "
           "1";
  }
  return {};
}

}  // namespace tutti
