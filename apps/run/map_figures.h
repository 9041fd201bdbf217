// What the map of a run looks like, in a few numbers.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "tutti/frontend/odometry.h"

namespace tutti {

/// Ids, ascending, of the session's keyframes that are in its largest submap (by frames) and have a finite
/// pose.
std::vector<int> KeyframesOfLargestSubmap(const Odometry& odometry, const FrameRange& session);

/// Figures of the largest submap; they are zeros where it has no keyframe.
struct MapFigures {
  int keyframes = 0;
  double landmarks = 0;    ///< that a keyframe sees, median
  double misfit_px = 0;    ///< reprojection error of landmarks that three keyframes see, median
  double depth_misfit = 0; /**< stereo and depth images: how far landmarks that three keyframes see are from
                              where a keyframe measures them, as share of the depth, median */
  double without_parallax = 0; /**< share of the keyframes whose landmarks are, in the median, seen under an
                                  angle below 1 deg from the others that see them */
  double scale_jump = 1;       /**< from three keyframes to the next three: by what factor depths and speed
                                  changed together, the greatest, either way; 1 with too few keyframes */
  double local_scale = 1; /**< stereo and depth images: depth of the landmarks over what keyframes measure,
                             median over five keyframes in a row, the farthest from 1 */
  std::map<std::int64_t, double> depth;  ///< by number of the keyframe's frame: median of its landmarks
};

/// Looks at the keyframes of these frames.
MapFigures MeasureMap(const Odometry& odometry, const FrameRange& session);

}  // namespace tutti
