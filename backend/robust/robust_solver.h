// The schedules of the robust losses. Private to the back end.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "backend/robust/leave_one_out.h"
#include "backend/solver/graph_problem.h"
#include "backend/solver/robust_loss.h"
#include "core/median.h"

namespace tutti::internal {

/// Solves a problem with the loss that the options ask for, from the poses that the problem has. Huber is
/// solved directly. The other losses have many local minima: they start with a
/// threshold so large that every loop pulls (the drift of the odometry must not look like a false loop) and
/// tighten it round by round (graduated non-convexity, Yang et al., RA-L 2020).
template <int N>
class RobustSolver {
 public:
  /// `solve_once` runs so many iterations on the problem; false if they failed.
  RobustSolver(GraphProblem<N>& problem, const PoseGraphOptions& options, std::size_t edges,
               std::function<bool(int)> solve_once)
      : problem_(problem), options_(options), edges_(edges), solve_once_(std::move(solve_once)) {
    for (std::size_t e = 0; e < edges; ++e) {
      if (problem.IsLoop(e)) loops_.push_back(e);
    }
  }

  bool HasLoops() const { return !loops_.empty(); }
  /// Ways to go about it, each worth a try: with the graduation, and without.
  int Attempts() const { return options_.robust == RobustLoss::kHuber ? 1 : 2; }
  /// Rounds of graduation so far.
  int rounds() const { return rounds_; }

  /// The largest chi-square of a loop.
  double LargestChi2() const {
    double largest = 0;
    for (const std::size_t e : loops_) largest = std::max(largest, problem_.EdgeChi2(e));
    return largest;
  }

  bool Solve(int attempt) {
    const double c2 = problem_.threshold();
    for (const std::size_t e : loops_) problem_.SetWeight(e, 1.0);
    const bool graduated = attempt == 0;
    switch (options_.robust) {
      case RobustLoss::kNone:
        return solve_once_(options_.max_iterations);
      case RobustLoss::kHuber:
        return SolveWith(new ceres::HuberLoss(std::sqrt(c2)), options_.max_iterations);
      case RobustLoss::kCauchy:
        return Graduate<ceres::CauchyLoss>(graduated, [](double t) { return std::sqrt(t); });
      case RobustLoss::kDcs:
        return Graduate<DcsLoss>(graduated, [](double t) { return t; });
      case RobustLoss::kGnc:
        // Geman-McClure pulls less at true loops near the threshold than they deserve; DCS does not.
        return Graduate<GemanMcClureLoss>(graduated, [](double t) { return t; }) &&
               SolveWith(new DcsLoss(c2), Few()) && Sort(c2);
    }
    return false;
  }

  /// Truncated least squares: in or out for each loop, until the decision stands; then to convergence.
  bool DecideLoops(double c2) { return Sort(c2) && solve_once_(options_.max_iterations); }

  /// Second thoughts about the loops, from a solution of Solve().
  bool Refine() {
    const bool decides = options_.robust == RobustLoss::kGnc;
    for (int round = 0; round < kMostRounds; ++round) {
      if (!Tighten()) return false;
      if (!decides) return true;
      if (!DecideLoops(problem_.threshold())) return false;
      if (!ThresholdIsTooWide()) break;  // the converged solution may show less noise
    }
    return problem_.HasMeasurements() || DropStrained();  // which knows no landmarks
  }

 private:
  static constexpr int kIterationsPerRound = 4;  // a round need not converge; the last one does
  /// The threshold shrinks by this factor per round. It starts at the largest chi-square of a loop, so that
  /// drift does not look like a false loop: about log(largest / threshold) / log(kStep) rounds.
  static constexpr double kStep = 4;
  static constexpr int kMostRounds = 60;  // 1e36 between the two; a bound for graphs that do not settle

  static constexpr double kSafeSigmas = 10;  // of the loops' own spread; real ones have heavy tails

  /// Information matrices are often right up to a factor only: where the loops fit so much better than they
  /// promise that the threshold lies beyond kSafeSigmas of what the graph shows, false loops hide below it.
  /// The threshold is then brought down to there, step by step, since the graph fits better as they leave.
  /// Nothing to do where the user gave the threshold.
  bool Tighten() {
    for (int round = 0; round < kMostRounds && ThresholdIsTooWide(); ++round) {
      ++rounds_;
      problem_.SetThreshold(std::max(ShownThreshold(), problem_.threshold() / kStep));
      if (!Solve(1)) return false;
    }
    return true;
  }

  bool ThresholdIsTooWide() const {
    return options_.robust_chi2 == 0 && ShownThreshold() <= 0.9 * problem_.threshold();
  }

