// A start for robust losses: the clusters of loops that fit together. Private to the back end.
#pragma once

#include <algorithm>
#include <functional>
#include <tuple>
#include <vector>

#include "backend/robust/loop_clusters.h"
#include "backend/solver/graph_problem.h"
#include "backend/uncertainty/edge_prediction.h"
#include "core/median.h"

namespace tutti::internal {

/// Begins with the odometry alone and takes in cluster after cluster, those first of which the graph is the
/// most certain where they should lie (EdgePrediction): there agreement is no chance. Each cluster that joins
/// makes the graph more certain of the next. So a cluster counts once, however many loops it has, and no
/// false one can bend the graph before its rivals have been heard. (Clusters that are tested one by one and
/// then together: RRR, Latif, Cadena, Neira, IJRR 2013. Loops that join if they fit what has joined before:
/// Olivastri and Pretto, IPC, ICRA 2024.)
///
/// Information matrices are often right up to a factor only. Hence the gate is narrow at first, a hundredth
/// of the threshold, and widens only when nothing is left that passes.
template <int N>
class ClusterGrowth {
 public:
  /// `clusters`: open loops only. `solve_once` runs so many iterations on the problem; false if they failed.
  ClusterGrowth(GraphProblem<N>& problem, const std::vector<LoopCluster>& clusters,
                const std::function<bool(int)>& solve_once)
      : problem_(problem), clusters_(clusters), solve_once_(solve_once), prediction_(problem) {}

  /// From poses that fulfil the odometry. Leaves least squares with weights 0 or 1. False if the odometry
  /// does not hold the graph together, or a solution failed. Loops that stand alone are no evidence for the
  /// others: they are weighed at the end, by dynamic covariance scaling.
  bool Grow() {
    problem_.SetLoss(nullptr);
    std::vector<std::size_t> waiting;
    for (std::size_t k = 0; k < clusters_.size(); ++k) {
      SetWeights(clusters_[k], 0);
      if (clusters_[k].size() > 1) waiting.push_back(k);
    }
    for (double gate = kFirstGate; !waiting.empty();) {
      if (!prediction_.Update()) return false;
      std::vector<std::size_t> joining = Certain(waiting, gate * problem_.threshold());
      const double widest = WidestGate();
      if (joining.empty() && gate >= widest) break;
      if (joining.empty()) gate = std::min(widest, kGateStep * gate);
      if (!joining.empty() && !Join(joining, waiting)) return false;
    }
    return WeighSingleLoops();
  }

 private:
  static constexpr double kFirstGate = 0.01, kGateStep = 3;  // shares of the threshold
  static constexpr int kIterations = 10;                     // of a solution between two rounds

  /// Of the waiting clusters whose chi-square passes, the half that the graph is more certain of.
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

  /// Three sigma, on top of the 99 % quantile, of the noise that the clusters have shown when they joined; as
  /// a share of the threshold.
  double WidestGate() const {
    constexpr double kSigmas = 3;
    if (joined_chi2_.empty()) return 1;
    return std::min(1.0, kSigmas * kSigmas * Median(joined_chi2_) / ChiSquareMedian(N));
  }

  /// Of its first, middle and last loop the median chi-square and the least spread.
  PredictedEdge Predicted(const LoopCluster& cluster) {
    const PredictedEdge middle = prediction_.Of(cluster[cluster.size() / 2]);
    if (cluster.size() == 2) return middle;
    const PredictedEdge first = prediction_.Of(cluster.front()), last = prediction_.Of(cluster.back());
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

  GraphProblem<N>& problem_;
  const std::vector<LoopCluster>& clusters_;
  const std::function<bool(int)>& solve_once_;
  EdgePrediction<N> prediction_;
  std::vector<double> joined_chi2_;  // of each cluster that has joined, before
};

}  // namespace tutti::internal
