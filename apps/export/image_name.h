// Names of exported images.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>

namespace tutti {

/// "frame_000042.png": the frame's number in its data set, so that names sort by time.
inline std::string ImageName(std::int64_t frame_index) {
  char name[48];
  std::snprintf(name, sizeof name, "frame_%06lld.png", static_cast<long long>(frame_index));
  return name;
}

}  // namespace tutti
