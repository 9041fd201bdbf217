#include "tests/backend/graph/synthetic_graph.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace tutti::testing {
namespace {

double Uniform(std::mt19937& random) { return (static_cast<double>(random()) + 0.5) / 4294967296.0; }
// z is drawn first: in the arguments of one call, which comes first would be the compiler's choice.
Eigen::Vector3d GaussVector(std::mt19937& random) {
  const double z = Gauss(random), y = Gauss(random), x = Gauss(random);
  return {x, y, z};
}

Similarity Noisy(const Similarity& s, const SyntheticGraphOptions& o, std::mt19937& random,
                 double factor = 1.0) {
  Similarity out = s;
  Eigen::Vector3d dt = GaussVector(random), dr = GaussVector(random);
  if (o.kind == GraphKind::kSE2) {
    dt.z() = 0;
    dr.x() = dr.y() = 0;
  }
  out.translation += factor * o.noise_translation * dt;
  out.rotation = out.rotation * ExpSO3(factor * o.noise_rotation * dr);
  if (o.kind == GraphKind::kSim3) out.scale *= std::exp(factor * o.noise_log_scale * Gauss(random));
  return out;
}

}  // namespace

// Not std::normal_distribution: its numbers differ between standard libraries.
double Gauss(std::mt19937& random) {
  const double u = Uniform(random), v = Uniform(random);
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * M_PI * v);
}

Similarity RandomPose(GraphKind kind, std::mt19937& random, double translation, double rotation) {
  Eigen::Vector3d t = GaussVector(random), r = GaussVector(random);
  const double scale = kind == GraphKind::kSim3 ? std::exp(0.3 * Gauss(random)) : 1.0;
  if (kind == GraphKind::kSE2) {
    t.z() = 0;
    r.x() = r.y() = 0;
  }
  return Similarity(scale, ExpSO3(rotation * r), translation * t);
}

Matrix7d RandomInformation(std::mt19937& random) {
  Matrix7d a;
  for (int r = 0; r < 7; ++r) {
    for (int c = 0; c < 7; ++c) a(r, c) = Gauss(random);
  }
  return a * a.transpose() + 0.5 * Matrix7d::Identity();
}

SyntheticGraphOptions NoisyOptions(GraphKind kind, double translation, double rotation) {
  SyntheticGraphOptions options;
  options.kind = kind;
  options.noise_translation = translation;
  options.noise_rotation = rotation;
  options.noise_log_scale = kind == GraphKind::kSim3 ? rotation : 0.0;
  return options;
}

PoseGraph OverflowingGraph() {
  PoseGraph graph;
  graph.AddNode(0, Pose());
  graph.AddNode(1, Pose(Eigen::Quaterniond::Identity(), {1e300, 0, 0}));
  graph.AddOdometry(0, 1, Similarity(), Matrix7d::Identity());
  return graph;
}

SyntheticGraph MakeSyntheticGraph(const SyntheticGraphOptions& o) {
  std::mt19937 random(o.seed);
  SyntheticGraph out;
  out.graph = PoseGraph(o.kind);
  const int round = o.nodes / 2;
  for (int k = 0; k < o.nodes; ++k) {
    const double angle = 2.0 * M_PI * k / round;
    Eigen::Vector3d t(20.0 * std::cos(angle), 20.0 * std::sin(angle), 2.0 * std::sin(3.0 * angle));
    if (o.kind == GraphKind::kSE2) t.z() = 0;
    Eigen::Quaterniond q = ExpSO3({0, 0, angle});
    if (o.kind != GraphKind::kSE2) q = q * ExpSO3({0.3 * std::sin(angle), 0.2, 0});
    // The odometry of a mono camera drifts in scale; the truth has scale 1.
    out.truth.push_back(Similarity(1.0, q, t));
  }
  const Matrix7d information =
      MakeInformation(std::max(1e-3, o.noise_translation), std::max(1e-3, o.noise_rotation),
                      std::max(1e-3, o.noise_log_scale));
  std::vector<Similarity> odometry;
  for (std::size_t k = 1; k < out.truth.size(); ++k) {
    odometry.push_back(Noisy(out.truth[k - 1].Inverse() * out.truth[k], o, random));
  }
  Similarity pose = out.truth[0];
  for (int k = 0; k < o.nodes; ++k) {
    if (k > 0) pose = pose * odometry[static_cast<std::size_t>(k - 1)];
    out.graph.AddNode(k, pose);
    if (k > 0) out.graph.AddOdometry(k - 1, k, odometry[static_cast<std::size_t>(k - 1)], information);
  }
  for (int k = 0; k < o.loops; ++k) {
    const std::size_t i = static_cast<std::size_t>(k * round / std::max(1, o.loops));
    const std::size_t j = i + static_cast<std::size_t>(round);
    out.graph.AddLoop(static_cast<int>(i), static_cast<int>(j),
                      Noisy(out.truth[i].Inverse() * out.truth[j], o, random), information);
  }
  for (int k = 0; k < o.false_loops; ++k) {
    const int i = static_cast<int>(random() % static_cast<unsigned>(o.nodes));
    const int j = (i + 5 + static_cast<int>(random() % static_cast<unsigned>(o.nodes - 10))) % o.nodes;
    out.false_edges.push_back(out.graph.edges().size());
    out.graph.AddLoop(i, j, RandomPose(o.kind, random, 8.0, 1.0), information);
  }
  return out;
}

double PositionError(const PoseGraph& graph, const std::vector<Similarity>& truth) {
  double sum = 0;
  for (const PoseGraphNode& node : graph.nodes()) {
    sum += (node.pose.translation - truth[static_cast<std::size_t>(node.id)].translation).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(graph.nodes().size()));
}

std::vector<Similarity> PosesOf(const PoseGraph& graph) {
  std::vector<Similarity> poses;
  for (const PoseGraphNode& node : graph.nodes()) poses.push_back(node.pose);
  return poses;
}

PoseGraph WithoutPoses(const PoseGraph& graph) {
  PoseGraph out(graph.kind());
  for (PoseGraphNode node : graph.nodes()) {
    node.has_estimate = false;
    out.AddNode(node);
  }
  for (const PoseGraphEdge& edge : graph.edges()) out.AddEdge(edge);
  return out;
}

std::string TestName(std::string name) {
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

ProblemAtPoses::ProblemAtPoses(PoseGraph of, const PoseGraphOptions& with)
    : graph(std::move(of)),
      options(with),
      structure(internal::AnalyseGraph(graph)),
      problem(internal::MakeGraphProblem(graph, structure, options)) {
  problem->SetPoses(PosesOf(graph));
}

Eigen::MatrixXd DenseInverse(const Eigen::MatrixXd& matrix) { return matrix.inverse(); }

}  // namespace tutti::testing
