// What a feature says about a point.
#pragma once

#include "frontend/features/features.h"
#include "frontend/geometry/pose_solver.h"
#include "tutti/frontend/map.h"

namespace tutti {

/// A point as a feature sees it. `pixel_sigma`: of the feature [px].
inline PointObservation Measured(const FrameFeatures& features, int feature, const Eigen::Vector3d& point,
                                 double pixel_sigma) {
  const std::size_t f = static_cast<std::size_t>(feature);
  PointObservation o;
  o.point = point;
  o.pixel = {features.keypoints[f].pt.x, features.keypoints[f].pt.y};
  o.pixel_sigma = pixel_sigma;
  o.inverse_depth = features.inverse_depth[f];
  o.inverse_depth_sigma = o.inverse_depth > 0 ? features.inverse_depth_sigma[f] : 0;
  return o;
}

/// A landmark as a feature sees it. `view`: which feature, keyframe -1 for a frame that is none.
/// `pixel_sigma`: of a corner at level 0 (OdometryOptions).
inline PointObservation Measured(const Map& map, const FrameFeatures& features, const Observation& view,
                                 int landmark, double pixel_sigma) {
  return Measured(features, view.feature, map.landmark(landmark).position,
                  pixel_sigma * map.RelativeSigma(features, view.keyframe, view.feature, landmark));
}

}  // namespace tutti
