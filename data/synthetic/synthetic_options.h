// What to render: options of the synthetic world.
#pragma once

#include <cstdint>
#include <string>

namespace tutti {

enum class SyntheticScene { kTown, kRoom };
enum class SyntheticSensor { kMono, kStereo, kRgbd };

/// Options of SyntheticWorld. The same options give the same bytes, on any number of threads.
struct SyntheticOptions {
  std::uint64_t seed = 1;                           ///< of everything that is random: houses, textures, noise
  SyntheticScene scene = SyntheticScene::kTown;     ///< a town driven through, or a room walked around in
  SyntheticSensor sensor = SyntheticSensor::kMono;  ///< what is rendered beside the left image

  // The camera. 0: 640x320 with 0.58 * width in the town, 640x480 with 0.82 * width in the room.
  int width = 0;           ///< [px]
  int height = 0;          ///< [px]
  double focal_px = 0;     ///< [px]
  double baseline_m = 0;   ///< stereo [m]; 0: 0.54 in the town (as KITTI), 0.12 in the room
  double rate_hz = 0;      ///< frames per second; 0: 10 in the town, 15 in the room
  double max_depth_m = 0;  ///< RGB-D: farther depth is not measured [m]; 0: 13 in the town, 8 in the room
  double depth_units_per_m = 5000;  ///< RGB-D: value of one metre in the 16-bit files (which end at 65535)

  // The drive.
  double laps = 2;       ///< rounds of the closed route (fractions too); every round after the first revisits
  int frames = 0;        ///< stop after so many frames; 0: all of the laps
  double speed_mps = 0;  ///< on straights [m/s]; 0: 8 in the town, 0.5 in the room; corners are driven slower

  // The town.
  int blocks_x = 2;      ///< the route goes around so many blocks of houses in x,
  int blocks_y = 1;      ///< and in y; two or more in both: an L shape
  double block_m = 40;   ///< side of a block [m]
  double street_m = 12;  ///< width of a street [m]
  double repeat_fraction =
      0.3;  ///< of the houses that look alike (one of four facades): perceptual aliasing [0..1]

  // What makes it hard.
  double noise_sigma = 0;    ///< pixel noise [grey levels]
  double motion_blur_s = 0;  ///< exposure time [s]; 0: sharp. Poses are those of the middle of the exposure
  bool lighting_change = false;  ///< from the second lap on: sun from elsewhere, darker, another contrast
  int moving_objects = 0;        ///< number of cars (town) or walking people (room)
  bool kinect_noise = false;     ///< RGB-D: noise that grows with depth, holes at edges and far away

  int supersample =
      2;  ///< samples per pixel and axis, 1 to 4; 1 is four times faster than 2, with jagged edges

  /// Empty if usable, else what is wrong.
  std::string Validate() const;
  /// The same with the zeros that stand for "as the scene needs it" replaced.
  SyntheticOptions Resolved() const;
};

}  // namespace tutti
