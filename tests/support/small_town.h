// A synthetic world that is quickly rendered: streets around one block, seen by a stereo or RGB-D camera.
#pragma once

#include "data/synthetic/synthetic_world.h"

namespace tutti::testing {

inline SyntheticOptions SmallStereoTown(int width, int height) {
  SyntheticOptions options;
  options.sensor = SyntheticSensor::kStereo;
  options.blocks_x = options.blocks_y = 1;
  options.width = width;
  options.height = height;
  options.supersample = 1;
  return options;
}

inline SyntheticOptions SmallRgbdTown(int width, int height) {
  SyntheticOptions options = SmallStereoTown(width, height);
  options.sensor = SyntheticSensor::kRgbd;
  return options;
}

/// A lap around a small block and a bit more: long enough for loops.
inline SyntheticOptions SmallStereoTownWithALoop(int width, int height) {
  SyntheticOptions options = SmallStereoTown(width, height);
  options.block_m = 26;
  options.laps = 1.15;
  options.rate_hz = 4.5;
  return options;
}

}  // namespace tutti::testing
