// What a run left, to be compared bit by bit with what another one left.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "apps/slam/map_state.h"
#include "tutti/slam/slam_system.h"

namespace tutti::testing {

/// All that a run leaves, as bytes.
struct MapOutcome {
  std::string poses, loops, graph;
  int corrections = 0, adjustments = 0;
  std::vector<std::int64_t> frames;
};

/// Of a run that has tracked its last frame.
inline MapOutcome Finished(SlamSystem& slam) {
  slam.Finish();
  MapOutcome outcome;
  const Odometry& odometry = *slam.odometry();
  std::vector<std::pair<double, Pose>> poses;
  for (const StampedPose& pose : FrameTrajectory(odometry.map())) poses.emplace_back(pose.stamp_s, pose.pose);
  outcome.poses = StateOf(poses);
  outcome.loops = StateOf(slam.loops());
  const PoseGraph graph = slam.Graph();
  std::vector<std::pair<NodeId, Similarity>> nodes;
  for (const PoseGraphNode& node : graph.nodes()) nodes.emplace_back(node.id, node.pose);
  std::vector<Similarity> edges;
  for (const PoseGraphEdge& edge : graph.edges()) edges.push_back(edge.measurement);
  outcome.graph = StateOf(nodes) + StateOf(edges);
  outcome.corrections = slam.Report().corrections;
  outcome.adjustments = slam.Report().global_adjustments;
  outcome.frames = FrameIndices(odometry.map());
  return outcome;
}

inline void ExpectTheSame(const MapOutcome& a, const MapOutcome& b, const std::string& which) {
  EXPECT_EQ(a.frames, b.frames) << which;
  EXPECT_EQ(a.poses == b.poses, true) << which << ": other poses";
  EXPECT_EQ(a.loops == b.loops, true) << which << ": other loops";
  EXPECT_EQ(a.graph == b.graph, true) << which << ": another graph";
  EXPECT_EQ(a.corrections, b.corrections) << which;
  EXPECT_EQ(a.adjustments, b.adjustments) << which;
}

}  // namespace tutti::testing
