// Of the views along a path that show a query's place, the nearest. Internal.
#pragma once

#include <functional>

#include "loopclosure/geometry/verification.h"
#include "loopclosure/memory/location_memory.h"

namespace tutti::internal {

/// Verifies the query with the location in a slot; a slot may be asked for again.
using LookAtSlot = std::function<const Verification&(int)>;

/// From `start`, the slot of an accepted view, along the stored path to the view that is nearest to the query
/// (docs/loop-closure.md section 5), mostly by three or four looks: two views of the path tell how far off
/// the nearest is. `start` where nothing nearer is found.
int FindNearestView(const View& query, int start, const LocationMemory& memory,
                    const std::function<const View&(int)>& view_of, const LookAtSlot& look);

}  // namespace tutti::internal
