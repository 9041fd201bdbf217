// How many false loops does each robust method stand? One line of CSV per run:
//   build/release/bench/robust_graphs GRAPH.g2o METHOD COUNT CLUSTER_SIZE FIRST_SEED LAST_SEED
// The graph is solved as it is by least squares (the clean solution). Then false loops are planted (COUNT of
// them, in clusters of CLUSTER_SIZE that agree with each other; false_loops.h) and it is solved again with
// METHOD, from the best of all starts. METHOD is a robust loss ("gnc"), with "pcm+" before it for pairwise
// consistency first, or "+sigma" behind it for the 3-sigma test after. Solved by the block solver
// (switchable: by Ceres). Columns: graph, method, count, cluster size, seed, ATE against the
// clean solution as a share of its bounding box' diagonal [%], precision and recall of the loops that were
// kept, processor time [s].
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "backend/graph/false_loops.h"
#include "tutti/backend/evaluation.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {
namespace {

double AlignedError(const PoseGraph& clean, const PoseGraph& graph) {
  AssociatedPoses poses;
  for (const PoseGraphNode& node : clean.nodes()) {
    poses.reference.push_back(node.pose.RigidPart());
    poses.estimate.push_back(graph.Node(node.id).pose.RigidPart());
  }
  const Similarity S = AlignPoses(poses, EvaluationOptions());
  std::vector<double> errors;
  for (std::size_t k = 0; k < poses.reference.size(); ++k)
    errors.push_back((poses.reference[k].translation - S * poses.estimate[k].translation).norm());
  return Summarize(errors).rmse;
}

PoseGraphOptions MethodOptions(std::string method) {
  const std::string before = "pcm+", after = "+sigma";
  PoseGraphOptions options;
  options.objective = GraphObjective::kChi2;
  options.solver = PoseGraphSolver::kBlock;
  if (method.rfind(before, 0) == 0) {
    options.pairwise_consistency = true;
    method.erase(0, before.size());
  }
  if (method.size() > after.size() && method.rfind(after) == method.size() - after.size()) {
    options.sigma_test = true;
    method.resize(method.size() - after.size());
  }
  options.robust = ParseRobustLoss(method);
  return options;
}

void Run(const std::filesystem::path& file, const std::string& method, const FalseLoopOptions& loops,
         const PoseGraph& clean) {
  PoseGraph graph = clean;
  const std::vector<std::size_t> planted = PlantFalseLoops(graph, loops);
  const std::set<std::size_t> wrong(planted.begin(), planted.end());
  // The optimum would be too good a start: the odometry is where a robot would start from.
  PoseGraph start(graph.kind());
  for (PoseGraphNode node : graph.nodes()) {
    node.has_estimate = false;
    start.AddNode(node);
  }
  for (const PoseGraphEdge& edge : graph.edges()) start.AddEdge(edge);
  const std::clock_t begin = std::clock();
  const PoseGraphReport report = PoseGraphOptimizer(MethodOptions(method)).Optimize(start);
  const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  double kept_true = 0, kept_false = 0, all_true = 0;
  for (std::size_t e = 0; e < graph.edges().size() && report.success; ++e) {
    if (graph.edges()[e].kind != EdgeKind::kLoop) continue;
    const bool is_false = wrong.count(e) != 0, kept = !report.edges[e].down_weighted;
    all_true += is_false ? 0 : 1;
    kept_true += kept && !is_false ? 1 : 0;
    kept_false += kept && is_false ? 1 : 0;
  }
  const double share = 100 * AlignedError(clean, start) / BoundingBoxDiagonal(clean);
  std::printf("%s,%s,%d,%d,%llu,%.6g,%.5f,%.5f,%.2f\n", file.stem().c_str(), method.c_str(), loops.count,
              loops.cluster_size, static_cast<unsigned long long>(loops.seed), share,
              kept_true / std::max(1.0, kept_true + kept_false), kept_true / std::max(1.0, all_true),
              seconds);
  std::fflush(stdout);
}

int Run(int argc, char** argv) {
  if (argc != 7) {
    std::fprintf(stderr, "usage: robust_graphs GRAPH.g2o METHOD COUNT CLUSTER_SIZE FIRST_SEED LAST_SEED\n");
    return 1;
  }
  try {
    const std::filesystem::path file = argv[1];
    FalseLoopOptions loops;
    loops.count = std::atoi(argv[3]);
    loops.cluster_size = std::atoi(argv[4]);
    PoseGraph clean = ReadG2o(file).graph;
    PoseGraphOptimizer(MethodOptions("none")).Optimize(clean);
    for (int seed = std::atoi(argv[5]); seed <= std::atoi(argv[6]); ++seed) {
      loops.seed = static_cast<std::uint64_t>(seed);
      Run(file, argv[2], loops, clean);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "robust_graphs: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace tutti

int main(int argc, char** argv) { return tutti::Run(argc, argv); }
