// Cleaner and longer tracks, for programs that have nothing but tracks.
#pragma once

#include <cstddef>
#include <vector>

#include "apps/export/keyframe_images.h"
#include "apps/export/map_model.h"

namespace tutti {

/// What became of the views of a model.
struct TrackChanges {
  double most_px = 0;       ///< farthest that a view may lie from the projection of its landmark
  std::size_t dropped = 0;  ///< views that lay farther
  std::size_t added = 0;    ///< views that were found in the images
};

/// tutti's map is held by depth, by the weights of its views and by robust losses. A program that gets
/// keyframes and tracks alone, and takes all views for equally good (COLMAP's bundle adjustment), would tear
/// at it. So (1) views are dropped that lie farther from the projection of their landmark than three times
/// the median of these distances (3.5 standard deviations if they are normal), but no less than 0.5 px. And
/// (2) since keyframes lie far apart and corners are not found again in all of them, landmarks are looked for
/// in the images of all `chosen` keyframes (indices of the model's) that should show them: by optical flow
/// (Lucas-Kanade with pyramids), from the view with the most similar line of sight (at most 40 degrees off),
/// with the projection as the start. What lies as near to the projection, and leads back to where it came
/// from within 0.1 px, becomes a view. Poses, positions and ModelLandmark::observations stay as they are.
TrackChanges RefineTracks(const KeyframeImages& images, const std::vector<std::size_t>& chosen,
                          MapModel* model);

}  // namespace tutti
