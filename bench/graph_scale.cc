// Time and memory of a large generated graph: build/release/bench/graph_scale POSES [SEED]
// [block|ceres] [chordal|odometry]
// A robot sweeps a square hall row by row: an odometry edge to the pose before and two loops to the row
// before, so 3 edges per pose. Prints CSV: poses, edges, initialisation [s], all [s], iterations, chi2 per
// edge, peak memory before and after [MB].
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <random>
#include <string>

#include "bench/noisy_measurement.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {
namespace {

constexpr bench::Noise kNoise{0.05, 0.01};

PoseGraph MakeSweep(int poses, unsigned seed) {
  std::mt19937 random(seed);
  const int row = static_cast<int>(std::lround(std::sqrt(poses)));
  std::vector<Similarity> truth;
  for (int k = 0; k < poses; ++k) {
    const int y = k / row, along = k % row;
    const bool back = y % 2 != 0;
    truth.emplace_back(1.0, ExpSO3({0, 0, back ? M_PI : 0.0}),
                       Eigen::Vector3d(back ? row - 1 - along : along, y, 0));
  }
  PoseGraph graph;
  for (int k = 0; k < poses; ++k) graph.AddNode(PoseGraphNode{k, Similarity(), k == 0, false});
  const Matrix7d information = MakeInformation(kNoise.translation, kNoise.rotation);
  const auto at = [&](int k) { return truth[static_cast<std::size_t>(k)]; };
  for (int k = 1; k < poses; ++k)
    graph.AddOdometry(k - 1, k, bench::Measured(at(k - 1), at(k), kNoise, random), information);
  for (int k = row; k < poses; ++k) {
    const int below = 2 * row * (k / row) - 1 - k;  // the same place one row before
    for (int other : {below, below - 1}) {
      if (other >= 0 && other + 1 < k)
        graph.AddLoop(other, k, bench::Measured(at(other), at(k), kNoise, random), information);
    }
  }
  return graph;
}

/// Peak resident memory of this process [MB]; 0 where /proc is not there.
double PeakMemory() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    double kilobytes = 0;
    if (word == "VmHWM:" && status >> kilobytes) return kilobytes / 1024;
  }
  return 0;
}

int Run(int argc, char** argv) {
  const int poses = argc > 1 ? std::atoi(argv[1]) : 0;
  if (poses < 100) {
    std::fprintf(stderr,
                 "usage: graph_scale POSES [SEED] [block|ceres] [chordal|odometry]   (at least 100 poses)\n");
    return 1;
  }
  PoseGraph graph = MakeSweep(poses, argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 1u);
  const double before = PeakMemory();
  PoseGraphOptions options;
  options.solver = ParsePoseGraphSolver(argc > 3 ? argv[3] : "block");
  options.init = ParseGraphInit(argc > 4 ? argv[4] : "chordal");
  const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(graph);
  if (!report.success) {
    std::fprintf(stderr, "graph_scale: %s\n", report.reason.c_str());
    return 1;
  }
  std::printf("%d,%zu,%.3f,%.3f,%d,%.4f,%.1f,%.1f\n", poses, graph.edges().size(), report.init_time_s,
              report.time_s, report.iterations,
              report.costs.chi2log / static_cast<double>(graph.edges().size()), before, PeakMemory());
  return 0;
}

}  // namespace
}  // namespace tutti

int main(int argc, char** argv) { return tutti::Run(argc, argv); }
