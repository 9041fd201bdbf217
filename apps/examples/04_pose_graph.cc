// A pose graph in code: odometry around a square that does not close, one true loop, one false one.
//
//   find_package(tutti REQUIRED COMPONENTS backend)          # no OpenCV
//   target_link_libraries(my_robot PRIVATE tutti::backend)
#include <cstdio>

#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"
#include "tutti/core/error.h"

namespace {

constexpr int kSides = 4, kPerSide = 10;

// The odometry: steps of 1 m with a quarter turn at each corner. It measures 1 % too far and turns 1 degree
// too little.
tutti::Similarity Step(int k) {
  const double turn = k % kPerSide == 0 ? 1.5707963 - 0.0174533 : 0.0;
  return tutti::Similarity(1.0, tutti::ExpSO3({0, 0, turn}), {1.01, 0, 0});
}

int Run(const char* file) {
  tutti::PoseGraph graph(tutti::GraphKind::kSE3);
  const tutti::Matrix7d odometry = tutti::MakeInformation(0.03, 0.01);  // sigmas: 3 cm, 0.01 rad
  const tutti::Matrix7d loop = tutti::MakeInformation(0.05, 0.02);

  tutti::Similarity S_world_node;
  graph.AddNode(0, S_world_node, true);  // fixed: the world is where it starts
  for (int k = 1; k <= kSides * kPerSide; ++k) {
    S_world_node = S_world_node * Step(k);
    graph.AddNode(k, S_world_node);
    graph.AddOdometry(k - 1, k, Step(k), odometry);
  }
  const int last = kSides * kPerSide;
  graph.AddLoop(0, last, tutti::Similarity(), loop);  // it is back where it began
  graph.AddLoop(5, 25, tutti::Similarity(), loop);    // two opposite sides that look alike

  tutti::PoseGraphOptions options;
  options.robust = tutti::RobustLoss::kGnc;
  const tutti::PoseGraphReport report = tutti::PoseGraphOptimizer(options).Optimize(graph);
  if (!report.success) {
    std::fprintf(stderr, "no solution: %s\n", report.reason.c_str());
    return 1;
  }
  const Eigen::Vector3d before = S_world_node.translation, after = graph.Node(last).pose.translation;
  std::printf("%s after %d iterations\n", report.termination.c_str(), report.iterations);
  std::printf("the end is %.2f m from the start by odometry, %.2f m after optimisation\n", before.norm(),
              after.norm());
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    const tutti::PoseGraphEdge& edge = graph.edges()[e];
    if (edge.kind != tutti::EdgeKind::kLoop) continue;
    std::printf("loop %s -> %s: chi2 %.1f, weight %.2f%s\n", graph.NameOf(edge.from).c_str(),
                graph.NameOf(edge.to).c_str(), report.edges[e].chi2, report.edges[e].weight,
                report.edges[e].down_weighted ? " (rejected)" : "");
  }
  if (file != nullptr) tutti::WriteG2o(file, graph);  // for g2o_viewer and others
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Run(argc > 1 ? argv[1] : nullptr);
  } catch (const tutti::InputError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
