// Which of the loops between two maps join them: what many places say, not what was found first.
//
// Two streets may look alike, and then several images of the one agree with each other that they show the
// other. Where two maps are apart, nothing but other loops can contradict that. So all of them are gathered
// first; those that mean the same transform between the maps are a set, and the largest set joins, if no
// other one comes near. Pairwise consistency as of Mangelson et al., ICRA 2018; but sets are connected, not
// complete: drift leads apart what the two ends of a long common way say, though each step agrees.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "apps/slam/loop_gate.h"
#include "tutti/backend/pose_graph.h"
#include "tutti/slam/slam_options.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

struct JoiningLoops {
  std::vector<std::size_t> chosen;   ///< numbers of the loops that join, ascending; empty: none do
  std::vector<std::string> reasons;  ///< of each loop that stays outside, in plain words; empty: it joins
  std::string reason;                ///< why none joins, with the counts
};

/// `loops`: between pieces of two maps. `map`: their keyframes, each piece in a frame of its own. `graph`:
/// keyframes and edges within the maps.
///
/// Two loops agree if the cycle over them and both maps closes within what one loop may differ from the next
/// (loop_agree_*) and three standard deviations of the drift of both maps between their ends. A set has at
/// least loop_confirmations loops. It counts by its places: loops whose ends stand apart, at both ends, by
/// more than the median scene depth, since images of one place that are fooled are fooled together. The
/// largest set of each pair of pieces joins if it has at least twice as many places as the next one: a
/// likeness ends somewhere, the common way goes on.
JoiningLoops ChooseJoiningLoops(const std::vector<LoopEdge>& loops, const LoopGate::Places& map,
                                const PoseGraph& graph, const SlamOptions& options);

}  // namespace tutti
#pragma GCC visibility pop
