#include "backend/robust/pairwise_consistency.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cstdint>
#include <numeric>

#include "backend/solver/graph_initialization.h"
#include "backend/uncertainty/edge_covariance.h"

namespace tutti::internal {
namespace {

/// Odometry along the chain of consecutive nodes, and its uncertainty.
struct Chain {
  std::vector<Pose> T_world_node;
  std::vector<Matrix6d> covariance;  ///< of the way from the chain's start, in world coordinates
  std::vector<int> segment;          ///< nodes of different segments have no odometry between them
};

Chain FollowOdometry(const PoseGraph& graph, const GraphStructure& structure, GraphObjective objective) {
  const std::size_t n = graph.nodes().size();
  Chain chain;
  for (const Similarity& pose : OdometryInitialization(graph, structure))
    chain.T_world_node.push_back(pose.RigidPart());
  chain.covariance.assign(n, Matrix6d::Zero());
  chain.segment.assign(n, 0);
  std::vector<const PoseGraphEdge*> step(n, nullptr);  // from the node before
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    if (graph.edges()[e].kind == EdgeKind::kLoop) continue;
    const auto [low, high] = std::minmax(structure.ends[e].from, structure.ends[e].to);
    if (high == low + 1) step[high] = &graph.edges()[e];
  }
  for (std::size_t k = 1; k < n; ++k) {
    chain.segment[k] = chain.segment[k - 1] + (step[k] == nullptr ? 1 : 0);
    if (step[k] == nullptr) continue;
    const std::size_t to = graph.IndexOf(step[k]->to);
    chain.covariance[k] =
        chain.covariance[k - 1] +
        Transported(EdgeCovariance(*step[k], graph.kind(), objective), chain.T_world_node[to]);
  }
  return chain;
}

/// One loop, its covariance as a perturbation of the frame of its end `to`.
struct Loop {
  std::size_t edge = 0, from = 0, to = 0;
  Pose measurement;
  Matrix6d covariance;
};

bool Agree(const Chain& chain, GraphKind kind, const Loop& a, const Loop& b, double threshold) {
  if (chain.segment[a.from] != chain.segment[b.from] || chain.segment[a.to] != chain.segment[b.to])
    return true;
  const auto& T = chain.T_world_node;
  const Pose back = T[b.from].Inverse() * T[a.from];
  const Pose rest = b.measurement.Inverse() * back;
  const Pose E = LoopCycle(a.measurement, T[a.to].Inverse() * T[b.to], b.measurement, back);
  const auto between = [&](std::size_t i, std::size_t j, const Pose& T_target_world) {
    const Matrix6d way =
        i < j ? chain.covariance[j] - chain.covariance[i] : chain.covariance[i] - chain.covariance[j];
    return Transported(way, T_target_world);
  };
  const Matrix6d covariance = Transported(a.covariance, (T[a.to].Inverse() * T[b.to] * rest).Inverse()) +
                              Transported(b.covariance, rest.Inverse()) +
                              between(a.to, b.to, rest.Inverse() * T[b.to].Inverse()) +
                              between(b.from, a.from, T[a.from].Inverse());
  return Mahalanobis(LogSE3(E), covariance, kind) <= threshold;
}

/// Rows of bits.
class BitMatrix {
 public:
  explicit BitMatrix(std::size_t size) : words_((size + 63) / 64), bits_(size * words_, 0) {}
  void Set(std::size_t r, std::size_t c) { bits_[r * words_ + c / 64] |= std::uint64_t{1} << (c % 64); }
  bool Get(std::size_t r, std::size_t c) const { return (bits_[r * words_ + c / 64] >> (c % 64) & 1) != 0; }

 private:
  std::size_t words_;
  std::vector<std::uint64_t> bits_;
};

/// A large clique: from each of the best-connected vertices, those that agree with all taken so far.
std::vector<std::size_t> LargeClique(const BitMatrix& agrees, const std::vector<std::size_t>& degree) {
  constexpr std::size_t kStarts = 50;
  std::vector<std::size_t> order(degree.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return degree[a] > degree[b]; });
  std::vector<std::size_t> best;
  for (std::size_t start = 0; start < std::min(kStarts, order.size()); ++start) {
    std::vector<std::size_t> clique = {order[start]};
    for (const std::size_t v : order) {
      const bool fits = v != order[start] && std::all_of(clique.begin(), clique.end(),
                                                         [&](std::size_t u) { return agrees.Get(v, u); });
      if (fits) clique.push_back(v);
    }
    if (clique.size() > best.size()) best = std::move(clique);
  }
  return best;
}

}  // namespace

std::vector<bool> PairwiseConsistentEdges(const PoseGraph& graph, const GraphStructure& structure,
                                          GraphObjective objective, double threshold) {
  const Chain chain = FollowOdometry(graph, structure, objective);
  std::vector<bool> keep(graph.edges().size(), true);
  std::vector<Loop> loops;
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    const PoseGraphEdge& edge = graph.edges()[e];
    if (edge.kind != EdgeKind::kLoop) continue;
    keep[e] = false;
    loops.push_back({e, structure.ends[e].from, structure.ends[e].to, edge.measurement.RigidPart(),
                     EdgeCovariance(edge, graph.kind(), objective)});
  }
  BitMatrix agrees(loops.size());
  std::vector<std::size_t> degree(loops.size(), 0);
  for (std::size_t a = 0; a < loops.size(); ++a) {
    for (std::size_t b = a + 1; b < loops.size(); ++b) {
      if (!Agree(chain, graph.kind(), loops[a], loops[b], threshold)) continue;
      agrees.Set(a, b);
      agrees.Set(b, a);
      ++degree[a];
      ++degree[b];
    }
  }
  for (const std::size_t k : LargeClique(agrees, degree)) keep[loops[k].edge] = true;
  return keep;
}

}  // namespace tutti::internal
