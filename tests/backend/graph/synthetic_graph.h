// Pose graphs with a known answer.
#pragma once

#include <memory>
#include <random>
#include <string>
#include <vector>

#include "backend/solver/graph_problem.h"
#include "tutti/backend/pose_graph.h"

namespace tutti::testing {

constexpr GraphKind kGraphKinds[] = {GraphKind::kSE2, GraphKind::kSE3, GraphKind::kSim3};

struct SyntheticGraphOptions {
  GraphKind kind = GraphKind::kSE3;
  int nodes = 120;                 ///< along two rounds of a circle, so that the second round meets the first
  double noise_translation = 0.0;  ///< standard deviation per odometry edge [m]
  double noise_rotation = 0.0;     ///< [rad]
  double noise_log_scale = 0.0;    ///< kSim3 only
  int loops = 40;                  ///< true loops between the rounds
  int false_loops = 0;             ///< random wrong ones, added after the true ones
  unsigned seed = 1;
};

struct SyntheticGraph {
  PoseGraph graph;                       ///< poses: the odometry integrated
  std::vector<Similarity> truth;         ///< by node id
  std::vector<std::size_t> false_edges;  ///< positions in graph.edges()
};

/// With noise on the edges; `rotation` [rad] is that of the logarithm of the scale as well.
SyntheticGraphOptions NoisyOptions(GraphKind kind, double translation, double rotation);

/// Its one edge costs more than a double holds.
PoseGraph OverflowingGraph();

SyntheticGraph MakeSyntheticGraph(const SyntheticGraphOptions& options);

/// Root mean square distance of the nodes from the truth [m].
double PositionError(const PoseGraph& graph, const std::vector<Similarity>& truth);

/// S_world_node in the order of the nodes.
std::vector<Similarity> PosesOf(const PoseGraph& graph);

/// The graph without estimates of its nodes.
PoseGraph WithoutPoses(const PoseGraph& graph);

/// "parking-garage" as the name of a test.
std::string TestName(std::string name);

/// A graph as the problem that solvers see, at its poses.
struct ProblemAtPoses {
  explicit ProblemAtPoses(PoseGraph of, const PoseGraphOptions& with = {});

  const PoseGraph graph;
  const PoseGraphOptions options;
  const internal::GraphStructure structure;
  const std::unique_ptr<internal::GraphProblem> problem;
};

/// Standard normal, with the same numbers on every platform.
double Gauss(std::mt19937& random);

/// A random similarity (scale 1 unless kSim3; planar for kSE2).
Similarity RandomPose(GraphKind kind, std::mt19937& random, double translation, double rotation);

/// A random positive definite matrix with strong off-diagonal terms.
Matrix7d RandomInformation(std::mt19937& random);

/// By Eigen. Compiled once: its templates take as long as the rest of a test.
Eigen::MatrixXd DenseInverse(const Eigen::MatrixXd& matrix);

}  // namespace tutti::testing
