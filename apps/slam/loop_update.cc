#include "apps/slam/loop_update.h"

namespace tutti {

std::vector<int> Apply(const MapCorrection& correction, Odometry* odometry) {
  if (correction.adjustment) {
    odometry->FinishMapping();
    odometry->Enter(*correction.adjustment, correction.S_world_keyframe);
  } else if (!correction.S_world_keyframe.empty()) {
    odometry->ApplyCorrection(correction.S_world_keyframe, correction.merges);
  }
  std::vector<int> common;
  for (const LoopEdge& loop : correction.fused)
    common.push_back(odometry->FuseLoop(loop.candidate, loop.query, loop.S_candidate_query));
  return common;
}

}  // namespace tutti
