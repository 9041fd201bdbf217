// The back end alone, from an installed tutti: a square with one loop.
#include <tutti/backend/pose_graph.h>
#include <tutti/backend/pose_graph_optimizer.h>

#include <cmath>
#include <cstdio>

int main() {
  const double quarter = 1.5707963267948966;
  const tutti::Pose step(tutti::ExpSO3({0, 0, quarter}), {1, 0, 0});
  tutti::PoseGraph graph;
  tutti::Pose pose;
  for (int i = 0; i < 4; ++i) {
    graph.AddNode(i, pose, i == 0);
    pose = pose * tutti::Pose(step.rotation, {1.1, 0, 0});  // an odometry that goes too far
  }
  const tutti::Matrix7d information = tutti::MakeInformation(0.1, 0.01);
  for (int i = 0; i < 3; ++i) graph.AddOdometry(i, i + 1, tutti::Similarity(step), information);
  graph.AddLoop(3, 0, tutti::Similarity(step), information);
  const tutti::PoseGraphReport report = tutti::PoseGraphOptimizer().Optimize(graph);
  std::printf("chi2 %g -> %g, %s\n", report.initial_costs.chi2log, report.costs.chi2log,
              report.termination.c_str());
  return report.success && report.costs.chi2log < 1e-6 ? 0 : 1;
}
