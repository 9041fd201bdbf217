// A synthetic room that is quickly rendered, seen by a camera with depth.
#pragma once

#include "data/synthetic/synthetic_world.h"

namespace tutti::testing {

inline SyntheticOptions SmallRgbdRoom(int width, int height) {
  SyntheticOptions options;
  options.scene = SyntheticScene::kRoom;
  options.sensor = SyntheticSensor::kRgbd;
  options.width = width;
  options.height = height;
  options.supersample = 1;
  return options;
}

}  // namespace tutti::testing
