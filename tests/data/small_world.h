// Worlds that are quickly rendered.
#pragma once

#include "data/synthetic/synthetic_options.h"

namespace tutti::testing {

inline SyntheticOptions SmallWorld(SyntheticScene scene, SyntheticSensor sensor) {
  SyntheticOptions o;
  o.scene = scene;
  o.sensor = sensor;
  o.width = 320;
  o.height = scene == SyntheticScene::kTown ? 160 : 240;
  o.blocks_x = 1;
  return o;
}

}  // namespace tutti::testing
