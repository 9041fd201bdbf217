// From what the detector verified to an edge of the pose graph.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tutti/backend/keyframe_graph.h"
#include "tutti/frontend/odometry.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/slam/slam_options.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// The edge, or why there is none.
struct LoopConstraint {
  bool usable = false;
  std::string reason;  ///< in plain words, if not usable
  LoopEdge edge;
};

/// Metric sensors: the rigid transform of the verification, or where that had no depths the one of the
/// landmarks that both keyframes see (VerifyLandmarks). Mono: the similarity between the landmarks of the two
/// keyframes as the map has them now (more and better ones than when the keyframe was new), over the features
/// that the verification matched. The covariance is the verification's plus a floor: matched points of one
/// scene share their errors, so inliers alone promise too much. Fills everything of the edge but `record`.
LoopConstraint MakeLoopConstraint(const Verification& verification, const KeyframeView& candidate,
                                  const KeyframeView& query, const CameraRig& rig, const SlamOptions& options,
                                  const LoopDetectorOptions& detector);

/// The same with candidate and query exchanged: what another detector found, which knew the newer keyframe.
/// `candidate`: id of what is the candidate then.
Verification Reversed(const Verification& verification, std::int64_t candidate);

/// Median z of the keyframe's points; 0 if it has none.
double MedianDepth(const KeyframeView& view);

}  // namespace tutti
#pragma GCC visibility pop
