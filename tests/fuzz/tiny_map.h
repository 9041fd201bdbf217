// A map of few and small frames, for fuzzing.
#pragma once

#include "data/synthetic/synthetic_world.h"
#include "tests/support/recording.h"
#include "tests/support/small_room.h"
#include "tutti/slam/config.h"

namespace tutti::fuzz {

inline RunConfig TinyConfig() {
  RunConfig config;
  config.run.threads = 1;
  config.odometry.features = 100;
  config.loops.members = {"orb"};
  config.loops.extraction.features = 50;
  config.loops.stm_size = 1;
  return config;
}

inline testing::Recording TinyDrive(std::size_t frames) {
  SyntheticOptions options = testing::SmallRgbdRoom(128, 96);
  options.rate_hz = 4;
  return testing::Record(SyntheticWorld(options), frames);
}

}  // namespace tutti::fuzz
