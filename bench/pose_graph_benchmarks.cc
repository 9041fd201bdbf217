// Pose graphs of the data folder ($TUTTI_DATA/posegraphs, default ../shared/data/posegraphs):
//   build/release/bench/pose_graph_benchmarks
// Compare the processor times of rows of one run: the machine enters into all of them alike. Rows without
// "ceres" in the name are the block solver's.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <filesystem>

#include "bench/stock_ceres.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {
namespace {

PoseGraph Load(const std::string& name) {
  const char* data = std::getenv("TUTTI_DATA");
  const std::filesystem::path folder = data != nullptr ? data : "../shared/data";
  return ReadG2o(folder / "posegraphs" / (name + ".g2o")).graph;
}

void InProcessorTime(benchmark::internal::Benchmark* row) {
  row->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();
}

void StockCeres(benchmark::State& state, const std::string& name) {
  const PoseGraph start = Load(name);
  for (auto step : state) {
    PoseGraph graph = start;
    benchmark::DoNotOptimize(SolveWithStockCeres(graph));
    state.PauseTiming();
    state.counters["chi2"] = EvaluateCosts(graph).chi2;
    state.ResumeTiming();
  }
}
BENCHMARK_CAPTURE(StockCeres, sphere2500, "sphere2500")->Apply(InProcessorTime);
BENCHMARK_CAPTURE(StockCeres, torus3D, "torus3D")->Apply(InProcessorTime);
BENCHMARK_CAPTURE(StockCeres, parking_garage, "parking-garage")->Apply(InProcessorTime);

void Tutti(benchmark::State& state, const std::string& name, GraphInit init,
           PoseGraphSolver solver = PoseGraphSolver::kBlock) {
  const PoseGraph start = Load(name);
  PoseGraphOptions options;
  options.solver = solver;
  options.objective = GraphObjective::kChi2;
  options.init = init;
  const PoseGraphOptimizer optimizer(options);
  for (auto step : state) {
    PoseGraph graph = start;
    const PoseGraphReport report = optimizer.Optimize(graph);
    state.counters["chi2"] = report.costs.chi2;
    state.counters["init_ms"] = 1e3 * report.init_time_s;
    state.counters["iterations"] = report.iterations;
  }
}
BENCHMARK_CAPTURE(Tutti, sphere2500, "sphere2500", GraphInit::kChordal)->Apply(InProcessorTime);
BENCHMARK_CAPTURE(Tutti, sphere2500_ceres, "sphere2500", GraphInit::kChordal, PoseGraphSolver::kCeres)
    ->Apply(InProcessorTime);
BENCHMARK_CAPTURE(Tutti, sphere2500_auto, "sphere2500", GraphInit::kAuto)->Apply(InProcessorTime);
BENCHMARK_CAPTURE(Tutti, parking_garage, "parking-garage", GraphInit::kChordal)->Apply(InProcessorTime);
BENCHMARK_CAPTURE(Tutti, torus3D, "torus3D", GraphInit::kChordal)->Apply(InProcessorTime);
BENCHMARK_CAPTURE(Tutti, manhattan, "manhattan", GraphInit::kChordal)->Apply(InProcessorTime);
BENCHMARK_CAPTURE(Tutti, manhattanOlson3500, "manhattanOlson3500", GraphInit::kChordal)
    ->Apply(InProcessorTime);
BENCHMARK_CAPTURE(Tutti, intel, "intel", GraphInit::kChordal)->Apply(InProcessorTime);
BENCHMARK_CAPTURE(Tutti, kitti_00, "kitti_00", GraphInit::kChordal)->Apply(InProcessorTime);

}  // namespace
}  // namespace tutti
