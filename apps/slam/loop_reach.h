// Whether a camera can have been where a loop says, by the way that odometry has seen it go. Internal.
#pragma once

#include <string>

#include "tutti/backend/keyframe_graph.h"
#include "tutti/frontend/map.h"

namespace tutti {

/// Whether the way from the candidate to the query can have led where the loop says, with an odometry that is
/// bad. A house that looks like the one before is off by the whole way. True between map pieces.
bool InReach(const LoopEdge& loop, const Map& map);

/// Why the loop is none, whatever agrees with it; empty if it may be one. Walls that look alike agree with
/// each other for as long as they last. Within a piece, the loop is turned against the map by more than
/// odometry errs. Between two pieces, the camera would have had to jump while the tracking was lost.
std::string WhyImpossible(const LoopEdge& loop, const Map& map, Sensor sensor);

}  // namespace tutti
