// Landmarks that two keyframes have in common, as the map has them.
#pragma once

#include <utility>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/frontend/odometry.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/loopclosure/detector_options.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

using LandmarkMatch = std::pair<int, int>;  ///< features of the candidate and of the query

/// Landmarks of both keyframes: what the verification matched, and the mutual best matches of the others.
std::vector<LandmarkMatch> LandmarkMatches(const Verification& verification, const KeyframeView& candidate,
                                           const KeyframeView& query);

/// Whether the query sees the candidate's landmarks: matches among the landmarks of both have to fit one
/// camera motion. That asks for fewer than the detector does, which searches everywhere; what is found is to
/// be confirmed by another loop. Accepted, it can be measured by MakeLoopConstraint. The share of the matches
/// and their spread over both images are asked for as there: by the detector's options.
Verification VerifyLandmarks(const KeyframeView& candidate, const KeyframeView& query, const CameraRig& rig,
                             const LoopDetectorOptions& detector);

}  // namespace tutti
#pragma GCC visibility pop
