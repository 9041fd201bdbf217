// From what the detector verified to an edge of the pose graph.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tutti/backend/keyframe_graph.h"
#include "tutti/frontend/odometry.h"
#include "tutti/loopclosure/detector.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// Least standard deviations of a loop: the errors of matched points of one scene are not independent, so
/// the inliers alone promise too much. Rotation [deg], translation as a share of the median scene depth, one
/// camera's log(scale).
inline constexpr double kLoopSigmaDeg = 0.3, kLoopSigmaFraction = 0.01, kLoopSigmaScale = 0.02;

/// One camera: two views farther apart than this share of the median scene depth see too little in common to
/// fix a scale.
inline constexpr double kMostLoopApart = 0.5;

/// The edge, or why there is none.
struct LoopConstraint {
  bool usable = false;
  std::string reason;  ///< in plain words, if not usable
  LoopEdge edge;
};

/// Metric sensors: the rigid transform of the verification, or where that had no depths the one of the
/// landmarks that both keyframes see (VerifyLandmarks). Mono: the similarity between the landmarks of the two
/// keyframes as the map has them now (more and better ones than when the keyframe was new), over the features
/// that the verification matched. The covariance is the verification's plus the floor above. Fills everything
/// of the edge but `record`.
LoopConstraint MakeLoopConstraint(const Verification& verification, const KeyframeView& candidate,
                                  const KeyframeView& query, const CameraRig& rig,
                                  const LoopDetectorOptions& detector);

/// The verification with candidate and query exchanged: what another detector found, which knew the newer
/// keyframe. `candidate`: id of what is the candidate then.
Verification Reversed(const Verification& verification, std::int64_t candidate);

/// Median z of the keyframe's points; 0 if it has none.
double MedianDepth(const KeyframeView& view);

}  // namespace tutti
#pragma GCC visibility pop
