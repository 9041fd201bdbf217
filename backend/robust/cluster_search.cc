#include "backend/robust/cluster_search.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <tuple>

#include "backend/solver/graph_initialization.h"
#include "backend/solver/robust_loss.h"
#include "backend/uncertainty/edge_prediction.h"

namespace tutti::internal {
namespace {

class ClusterGrowth {
 public:
  ClusterGrowth(GraphProblem& problem, const std::vector<LoopCluster>& clusters,
                const std::function<bool(int)>& solve_once)
      : problem_(problem),
        clusters_(clusters),
        solve_once_(solve_once),
        prediction_(MakeEdgePrediction(problem)) {}

  bool Grow() {
    problem_.SetLoss(nullptr);
    std::vector<std::size_t> waiting;
    for (std::size_t k = 0; k < clusters_.size(); ++k) {
      SetWeights(clusters_[k], 0);
      if (clusters_[k].size() > 1) waiting.push_back(k);
    }
    for (double gate = kFirstGate; !waiting.empty();) {
      if (!prediction_->Update()) return false;
      std::vector<std::size_t> joining = Certain(waiting, gate * problem_.threshold());
      const double widest = ShownShare(joined_chi2_, problem_.dimension());
      if (joining.empty() && gate >= widest) break;
      if (joining.empty()) gate = std::min(widest, kGateStep * gate);
      if (!joining.empty() && !Join(joining, waiting)) return false;
    }
    return WeighSingleLoops();
  }

 private:
  static constexpr double kFirstGate = 0.01, kGateStep = 3;  // shares of the threshold
  static constexpr int kIterations = 10;                     // of a solution between two rounds

  /// The half that the graph is more certain of, of the waiting clusters whose chi-square passes.
  std::vector<std::size_t> Certain(const std::vector<std::size_t>& waiting, double gate) {
    std::vector<std::tuple<double, double, std::size_t>> passing;  // spread, chi-square, cluster
    for (const std::size_t k : waiting) {
      const PredictedEdge predicted = Predicted(clusters_[k]);
      if (predicted.chi2 <= gate) passing.push_back({predicted.spread, predicted.chi2, k});
    }
    std::sort(passing.begin(), passing.end());
    std::vector<std::size_t> out;
    for (std::size_t k = 0; 2 * k < passing.size(); ++k) {
      joined_chi2_.push_back(std::get<1>(passing[k]));
      out.push_back(std::get<2>(passing[k]));
    }
    return out;
  }

  /// The median chi-square and the least spread of its first, middle and last loop.
  PredictedEdge Predicted(const LoopCluster& cluster) {
    const PredictedEdge middle = prediction_->Of(cluster[cluster.size() / 2]);
    if (cluster.size() == 2) return middle;
    const PredictedEdge first = prediction_->Of(cluster.front()), last = prediction_->Of(cluster.back());
    const double low = std::min(first.chi2, last.chi2), high = std::max(first.chi2, last.chi2);
    return {std::clamp(middle.chi2, low, high), std::min({first.spread, middle.spread, last.spread})};
  }

  bool Join(const std::vector<std::size_t>& joining, std::vector<std::size_t>& waiting) {
    for (const std::size_t k : joining) {
      SetWeights(clusters_[k], 1);
      waiting.erase(std::find(waiting.begin(), waiting.end(), k));
    }
    return solve_once_(kIterations) && (!DropMisfits() || solve_once_(kIterations));
  }

  /// Loops of weight 1 beyond the threshold leave; false if there are none.
  bool DropMisfits() {
    bool dropped = false;
    for (const LoopCluster& cluster : clusters_) {
      for (const std::size_t e : cluster) {
        if (problem_.weight(e) == 0 || problem_.EdgeChi2(e) <= problem_.threshold()) continue;
        problem_.SetWeight(e, 0);
        dropped = true;
      }
    }
    return dropped;
  }

  bool WeighSingleLoops() {
    for (const LoopCluster& cluster : clusters_) {
      if (cluster.size() == 1) SetWeights(cluster, 1);
    }
    problem_.SetLoss(new DcsLoss(problem_.threshold()));
    const bool solved = solve_once_(2 * kIterations);
    problem_.SetLoss(nullptr);
    return solved;
  }

  void SetWeights(const LoopCluster& cluster, double weight) {
    for (const std::size_t e : cluster) problem_.SetWeight(e, weight);
  }

