// Submaps that are still apart when a run ends: a last search for loops between them.
//
// While a run goes on, the loop detector is asked once about each keyframe, by its image, when the keyframe
// is new: it has few landmarks then, and the newest places are no candidates. A submap of a few seconds often
// gets no loop that way. At the end all landmarks are known, and each keyframe can be compared with all
// others.
#pragma once

#include <cstdint>
#include <vector>

#include "apps/slam/loop_closer.h"
#include "apps/slam/map_merge.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/config.h"

namespace tutti {

/// References stay valid as long as it is used; nothing may be on its way.
class SubmapJoiner {
 public:
  /// `frames`: number of frames so far.
  SubmapJoiner(const RunConfig& config, std::int64_t frames, LoopCloser* loops, Odometry* odometry)
      : config_(config), frames_(frames), loops_(*loops), odometry_(*odometry) {}

  /// Compares the keyframes of each submap with those of the older submaps of the same recording. Loops that
  /// geometry verifies join two submaps under the rules of a merge (MapMerge::Close). The others change
  /// nothing. What was solved has entered the map on return.
  void Join();

 private:
  struct View;
  std::vector<MapMerge::Proposal> Search() const;
  std::vector<const View*> AlikeTo(const View& query, const std::vector<View>& views) const;

  const RunConfig& config_;
  std::int64_t frames_;
  LoopCloser& loops_;
  Odometry& odometry_;
};

}  // namespace tutti
