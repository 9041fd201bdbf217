// How far are true loops off, and how near are false ones? One line of CSV per graph:
//   build/release/bench/loop_evidence FIRST_SEED LAST_SEED GRAPH.g2o...
// Each graph is solved by least squares (chi2log). Then for each of its loops the chi-square against the
// solution without it (leave_one_out.h), for each of 100 planted false loops a seed the same from outside
// (graph_covariance.h), both over the 99 % quantile for the noise that the loops show (their median).
// Columns: graph, loops, that noise's variance as a share of the promised one, loops beyond 1, 3 and 5 sigma
// on top of the quantile (ratio beyond 1, 9, 25), largest ratio of a true loop, least of a false one.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <limits>
#include <vector>

#include "backend/graph/false_loops.h"
#include "backend/robust/leave_one_out.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/graph_covariance.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

template <int N>
std::vector<double> OfTrueLoops(const PoseGraph& graph) {
  const internal::GraphStructure structure = internal::AnalyseGraph(graph);
  const PoseGraphOptions options;
  internal::GraphProblem<N> problem(graph, structure, options);
  std::vector<Similarity> poses;
  for (const PoseGraphNode& node : graph.nodes()) poses.push_back(node.pose);
  problem.SetPoses(poses);
  const internal::LeaveOneOut<N> without(problem, graph.edges().size());
  std::vector<double> out;
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    if (problem.IsLoop(e)) out.push_back(without.Chi2(e));
  }
  std::sort(out.begin(), out.end());
  return out;
}

double LeastOfFalseLoops(const PoseGraph& clean, int first, int last) {
  const GraphCovariance covariance(clean);
  double least = std::numeric_limits<double>::infinity();
  FalseLoopOptions loops;
  for (int seed = first; seed <= last; ++seed) {
    loops.seed = static_cast<std::uint64_t>(seed);
    PoseGraph graph = clean;
    for (const std::size_t e : PlantFalseLoops(graph, loops))
      least = std::min(least, covariance.SquaredDistance(graph.edges()[e]));
  }
  return least;
}

void Run(const std::filesystem::path& file, int first, int last) {
  PoseGraph graph = ReadG2o(file).graph;
  PoseGraphOptimizer().Optimize(graph);
  const bool planar = graph.kind() == GraphKind::kSE2;
  const int freedom = planar ? 3 : 6;
  const std::vector<double> chi2 = planar ? OfTrueLoops<3>(graph) : OfTrueLoops<6>(graph);
  if (chi2.empty()) throw InputError(file.string() + ": has no loop");
  const double shown = chi2[chi2.size() / 2] / internal::ChiSquareMedian(freedom);
  const double unit = shown * internal::ChiSquare99(freedom);
  const auto beyond = [&](double sigmas) {
    return chi2.end() - std::upper_bound(chi2.begin(), chi2.end(), sigmas * sigmas * unit);
  };
  std::printf("%s,%zu,%.3g,%td,%td,%td,%.3g,%.3g\n", file.stem().c_str(), chi2.size(), shown, beyond(1),
              beyond(3), beyond(5), chi2.back() / unit, LeastOfFalseLoops(graph, first, last) / unit);
  std::fflush(stdout);
}

int Run(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "usage: loop_evidence FIRST_SEED LAST_SEED GRAPH.g2o...\n");
    return 1;
  }
  try {
    for (int k = 3; k < argc; ++k) Run(argv[k], std::atoi(argv[1]), std::atoi(argv[2]));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "loop_evidence: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace tutti

int main(int argc, char** argv) { return tutti::Run(argc, argv); }