  GraphProblem& problem_;
  const std::vector<LoopCluster>& clusters_;
  const std::function<bool(int)>& solve_once_;
  std::unique_ptr<EdgePrediction> prediction_;
  std::vector<double> joined_chi2_;  // of each cluster that has joined, before
};

class ClusterSearch {
 public:
  ClusterSearch(GraphProblem& problem, const PoseGraphOptions& options, RobustSolver& robust,
                const std::function<bool(int)>& solve_once)
      : problem_(problem), options_(options), robust_(robust), solve_once_(solve_once) {}

  bool Improve() {
    if (!FindRejectedClusters()) return false;
    threshold_ =
        problem_.threshold() * ShownShare(LeaveOneOutChi2(problem_, robust_.LoopsIn()), problem_.dimension());
    Keep();
    bool better = false;
    problem_.SetPoses(OdometryInitialization(problem_.graph(), problem_.structure()));
    // First without the clusters that growth has left, which may agree with it by chance, then with them:
    // true ones among them come back only if they may pull.
    if (GrowClusters(problem_, clusters_, solve_once_)) {
      better = Finish();
      better = (robust_.Solve(1) && Finish()) || better;
    }
    Restore();
    if (better) solve_once_(options_.max_iterations);  // has converged: for what is said about the solution
    return better;
  }

 private:
  /// From so many loops on a cluster counts as one: false loops at random make pairs by chance.
  static constexpr std::size_t kLeastRejected = 3;

  struct Solution {
    std::vector<Similarity> poses;
    std::vector<double> weights;
    double threshold = 0, score = 0;
  };

  bool FindRejectedClusters() {
    if (RejectedLoops(problem_, robust_.loops()) < kLeastRejected) return false;
    clusters_ =
        ClusterLoops(problem_.graph(), problem_.structure(), options_.objective, problem_.threshold());
    return std::any_of(clusters_.begin(), clusters_.end(), [&](const LoopCluster& cluster) {
      return RejectedLoops(problem_, cluster) >= kLeastRejected;
    });
  }

  /// Decides the loops from where the problem is; true if the result is the best one so far.
  bool Finish() {
    if (!robust_.DecideLoops(problem_.threshold()) || !robust_.Refine()) return false;
    if (!(ClusterScore(problem_, clusters_, threshold_) < best_.score)) return false;
    Keep();
    return true;
  }

  void Keep() {
    best_ = {problem_.Poses(), problem_.weights(), problem_.threshold(),
             ClusterScore(problem_, clusters_, threshold_)};
  }

  void Restore() {
    problem_.SetLoss(nullptr);
    problem_.SetThreshold(best_.threshold);
    problem_.SetPoses(best_.poses);
    for (std::size_t e = 0; e < best_.weights.size(); ++e) problem_.SetWeight(e, best_.weights[e]);
  }

  GraphProblem& problem_;
  const PoseGraphOptions& options_;
  RobustSolver& robust_;
  const std::function<bool(int)>& solve_once_;
  double threshold_ = 0;  // of the score: one for all solutions
  std::vector<LoopCluster> clusters_;
  Solution best_;
};

}  // namespace

std::size_t RejectedLoops(const GraphProblem& problem, const LoopCluster& cluster) {
  return static_cast<std::size_t>(
      std::count_if(cluster.begin(), cluster.end(), [&](std::size_t e) { return problem.weight(e) == 0; }));
}

double ClusterScore(const GraphProblem& problem, const std::vector<LoopCluster>& clusters, double threshold) {
  double sum = 0;
  for (std::size_t e = 0; e < problem.weights().size(); ++e) {
    if (problem.weight(e) == 0) continue;
    sum += problem.IsLoop(e) ? std::min(problem.EdgeChi2(e), threshold) : problem.EdgeChi2(e);
  }
  for (const LoopCluster& cluster : clusters) {
    const std::size_t out = RejectedLoops(problem, cluster);
    if (out > 0) sum += threshold * (1 + std::log(static_cast<double>(out)));
  }
  return sum;
}

bool GrowClusters(GraphProblem& problem, const std::vector<LoopCluster>& clusters,
                  const std::function<bool(int)>& solve_once) {
  return ClusterGrowth(problem, clusters, solve_once).Grow();
}

bool SearchClusters(GraphProblem& problem, const PoseGraphOptions& options, RobustSolver& robust,
                    const std::function<bool(int)>& solve_once) {
  return ClusterSearch(problem, options, robust, solve_once).Improve();
}

}  // namespace tutti::internal
