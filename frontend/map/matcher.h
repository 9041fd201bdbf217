// Data association of ORB features: by projection into a predicted view, along epipolar lines, or
// exhaustively.
#pragma once

#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "frontend/features/features.h"
#include "tutti/core/camera.h"
#include "tutti/frontend/map.h"

namespace tutti {

/// Distances in bits: a match below kStrict is almost surely right; above kLoose it is noise.
constexpr int kStrictDistance = 50;
constexpr int kLooseDistance = 100;

/// Features of a frame that is being tracked.
struct FrameMatches {
  const FrameFeatures* features = nullptr;
  std::vector<int> landmarks;  ///< per feature: landmark id or -1
};

/// Landmarks of the last frame, projected with the predicted pose. `radius_px` at pyramid level 0. Adds to
/// current->landmarks; returns the number of matches. Matches that turn unlike the majority are dropped.
int MatchToLastFrame(const Map& map, const PinholeCamera& camera, const Pose& T_camera_world,
                     const FrameMatches& last, float radius_px, FrameMatches* current);

/// Landmarks of the local map, projected with a good pose. Counts those that should be visible in `visible`.
int MatchToLandmarks(const Map& map, const PinholeCamera& camera, const Pose& T_camera_world,
                     const std::vector<int>& landmarks, float radius_factor, FrameMatches* current,
                     std::vector<int>* visible);

/// Exhaustive search among a keyframe's features that have a landmark (ratio test, mutual, consistent
/// orientation).
int MatchToKeyframe(const Map& map, const Keyframe& keyframe, FrameMatches* current);

/// Mono initialisation: pairs (feature of first, feature of second) near `centres` (one per feature of first;
/// updated).
std::vector<std::pair<int, int>> MatchTwoViews(const FrameFeatures& first, const FrameFeatures& second,
                                               float radius_px, std::vector<cv::Point2f>* centres);

/// Pairs of features without landmark that agree with the epipolar geometry of two keyframes.
std::vector<std::pair<int, int>> MatchEpipolar(const Map& map, const PinholeCamera& camera,
                                               const Keyframe& first, const Keyframe& second,
                                               double median_depth);

/// Finds landmarks again in a keyframe where they have no feature yet: pairs (landmark, feature).
/// `largest_error` of the feature's position [standard deviations of a corner].
std::vector<std::pair<int, int>> MatchForFusion(const Map& map, const PinholeCamera& camera,
                                                const Keyframe& keyframe, const std::vector<int>& landmarks,
                                                float largest_error);

}  // namespace tutti
