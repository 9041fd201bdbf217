// What to render: options of the synthetic world.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace tutti {

namespace synthetic {
struct GivenPath;
}

/// kHall, and kRoom with a path, are built around that path.
enum class SyntheticScene { kTown, kRoom, kCorridor, kHall };
/// kSides: two cameras that look to the left and to the right of the way, for place recognition.
enum class SyntheticSensor { kMono, kStereo, kRgbd, kSides };

/// Options of SyntheticWorld. The same options give the same bytes, on any number of threads.
struct SyntheticOptions {
  std::uint64_t seed = 1;  ///< of everything that is random: houses, textures, noise
  SyntheticScene scene =
      SyntheticScene::kTown;  ///< a town driven through, a room walked around in, a corridor
  SyntheticSensor sensor = SyntheticSensor::kMono;  ///< what is rendered beside the left image

  // The camera. 0: 640x320 with 0.58 * width in the town, 640x480 with 0.82 * width indoors.
  int width = 0;           ///< [px]
  int height = 0;          ///< [px]
  double focal_px = 0;     ///< [px]
  double baseline_m = 0;   ///< stereo [m]; 0: 0.54 in the town (as KITTI), 0.12 indoors
  double sides_deg = 60;   ///< sides: each camera looks so far from the way [deg]
  double pitch_deg = 0;    ///< the camera looks so far down [deg]; negative: up
  double rate_hz = 0;      ///< frames per second; 0: 10 in the town, 15 indoors
  double max_depth_m = 0;  ///< RGB-D: farther depth is not measured [m]; 0: 13 in the town, 8 indoors
  double depth_units_per_m = 5000;  ///< RGB-D: value of one metre in the 16-bit files (which end at 65535)

  /// Poses, frames and cameras that are given (data/synthetic/given_path.h), in the stead of the camera and
  /// the drive below; a room or a hall. Null: none
  std::shared_ptr<const synthetic::GivenPath> path;

  // The drive.
  double laps = 2;       ///< rounds of the closed route (fractions too); every round after the first revisits
  int frames = 0;        ///< stop after so many frames; 0: all of the laps
  double speed_mps = 0;  ///< on straights [m/s]; 0: 8 in the town, 0.5 indoors; corners are driven slower

  // The town.
  int blocks_x = 2;      ///< the route goes around so many blocks of houses in x,
  int blocks_y = 1;      ///< and in y; two or more in both: an L shape
  double block_m = 40;   ///< side of a block [m]
  double street_m = 12;  ///< width of a street [m]
  /// Perceptual aliasing [0..1]: part of the houses that have one of four facades; in the corridor, of the
  /// name plates and posters that are no landmarks.
  double repeat_fraction = 0.3;
  int facades = 24;  ///< different ones, at least 5: houses that don't repeat share them by chance; and a
                     ///< quarter as many looks of cars
  double sign_fraction =
      1;  ///< of the town's posters and shop signs that are there [0..1]; no two look alike
  int road_surfaces =
      6;  ///< different ones, each with its cracks, patches and manhole: few are aliasing, too

  double hills_m = 0;  ///< its streets go up and down so far [m]: hills every 150 and 115 m

  // The room.
  double bare_fraction = 0;  ///< of each wall, a stretch that a plain curtain covers [0..1]
  int plain_doors = 0;       ///< doors of plain paint beside the way, some 0.3 m from it at the nearest

  // The corridor: a ring, twice as long as wide.
  double corridor_m = 40;  ///< its longer side [m]

  // What makes it hard.
  double noise_sigma = 0;    ///< pixel noise [grey levels]
  double motion_blur_s = 0;  ///< exposure time [s]; 0: sharp. Poses are those of the middle of the exposure
  /// Rolling shutter: the last row is read so long after the first [s]; 0: all at once. Poses are those of
  /// the middle row
  double readout_s = 0;
  /// RGB-D: depth images are taken so long before the colour images that they come with [s], row by row as
  /// those are; negative: after
  double depth_delay_s = 0;
  /// A hand that shakes: fastest turning about each of the camera's axes [deg/s], in bursts, on a lever of
  /// 0.2 m; 0: steady
  double shake_deg_per_s = 0;
  bool lighting_change = false;  ///< from the second lap on: sun from elsewhere, darker, another contrast
  bool dusk = false;             ///< from the second lap on: dusk, noisy; in the town, street lamps are lit
  bool other_cars = false;       ///< town: other parked cars when places are seen again
  double occlusion =
      0;  ///< town: from the second lap on, lorries cover about this part of the image [0..0.3]
  int moving_objects = 0;     ///< number of cars (town) or walking people (room)
  bool kinect_noise = false;  ///< RGB-D: noise that grows with depth, holes at edges and far away

  int supersample =
      2;  ///< samples per pixel and axis, 1 to 4; 1 is four times faster than 2, with jagged edges

  /// Empty if usable, else what is wrong.
  std::string Validate() const;
  /// These options with the zeros that stand for "as the scene needs it" replaced.
  SyntheticOptions Resolved() const;
};

}  // namespace tutti
