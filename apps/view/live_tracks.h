// The features that the odometry follows, with where they were in the last few frames.
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "tutti/frontend/odometry.h"

namespace tutti::view {

/// What each of the last frames shows of the map, newest first; copies share it.
using LiveTrail = std::deque<std::shared_ptr<const std::vector<SeenLandmark>>>;
constexpr std::size_t kTrailFrames = 11;  ///< the newest one and those that the tails are of

/// Puts the newest frame before the others; the oldest one falls out.
void ExtendTrail(std::vector<SeenLandmark> seen, LiveTrail* trail);

/// Pixels of one landmark, newest first: in the newest frame, then in those before that show it.
using LiveTrack = std::vector<cv::Point2f>;

/// Tracks of landmarks in the newest frame, at most `most`. Which ones depends on their ids, so that they
/// stay the same from frame to frame as far as possible.
std::vector<LiveTrack> TracksOf(const LiveTrail& trail, std::size_t most);

}  // namespace tutti::view
