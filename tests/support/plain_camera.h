// A camera without distortion for tests that need no particular one.
#pragma once

#include "tutti/core/camera.h"

namespace tutti::testing {

/// 640 x 480, principal point in the middle.
inline PinholeCamera PlainCamera(double focal_px) {
  PinholeCamera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = focal_px;
  camera.cx = 320;
  camera.cy = 240;
  return camera;
}

}  // namespace tutti::testing
