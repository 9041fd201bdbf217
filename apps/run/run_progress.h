// How far a run has come, beside what its SlamSystem knows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "apps/run/run_result.h"

namespace tutti {

/// What a checkpoint holds of it.
struct RunProgress {
  std::size_t next = 0;                           ///< position in the data set that comes next
  std::set<std::size_t> dropped;                  ///< positions
  std::map<std::int64_t, std::size_t> positions;  ///< of the input frames, by their index
  std::string state;                              ///< of the tracking, for the terminal
  bool lost_open = false;                         ///< the last stretch of RunResult::lost goes on
  double read_ms = 0, extract_ms = 0;             ///< of the thread that reads ahead
  double read_wait_ms = 0;                        ///< of the one that tracks for that one
  double wall_s = 0, cpu_s = 0;                   ///< up to here, of all processes of this run

  template <class Archive>
  void State(Archive& archive) {
    archive(next, dropped, positions, state, lost_open, read_ms, extract_ms, read_wait_ms, wall_s, cpu_s);
  }
};

template <class Archive>
void State(Archive& archive, StampedPose& pose) {
  archive(pose.stamp_s, pose.pose);
}

template <class Archive>
void State(Archive& archive, BadFrame& bad) {
  archive(bad.index, bad.error);
}

template <class Archive>
void State(Archive& archive, LostStretch& lost) {
  archive(lost.first, lost.last, lost.state, lost.reason);
}

template <class Archive>
void State(Archive& archive, FoundFrame& found) {
  archive(found.index, found.stamp_s, found.by_loop);
}

/// What a result has already while the run goes on.
template <class Archive>
void StateOfGrowing(Archive& archive, RunResult& result) {
  archive(result.frames_lost, result.frames_without_mask, result.frames_without_depth, result.bad,
          result.bad_depth, result.lost, result.found, result.frame_ms, result.latency_ms,
          result.frame_inliers, result.frames_by_grey_values);
}

}  // namespace tutti
