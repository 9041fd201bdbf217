// Tests that hold for one camera, a stereo pair, and a camera with depth.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "data/synthetic/synthetic_world.h"

namespace tutti::testing {

inline auto EachSensor() {
  return ::testing::Values(SyntheticSensor::kMono, SyntheticSensor::kStereo, SyntheticSensor::kRgbd);
}

/// The end of a test's name.
inline std::string SensorName(const ::testing::TestParamInfo<SyntheticSensor>& test) {
  return test.param == SyntheticSensor::kMono     ? "Mono"
         : test.param == SyntheticSensor::kStereo ? "Stereo"
                                                  : "Rgbd";
}

}  // namespace tutti::testing
