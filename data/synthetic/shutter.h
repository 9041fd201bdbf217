// When the rows of an image see the world: exposure and readout.
#pragma once

#include <functional>

#include "data/synthetic/rasterizer.h"
#include "tutti/core/camera.h"

namespace tutti::synthetic {

/// Rows are exposed for `exposure_s`, the last one `readout_s` after the first (a rolling shutter; 0: all at
/// once).
struct Shutter {
  double exposure_s = 0;  ///< [s]
  double readout_s = 0;   ///< [s]
  int samples = 1;        ///< of the exposure, an odd number
};

/// What a camera sees at a time [s]. The camera may be a part of the whole one: some of its rows.
using View = std::function<Rendering(const PinholeCamera& rows, double time_s)>;

/// The mean of what is seen over the exposure, strip of rows by strip of rows. `time_s`: the middle of the
/// exposure of the middle row. Depth is that of the middle of each strip's exposure.
Rendering Expose(const PinholeCamera& camera, const Shutter& shutter, double time_s, const View& view);

/// The camera that sees rows first..first + rows - 1 alone.
PinholeCamera RowsOf(const PinholeCamera& camera, int first, int rows);

}  // namespace tutti::synthetic
