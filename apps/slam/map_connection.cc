#include "apps/slam/map_connection.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "apps/slam/landmark_matches.h"
#include "apps/slam/loop_constraint.h"
#include "apps/slam/missed_loops.h"
#include "frontend/map/fuse.h"
#include "tutti/slam/loop_record.h"

namespace tutti {

void MapConnection::Connect(int piece) {
  constexpr int kSearches = 4;     // a loop brings places together that were too far apart
  constexpr int kAdjustments = 4;  // with landmarks fused that now lie together
  for (int i = 0; i < kSearches && CloseMissedLoops() > 0; ++i) {
  }
  for (int i = 0; i < kAdjustments; ++i) {
    Map map = odometry_.map();
    FuseAll(rig_.camera, &map);
    map.UpdateGeometry();
    odometry_.Replace(std::move(map));
    if (!loops_.Converge(odometry_, piece)) break;
    Finish();
  }
}

// How many entered.
std::size_t MapConnection::CloseMissedLoops() {
  const auto accepted = [this] { return CountAccepted(loops_.closer().records()); };
  const std::size_t before = accepted();
  std::vector<StandingKeyframe> keyframes;
  for (const int id : odometry_.map().KeyframeIds()) {
    const KeyframeView view = ViewOf(odometry_.map(), id);
    keyframes.push_back({id, view.map_piece, view.T_world_camera, MedianDepth(view)});
  }
  for (const MissedLoop& loop : FindMissedLoops(keyframes, loops_.closer().Graph(odometry_), config_.run)) {
    const KeyframeView query = ViewOf(odometry_.map(), loop.query);
    for (const int candidate : loop.candidates) {
      if (offered_.count({candidate, loop.query}) != 0) break;
      const Verification found =
          VerifyLandmarks(ViewOf(odometry_.map(), candidate), query, rig_, config_.loops);
      if (!found.accepted) continue;
      offered_.emplace(candidate, loop.query);
      take_(loops_.ConsiderFound(found, candidate, loop.query, odometry_, frames_));
      break;
    }
  }
  Finish();
  return accepted() - std::min(before, accepted());
}

void MapConnection::Finish() {
  while (const auto update = loops_.Rest(&odometry_, frames_)) take_(*update);
}

}  // namespace tutti