  /// After DecideLoops: takes out the loops that have bent the graph. A false loop between two places that
  /// little else holds together fits well where it is in; what betrays it is how much better the others fit
  /// without it (LeaveOneOut). Out go the loops for which that is beyond kStrainSigmas of what the loops
  /// show, the worst first, and loops that they had pushed out may come back.
  bool DropStrained() {
    for (int round = 0; round < kMostRounds && options_.robust_chi2 == 0; ++round) {
      const double limit = DropWorst();
      if (limit == 0) break;
      ++rounds_;
      if (!solve_once_(Few())) return false;
      const double c2 = problem_.threshold();
      SetWeights([&](std::size_t e, double s) {
        const double enough =
            problem_.weight(e) == 0 ? std::min(limit, c2) : c2;  // else it would be back for more
        return s <= enough ? 1.0 : 0.0;
      });
      if (!solve_once_(options_.max_iterations)) return false;
    }
    return true;
  }

  /// On top of the 99 % quantile. True loops of intel, ringCity, manhattan and manhattanOlson3500 stay
  /// within 3 sigma of the graph's own spread, 0.7 % of parking-garage's do not
  /// (docs/backend.md, section 2).
  static constexpr double kStrainSigmas = 3;

  /// One round of DropStrained without the solving. The limit; 0 if no loop is beyond it.
  double DropWorst() {
    const LeaveOneOut<N> without(problem_, edges_);
    if (!without.Ok()) return 0;
    std::vector<std::size_t> kept;
    std::vector<double> chi2;
    for (const std::size_t e : loops_) {
      if (problem_.weight(e) == 0) continue;
      kept.push_back(e);
      chi2.push_back(without.Chi2(e));
    }
    if (kept.empty()) return 0;
    const double worst = *std::max_element(chi2.begin(), chi2.end());
    const double shown = std::min(1.0, Median(chi2) / ChiSquareMedian(N));
    const double limit = kStrainSigmas * kStrainSigmas * shown * ChiSquare99(N);
    if (!(worst > limit)) return 0;
    for (std::size_t k = 0; k < kept.size(); ++k) {
      if (chi2[k] > std::max(limit, worst / 2)) problem_.SetWeight(kept[k], 0);
    }
    return limit;
  }

  /// DecideLoops without the convergence at the end.
  bool Sort(double c2) {
    constexpr int kRounds = 10;
    problem_.SetLoss(nullptr);
    for (int round = 0; round < kRounds; ++round) {
      if (!SetWeights([c2](std::size_t, double s) { return s <= c2 ? 1.0 : 0.0; }) && round > 0) break;
      if (!solve_once_(Few())) return false;
    }
    return true;
  }

  /// The 99 % quantile for the noise that the loops show (their median chi-square), kSafeSigmas wide.
  double ShownThreshold() const {
    std::vector<double> chi2;
    for (const std::size_t e : loops_) chi2.push_back(problem_.EdgeChi2(e));
    if (chi2.empty()) return problem_.threshold();
    return kSafeSigmas * kSafeSigmas * Median(chi2) / ChiSquareMedian(N) * ChiSquare99(N);
  }

  /// Iterations of a solution that only decides which loops are in.
  int Few() const { return std::min(20, options_.max_iterations); }

  bool SolveWith(ceres::LossFunction* owned, int iterations) {
    problem_.SetLoss(owned);
    return solve_once_(iterations);
  }

  /// Loss with thresholds from loose to tight.
  template <typename Loss, typename Parameter>
  bool Graduate(bool graduated, Parameter parameter) {
    const double c2 = problem_.threshold();
    double loose = graduated ? LargestChi2() : c2;
    for (int round = 0; loose > c2 && round < kMostRounds; ++round, loose /= kStep) {
      ++rounds_;
      problem_.SetLoss(new Loss(parameter(loose)));
      if (round > 0) problem_.KeepTrustRegion();
      if (!solve_once_(kIterationsPerRound)) return false;
      // Loops that have come together need no further rounds.
      loose = std::min(loose, kStep * std::max(c2, LargestChi2()));
    }
    if (graduated) problem_.KeepTrustRegion();
    const bool decided_later = options_.robust == RobustLoss::kGnc;
    return SolveWith(new Loss(parameter(c2)), decided_later ? Few() : options_.max_iterations);
  }

  /// Weights of the loops from their positions and chi-squares; false if none changed.
  template <typename Weight>
  bool SetWeights(Weight weight) {
    bool changed = false;
    for (const std::size_t e : loops_) {
      const double w = weight(e, problem_.EdgeChi2(e));
      changed = changed || w != problem_.weight(e);
      problem_.SetWeight(e, w);
    }
    return changed;
  }

  GraphProblem<N>& problem_;
  const PoseGraphOptions& options_;
  std::size_t edges_;
  std::function<bool(int)> solve_once_;
  std::vector<std::size_t> loops_;  // positions in edges()
  int rounds_ = 0;
};

}  // namespace tutti::internal
