// Lines of a trajectory file in TUM's format, for those that write one pose at a time.
#pragma once

#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>

#include "core/time_stamps.h"
#include "tutti/core/trajectory.h"

namespace tutti::internal {

constexpr const char* kTumHeader = "# timestamp tx ty tz qx qy qz qw\n";

/// `stamp_ns`: in place of the stamp.
inline std::string TumLine(const StampedPose& s, std::optional<std::int64_t> stamp_ns = std::nullopt) {
  const Eigen::Vector3d& t = s.pose.translation;
  const Eigen::Quaterniond& q = s.pose.rotation;
  char line[1024];
  std::snprintf(line, sizeof line, " %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", t.x(), t.y(), t.z(), q.x(), q.y(),
                q.z(), q.w());
  return (stamp_ns ? StampText(*stamp_ns) : StampText(s.stamp_s)) + line;
}

}  // namespace tutti::internal
