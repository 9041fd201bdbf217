// Times of single modules, on generated input: build/release/bench/tutti_benchmarks
#include <benchmark/benchmark.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "data/synthetic/synthetic_world.h"
#include "tutti/backend/pose_graph_optimizer.h"
#include "tutti/loopclosure/detector.h"

namespace tutti {
namespace {

// A ring of n poses whose odometry turns a little too much, closed by one loop.
PoseGraph Ring(int n, GraphKind kind) {
  PoseGraph graph(kind);
  const double turn = 6.283185307179586 / n;
  const Similarity step(Pose(ExpSO3({0, turn, 0}), {0, 0, 1}));
  const Similarity drifting(Pose(ExpSO3({0, 1.02 * turn, 0}), {0, 0, 1.01}));
  const Matrix7d information = MakeInformation(0.05, 0.01, 0.01);
  Similarity pose;
  for (int i = 0; i < n; ++i) {
    graph.AddNode(i, pose, i == 0);
    pose = pose * drifting;
  }
  for (int i = 0; i + 1 < n; ++i) graph.AddOdometry(i, i + 1, drifting, information);
  graph.AddLoop(n - 1, 0, step, information);
  return graph;
}

void OptimizePoseGraph(benchmark::State& state) {
  const PoseGraph start =
      Ring(static_cast<int>(state.range(0)), state.range(1) != 0 ? GraphKind::kSim3 : GraphKind::kSE3);
  PoseGraphOptions options;
  options.init = GraphInit::kFile;
  const PoseGraphOptimizer optimizer(options);
  for (auto step : state) {
    PoseGraph graph = start;
    benchmark::DoNotOptimize(optimizer.Optimize(graph));
  }
}
BENCHMARK(OptimizePoseGraph)->Args({100, 0})->Args({1000, 0})->Args({1000, 1})->Unit(benchmark::kMillisecond);

// The whole detector on a growing map: extraction, three vocabularies, three filters, verification.
void DetectLoop(benchmark::State& state) {
  SyntheticOptions options;
  options.supersample = 1;
  options.frames = 20;
  const SyntheticWorld world(options);
  std::vector<cv::Mat> images;
  for (std::size_t i = 0; i < world.Size(); ++i) images.push_back(world.Render(i).image);
  LoopDetectorOptions detector_options;
  detector_options.threads = static_cast<int>(state.range(0));
  LoopDetector detector(detector_options);
  std::int64_t id = 0;
  for (auto step : state) {
    LoopQuery query;
    query.id = id;
    query.image = images[static_cast<std::size_t>(id) % images.size()];
    benchmark::DoNotOptimize(detector.Detect(query));
    ++id;
  }
}
BENCHMARK(DetectLoop)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->Iterations(100);

}  // namespace
}  // namespace tutti
