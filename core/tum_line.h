// Lines of a trajectory file in TUM's format, for those that write one pose at a time.
#pragma once

#include <cstdio>
#include <string>

#include "tutti/core/trajectory.h"

namespace tutti::internal {

constexpr const char* kTumHeader = "# timestamp tx ty tz qx qy qz qw\n";

inline std::string TumLine(const StampedPose& s) {
  const Eigen::Vector3d& t = s.pose.translation;
  const Eigen::Quaterniond& q = s.pose.rotation;
  char line[512];
  std::snprintf(line, sizeof line, "%.9f %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", s.stamp_s, t.x(), t.y(),
                t.z(), q.x(), q.y(), q.z(), q.w());
  return line;
}

}  // namespace tutti::internal
