#include "data/synthetic/shutter.h"

#include <algorithm>
#include <utility>

namespace tutti::synthetic {
namespace {

constexpr int kStripRows = 4;

// The mean over the exposure around a time.
Rendering Mean(const PinholeCamera& camera, const Shutter& shutter, double time_s, const View& view) {
  const int steps = shutter.exposure_s > 0 ? shutter.samples : 1, middle = steps / 2;
  Rendering sum;
  for (int k = 0; k < steps; ++k) {
    const double at = time_s + (steps == 1 ? 0.0 : shutter.exposure_s * (k - middle) / double(steps));
    Rendering one = view(camera, at);
    if (k == 0) {
      sum = std::move(one);
    } else {
      sum.image += one.image;
      if (k == middle) sum.depth_m = one.depth_m;
    }
  }
  if (steps > 1) sum.image *= 1.0 / steps;
  return sum;
}

}  // namespace

PinholeCamera RowsOf(const PinholeCamera& camera, int first, int rows) {
  PinholeCamera part = camera;
  part.cy = camera.cy - first;
  part.height = rows;
  return part;
}

Rendering Expose(const PinholeCamera& camera, const Shutter& shutter, double time_s, const View& view) {
  if (!(shutter.readout_s > 0)) return Mean(camera, shutter, time_s, view);
  Rendering whole;
  whole.image.create(camera.height, camera.width, CV_32FC1);
  whole.depth_m.create(camera.height, camera.width, CV_32FC1);
  const double last = camera.height - 1;
  for (int first = 0; first < camera.height; first += kStripRows) {
    const int rows = std::min(kStripRows, camera.height - first);
    const double late = shutter.readout_s * ((first + 0.5 * (rows - 1)) / last - 0.5);
    const Rendering strip = Mean(RowsOf(camera, first, rows), shutter, time_s + late, view);
    strip.image.copyTo(whole.image.rowRange(first, first + rows));
    strip.depth_m.copyTo(whole.depth_m.rowRange(first, first + rows));
  }
  return whole;
}

}  // namespace tutti::synthetic
