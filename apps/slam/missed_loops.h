// Loops that nobody proposed: where the map itself says that two keyframes stand side by side, though it
// knows only a long way between them.
//
// The detector proposes one place for each image. Where three drives meet (two recordings of a round, each
// ending where it began), or where it recognised nothing, ends stay open that the map nearly closes already.
// RTAB-Map calls the search for them proximity detection (Labbe & Michaud, J. Field Robotics 36, 2019).
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "tutti/backend/pose_graph.h"
#include "tutti/core/camera.h"
#include "tutti/frontend/odometry.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/loopclosure/detector_options.h"
#include "tutti/slam/slam_options.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// A keyframe as it stands in the map.
struct StandingKeyframe {
  int id = -1;
  int piece = 0;
  Pose T_world_camera;
  double depth = 0;  ///< median depth of what it sees; 0: it sees nothing
};

/// A keyframe, and older ones that may have been in the same place, the nearest first.
struct MissedLoop {
  int query = -1;
  std::vector<int> candidates;
};

/// A way over edges of a graph.
struct Way {
  double length = 0;
  int edges = 0;
};

/// The shortest ways from one node to the others that can be reached. Loops are edges, too, of no length.
std::map<int, Way> WaysFrom(int node, const PoseGraph& graph);

/// Pairs of keyframes of one piece that look the same way, so near that they see the same if the map has
/// drifted along the way between them as an odometry may, and so far along that way that a loop says much
/// more of it. Ascending by query. `graph`: keyframes, odometry edges and loops.
std::vector<MissedLoop> FindMissedLoops(const std::vector<StandingKeyframe>& keyframes,
                                        const PoseGraph& graph, const SlamOptions& options);

}  // namespace tutti
#pragma GCC visibility pop
