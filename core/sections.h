// The sections of a file that hold an odometry.
#pragma once

#include <cstdint>

namespace tutti {

/// Tags; those of other modules have other hundreds.
enum class Section : std::uint32_t {
  kHead = 100,        ///< what it was made with, and how much follows
  kKeyframe,          ///< one each
  kLandmarks,         ///< so many together
  kTracking,          ///< all that is no map
  kTimes,             ///< milliseconds by stage, the only thing that varies from run to run
  kGlobalAdjustment,  ///< OdometryFile
  kImage,             ///< of the keyframe that follows, if it has it still
  kEndOfOdometry = 199
};

inline std::uint32_t Tag(Section section) { return static_cast<std::uint32_t>(section); }

}  // namespace tutti
