// Options of the visual odometry.
#pragma once

#include <string>

#include "tutti/core/options.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Options of Odometry: section `odometry:` of the YAML files.
struct OdometryOptions {
  // Features.
  TUTTI_OPTION(int, features, 1500, "ORB features per image", Basic(), From(100));
  TUTTI_OPTION(int, pyramid_levels, 8, "levels of the image pyramid", From(1), To(16));
  TUTTI_OPTION(double, scale_factor, 1.2, "size ratio between two levels", Above(1.01), To(2));
  TUTTI_OPTION(int, fast_threshold, 20, "FAST corner threshold, where the image has enough corners",
               Unit("grey levels"), From(1));
  TUTTI_OPTION(int, fast_threshold_min, 7, "FAST threshold in parts of the image where there are too few",
               Unit("grey levels"), From(1));

  // Depth.
  TUTTI_OPTION(double, stereo_sigma_px, 1.4,
               "standard deviation of a disparity at pyramid level 0: of two corners' difference, sqrt(2) "
               "pixel_sigma; with less, noise of the depths shortens the path",
               Basic(), Unit("px"), Above(0));
  TUTTI_OPTION(double, rgbd_inverse_sigma, 0.004,
               "RGB-D: standard deviation of inverse depth; Kinect: about 0.0015 to 0.005", Basic(),
               Unit("1/m"), Above(0));
  TUTTI_OPTION(double, max_depth_baselines, 60, "stereo: farther points are not trusted when they are new",
               Unit("baselines"), Above(1));

  // Lens.
  TUTTI_OPTION(double, lens_sigma, 0.01,
               "mono: radial distortion (of r^2 and of r^4) that the calibration may have left over, "
               "standard deviation; learnt on the way; 0: there is none",
               From(0));

  TUTTI_OPTION(bool, keep_height, true,
               "mono: a camera that stays at one height above the ground before it, as on a vehicle, keeps "
               "its map's scale by it; without such a ground nothing happens");

  // Tracking.
  TUTTI_OPTION(double, pixel_sigma, 1.0, "standard deviation of a keypoint at pyramid level 0", Unit("px"),
               Above(0));
  TUTTI_OPTION(double, aligned_sigma, 0.5,
               "standard deviation of a keypoint whose position was aligned with its landmark's patch, "
               "relative to a corner's",
               Above(0), To(1));
  TUTTI_OPTION(int, min_inliers, 20, "fewer landmarks that agree with the pose: the frame is lost", From(8));
  TUTTI_OPTION(double, relocalize_s, 0.5,
               "lost for longer than this, with something to see: start a new submap", Unit("s"), From(0));

  // Keyframes.
  TUTTI_OPTION(double, keyframe_inlier_ratio, 0.75,
               "new keyframe when fewer than this share of the reference's landmarks is seen", Basic(),
               Above(0), Below(1));
  TUTTI_OPTION(double, keyframe_uncovered_ratio, 0.33,
               "stereo and depth: new keyframe when landmarks are missing in more than this share of the "
               "image's cells that have something to see",
               Above(0), To(1));
  TUTTI_OPTION(double, keyframe_max_interval_s, 1.0,
               "new keyframe at the latest after this time, if the camera moved", Unit("s"), Above(0));
  TUTTI_OPTION(int, keyframe_min_frames, 2,
               "at least this many frames between keyframes (unless tracking gets weak)", Unit("frames"),
               From(0));

  // Mapping.
  TUTTI_OPTION(int, mapping_delay_frames, 1,
               "what mapping makes of a keyframe enters so many frames later, and is waited for then; more "
               "suits fast cameras with depth, mono needs its new landmarks at once",
               Unit("frames"), From(0));
  TUTTI_OPTION(double, max_direction_sigma_deg, 2.5,
               "mono initialisation: standard deviation of the direction in which the camera moved between "
               "the two views; where it is large, a turn and a sideways step look the same",
               Unit("deg"), Above(0));
  TUTTI_OPTION(int, ba_keyframes, 12, "keyframes that local bundle adjustment moves", From(2));
  TUTTI_OPTIONS_END;

  /// Empty if usable, else what is wrong and with which key.
  std::string Validate() const;
};

}  // namespace tutti
#pragma GCC visibility pop
