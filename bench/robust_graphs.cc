// How many false loops does a robust loss stand? One line of CSV:
//   build/release/bench/robust_graphs GRAPH.g2o LOSS COUNT CLUSTER_SIZE SEED
// The graph is solved as it is by least squares (the clean solution). Then COUNT false loops are planted, in
// clusters of CLUSTER_SIZE that agree with each other (false_loops.h; COUNT "50%": so many that they are this
// share of all loops, as online benchmarks count outliers), and it is solved again with LOSS, by
// the block solver, from the best of all starts. Columns: graph, loss, count, cluster size, seed, ATE against
// the clean solution as a share of its bounding box' diagonal [%], precision and recall of the loops that
// were kept, processor time [s].
#include <algorithm>
#include <cmath>
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

PoseGraphReport Solve(PoseGraph& graph, const std::string& loss) {
  PoseGraphOptions options;
  options.objective = GraphObjective::kChi2;
  options.solver = PoseGraphSolver::kBlock;
  options.robust = ParseRobustLoss(loss);
  return PoseGraphOptimizer(options).Optimize(graph);
}

int CountOf(const std::string& text, const PoseGraph& graph) {
  if (text.empty() || text.back() != '%') return std::atoi(text.c_str());
  const double share = std::atoi(text.c_str()) / 100.0;
  const auto loops = std::count_if(graph.edges().begin(), graph.edges().end(),
                                   [](const PoseGraphEdge& edge) { return edge.kind == EdgeKind::kLoop; });
  return static_cast<int>(std::lround(static_cast<double>(loops) * share / (1 - share)));
}

void Run(const std::filesystem::path& file, const std::string& loss, const std::string& count,
         FalseLoopOptions loops) {
  PoseGraph clean = ReadG2o(file).graph;
  loops.count = CountOf(count, clean);
  Solve(clean, "none");
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
  const PoseGraphReport report = Solve(start, loss);
  const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  double kept[2] = {0, 0}, all[2] = {0, 0};  // true loops, false ones
  for (std::size_t e = 0; e < graph.edges().size() && report.success; ++e) {
    if (graph.edges()[e].kind != EdgeKind::kLoop) continue;
    const std::size_t which = wrong.count(e);
    all[which] += 1;
    kept[which] += report.edges[e].down_weighted ? 0 : 1;
  }
  std::printf("%s,%s,%s,%d,%llu,%.6g,%.5f,%.5f,%.2f\n", file.stem().c_str(), loss.c_str(), count.c_str(),
              loops.cluster_size, static_cast<unsigned long long>(loops.seed),
              100 * AlignedError(clean, start) / BoundingBoxDiagonal(clean),
              kept[0] / std::max(1.0, kept[0] + kept[1]), kept[0] / std::max(1.0, all[0]), seconds);
}

}  // namespace
}  // namespace tutti

int main(int argc, char** argv) {
  if (argc != 6) {
    std::fprintf(stderr, "usage: robust_graphs GRAPH.g2o LOSS COUNT CLUSTER_SIZE SEED\n");
    return 1;
  }
  try {
    tutti::FalseLoopOptions loops;
    loops.cluster_size = std::atoi(argv[4]);
    loops.seed = std::strtoull(argv[5], nullptr, 10);
    tutti::Run(argv[1], argv[2], argv[3], loops);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "robust_graphs: %s\n", error.what());
    return 1;
  }
  return 0;
}
