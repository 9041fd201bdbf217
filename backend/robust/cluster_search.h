// Second thoughts about clusters of loops. Private to the back end.
#pragma once

#include <algorithm>
#include <functional>
#include <utility>
#include <vector>

#include "backend/robust/cluster_growth.h"
#include "backend/robust/cluster_score.h"
#include "backend/robust/leave_one_out.h"
#include "backend/robust/loop_clusters.h"
#include "backend/robust/robust_solver.h"
#include "backend/solver/graph_initialization.h"
#include "backend/solver/graph_problem.h"

namespace tutti::internal {

/// Where many false loops agree with each other, graduation may end in a local minimum, or in one that is
/// lower than the truth because 50 false loops weigh more than three true ones. So a solution that rejects
/// loops in a cluster gets a rival, from a start that does not depend on numbers (ClusterGrowth), and the one
/// of lower ClusterScore is kept. Solutions that reject single loops only are left alone.
template <int N>
class ClusterSearch {
 public:
  ClusterSearch(const PoseGraph& graph, const PoseGraphOptions& options, GraphProblem<N>& problem,
                RobustSolver<N>& robust, std::function<bool(int)> solve_once)
      : graph_(graph),
        options_(options),
        problem_(problem),
        robust_(robust),
        solve_once_(std::move(solve_once)),
        threshold_(problem.threshold()) {}

  /// After RobustSolver::Refine. True if another solution is better; it is in the problem then, and the old
  /// one otherwise.
  bool Improve() {
    if (!FindRejectedClusters()) return false;
    SetPenalty();
    Keep();
    bool better = false;
    problem_.SetPoses(OdometryInitialization(graph_, problem_.structure()));
    ClusterGrowth<N> growth(problem_, clusters_, solve_once_);
    // First without the clusters that growth has left, which may agree with it by chance, then with them:
    // true ones among them come back only if they may pull.
    if (growth.Grow()) {
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
    LoopCluster loops;
    for (std::size_t e = 0; e < problem_.weights().size(); ++e) {
      if (problem_.IsLoop(e)) loops.push_back(e);
    }
    if (RejectedLoops(problem_, loops) < kLeastRejected) return false;
    clusters_ = ClusterLoops(graph_, problem_.structure(), options_.objective, problem_.threshold());
    return std::any_of(clusters_.begin(), clusters_.end(), [&](const LoopCluster& cluster) {
      return RejectedLoops(problem_, cluster) >= kLeastRejected;
    });
  }

  /// The score's threshold: three sigma, on top of the 99 % quantile, of the noise that the median loop
  /// shows, as RobustSolver::DropStrained takes it.
  void SetPenalty() {
    constexpr double kSigmas = 3;
    const LeaveOneOut<N> without(problem_, problem_.weights().size());
    std::vector<double> chi2;
    for (std::size_t e = 0; without.Ok() && e < problem_.weights().size(); ++e) {
      if (problem_.IsLoop(e) && problem_.weight(e) > 0) chi2.push_back(without.Chi2(e));
    }
    if (chi2.empty()) return;
    const double shown = std::min(1.0, kSigmas * kSigmas * Median(chi2) / ChiSquareMedian(N));
    threshold_ *= shown;
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

  const PoseGraph& graph_;
  const PoseGraphOptions& options_;
  GraphProblem<N>& problem_;
  RobustSolver<N>& robust_;
  std::function<bool(int)> solve_once_;
  double threshold_;  // of the score: one for all solutions
  std::vector<LoopCluster> clusters_;
  Solution best_;
};

}  // namespace tutti::internal
