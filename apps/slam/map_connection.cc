#include "apps/slam/map_connection.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "apps/slam/landmark_matches.h"
#include "apps/slam/loop_constraint.h"
#include "apps/slam/missed_loops.h"
#include "frontend/map/fuse.h"
#include "tutti/slam/loop.h"

namespace tutti {

void MapConnection::Connect(int piece) {
  constexpr int kSearches = 4;     // a loop brings places together that were too far apart
  constexpr int kAdjustments = 4;  // with landmarks fused that now lie together
  for (int i = 0; i < kSearches && CloseMissedLoops() > 0; ++i) {
  }
  for (int i = 0; i < kAdjustments; ++i) {
    Map map = odometry_.map();
    FuseAll(map.rig().camera, &map);
    map.UpdateGeometry();
    odometry_.Replace(std::move(map));
    if (!Converge(piece)) break;
    loops_.Finish(&odometry_, frames_);
  }
}

// The whole submap is adjusted until it converges; what comes of it enters with Finish. False if a loop is
// not held together by landmarks: the adjustment would open it again.
bool MapConnection::Converge(int piece) {
  if (!config_.run.global_adjustment || !loops_.AllTied()) return false;
  loops_.adjuster_.Converge(odometry_, piece);
  return true;
}

// How many entered.
std::size_t MapConnection::CloseMissedLoops() {
  const auto accepted = [this] { return CountAccepted(loops_.loops()); };
  const std::size_t before = accepted();
  std::vector<StandingKeyframe> keyframes;
  for (const int id : odometry_.map().KeyframeIds()) {
    const KeyframeView view = ViewOf(odometry_.map(), id);
    keyframes.push_back({id, view.map_piece, view.T_world_camera, MedianDepth(view)});
  }
  for (const MissedLoop& loop : FindMissedLoops(keyframes, loops_.Graph(odometry_.map()), config_.run)) {
    const KeyframeView query = ViewOf(odometry_.map(), loop.query);
    for (const int candidate : loop.candidates) {
      if (offered_.count({candidate, loop.query}) != 0) break;
      const Verification found =
          VerifyLandmarks(ViewOf(odometry_.map(), candidate), query, odometry_.map().rig(), config_.loops);
      if (!found.accepted) continue;
      offered_.emplace(candidate, loop.query);
      loops_.AddLoop({candidate, loop.query, found, {}}, &odometry_, frames_);
      break;
    }
  }
  loops_.Finish(&odometry_, frames_);
  return accepted() - std::min(before, accepted());
}

}  // namespace tutti
