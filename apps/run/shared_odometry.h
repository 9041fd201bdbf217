// Several ways to close loops on one odometry, which is tracked once.
//
// In `tutti run` a closed loop moves the map, and tracking goes on from there: two ways to find loops then
// have two odometries as well, and lost frames are looked up in the loop detector. Here neither happens. The
// detector gets the same queries as in a run of its own (images, features and points of the keyframes once
// they were mapped), so until the first verified loop it gives the same answers, byte for byte; its loops are
// measured against the finished map, and corrections move that map alone.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "apps/run/runner.h"
#include "tutti/frontend/odometry.h"

namespace tutti {

/// A sequence that was tracked without loops.
struct TrackedSequence {
  /// A frame that became a keyframe.
  struct Keyframe {
    int id = -1;
    double stamp_s = 0;       ///< of the input frame
    std::int64_t frames = 0;  ///< that were read when all its landmarks were known
  };
  RunResult result;
  std::shared_ptr<const Odometry> odometry;  ///< null if there is no calibration
  std::vector<Keyframe> keyframes;
  std::map<int, KeyframeView> views;  ///< of the keyframes at that moment, by id
};

/// RunSlam without loops, with its files in request.out; what loop closure needs is kept. Throws as RunSlam.
TrackedSequence TrackSequence(RunRequest request, RunConfig config);

/// Closes loops on it and writes what RunSlam writes into request.out. Images of keyframes are read again.
/// Times and processor time are those of the tracking plus those of the loops. Throws as RunSlam, and
/// InputError if the sequence has no odometry.
RunResult CloseLoops(const TrackedSequence& tracked, const RunRequest& request, const RunConfig& config);

}  // namespace tutti
