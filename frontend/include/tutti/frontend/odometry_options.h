// Options of the visual odometry.
#pragma once

#include <string>

namespace tutti {

/// Options of Odometry. Each field has a key of the same name under `odometry:` in the YAML files.
struct OdometryOptions {
  // Features.
  int features = 1500;         ///< ORB features per image
  int pyramid_levels = 8;      ///< levels of the image pyramid
  double scale_factor = 1.2;   ///< size ratio between two levels, > 1
  int fast_threshold = 20;     ///< FAST corner threshold [grey levels], where the image has enough corners
  int fast_threshold_min = 7;  ///< FAST threshold in parts of the image where there are too few [grey levels]

  // Depth.
  double stereo_sigma_px = 1.4;  ///< standard deviation of a disparity at pyramid level 0 [px]: of two
                                 ///< corners' difference, sqrt(2) pixel_sigma; with less, noise of the
                                 ///< depths shortens the path
  double rgbd_inverse_sigma =
      0.004;  ///< RGB-D: standard deviation of inverse depth [1/m]; Kinect: about 0.0015 to 0.005
  double max_depth_baselines = 60;  ///< stereo: farther points are not trusted when they are new [baselines]

  // Lens.
  double lens_sigma = 0.01;  ///< mono: radial distortion (of r^2 and of r^4) that the calibration may have
                             ///< left over, standard deviation [1]; learnt on the way; 0: there is none

  // Tracking.
  double pixel_sigma = 1.0;    ///< standard deviation of a keypoint at pyramid level 0 [px]
  double aligned_sigma = 0.5;  ///< standard deviation of a keypoint whose position was aligned with its
                               ///< landmark's patch, relative to a corner's, above 0 to 1
  int min_inliers = 20;        ///< fewer landmarks that agree with the pose: the frame is lost
  double relocalize_s = 0.5;   ///< lost for longer than this [s], with something to see: start a new piece of
                               ///< map
  int local_keyframes = 40;    ///< keyframes whose landmarks are searched in a frame

  // Keyframes.
  double keyframe_inlier_ratio =
      0.75;  ///< new keyframe when fewer than this share of the reference's landmarks is seen, 0..1
  double keyframe_uncovered_ratio =
      0.33;  ///< stereo and depth: new keyframe when landmarks are missing in more than this share of the
             ///< image's cells that have something to see, 0..1
  double keyframe_max_interval_s =
      1.0;                      ///< new keyframe at the latest after this time, if the camera moved [s]
  int keyframe_min_frames = 2;  ///< at least this many frames between keyframes (unless tracking gets weak)

  // Mapping.
  int mapping_delay_frames =
      1;  ///< what mapping makes of a keyframe enters so many frames later, and is waited for then [frames];
          ///< more suits fast cameras with depth, mono needs its new landmarks at once
  int triangulation_neighbours = 8;  ///< mono: keyframes with which new landmarks are triangulated
  double min_parallax_deg = 1.0;     ///< mono initialisation: median parallax [deg]
  int ba_keyframes = 12;             ///< keyframes that local bundle adjustment moves
  int ba_fixed_keyframes = 20;       ///< keyframes that hold the window in place
  int ba_iterations = 6;             ///< most iterations of a local bundle adjustment

  /// Empty if usable, else what is wrong and with which key.
  std::string Validate() const;
};

}  // namespace tutti
