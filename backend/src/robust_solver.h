// The schedules of the robust losses. Private to the back end.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "graph_problem.h"
#include "robust_loss.h"

namespace tutti::internal {

/// Solves a problem with the loss that the options ask for, from the poses that the problem has. Huber and
/// switchable constraints are solved directly. The other losses have many local minima: they start with a
/// threshold so large that every loop pulls (the drift of the odometry must not look like a false loop) and
/// tighten it round by round (graduated non-convexity, Yang et al., RA-L 2020).
template <int N>
class RobustSolver {
 public:
  /// `solve_once` runs so many iterations on the problem; false if they failed.
  RobustSolver(GraphProblem<N>& problem, const PoseGraphOptions& options, std::size_t edges,
               std::function<bool(int)> solve_once)
      : problem_(problem), options_(options), solve_once_(std::move(solve_once)) {
    for (std::size_t e = 0; e < edges; ++e) {
      if (problem.IsLoop(e)) loops_.push_back(e);
    }
  }

  bool HasLoops() const { return !loops_.empty(); }
  /// Ways to go about it, each worth a try: with the graduation, and without.
  int Attempts() const {
    return options_.robust == RobustLoss::kHuber || options_.robust == RobustLoss::kSwitchable ? 1 : 2;
  }
  /// Rounds of graduation so far.
  int rounds() const { return rounds_; }

  /// The largest chi-square of a loop that still has a say.
  double LargestChi2() const {
    double largest = 0;
    for (const std::size_t e : loops_) {
      if (problem_.IsOpen(e)) largest = std::max(largest, problem_.EdgeChi2(e));
    }
    return largest;
  }

  bool Solve(int attempt) {
    const double c2 = problem_.threshold();
    for (const std::size_t e : loops_) {
      if (problem_.IsOpen(e)) problem_.SetWeight(e, 1.0);
    }
    const bool graduated = attempt == 0;
    switch (options_.robust) {
      case RobustLoss::kNone:
        return solve_once_(options_.max_iterations);
      case RobustLoss::kHuber:
        return SolveWith(new ceres::HuberLoss(std::sqrt(c2)), options_.max_iterations);
      case RobustLoss::kSwitchable:
        problem_.AddSwitches();
        return solve_once_(options_.max_iterations);
      case RobustLoss::kCauchy:
        return Graduate<ceres::CauchyLoss>(graduated, [](double t) { return std::sqrt(t); });
      case RobustLoss::kDcs:
        return Graduate<DcsLoss>(graduated, [](double t) { return t; });
      case RobustLoss::kGncTls:
        return (!graduated || GraduateWeights()) && DecideLoops(c2);
      case RobustLoss::kGnc:
        // Geman-McClure pulls less at true loops near the threshold than they deserve; DCS does not.
        return Graduate<GemanMcClureLoss>(graduated, [](double t) { return t; }) &&
               SolveWith(new DcsLoss(c2), Few()) && DecideLoops(c2);
    }
    return false;
  }

  /// Information matrices are often right up to a factor only: where the loops fit so much better than they
  /// promise that the threshold lies beyond kSafeSigmas of what the graph shows, false loops hide below it.
  /// The threshold is then brought down to there, step by step, since the graph fits better as they leave.
  /// Nothing to do where the user gave the threshold.
  bool Tighten() {
    for (int round = 0; round < options_.gnc_max_rounds && options_.robust_chi2 == 0; ++round) {
      const double target = ShownThreshold();
      if (target > 0.9 * problem_.threshold()) break;
      ++rounds_;
      problem_.SetThreshold(std::max(target, problem_.threshold() / options_.gnc_step));
      if (!Solve(1)) return false;
    }
    return true;
  }

  /// Truncated least squares: in or out for each loop, until the decision stands.
  bool DecideLoops(double c2) {
    constexpr int kRounds = 10;
    problem_.SetLoss(nullptr);
    for (int round = 0; round < kRounds; ++round) {
      if (!SetWeights([c2](double s) { return s <= c2 ? 1.0 : 0.0; }) && round > 0) break;
      if (!solve_once_(Few())) return false;
    }
    return solve_once_(options_.max_iterations);
  }

 private:
  static constexpr int kIterationsPerRound = 4;  // a round need not converge; the last one does

  static constexpr double kSafeSigmas = 10;  // of the loops' own spread; real ones have heavy tails

  /// The 99 % quantile for the noise that the loops show (their median chi-square), kSafeSigmas wide.
  double ShownThreshold() const {
    std::vector<double> chi2;
    for (const std::size_t e : loops_) {
      if (problem_.IsOpen(e)) chi2.push_back(problem_.EdgeChi2(e));
    }
    if (chi2.empty()) return problem_.threshold();
    const auto middle = chi2.begin() + static_cast<std::ptrdiff_t>(chi2.size() / 2);
    std::nth_element(chi2.begin(), middle, chi2.end());
    return kSafeSigmas * kSafeSigmas * *middle / ChiSquareMedian(N) * ChiSquare99(N);
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
    double loose = graduated ? options_.gnc_start * LargestChi2() : c2;
    for (int round = 0; loose > c2 && round < options_.gnc_max_rounds; ++round, loose /= options_.gnc_step) {
      ++rounds_;
      problem_.SetLoss(new Loss(parameter(loose)));
      if (!solve_once_(kIterationsPerRound)) return false;
      // Loops that have come together need no further rounds.
      loose = std::min(loose, options_.gnc_step * std::max(c2, LargestChi2()));
    }
    const bool decided_later = options_.robust == RobustLoss::kGnc;
    return SolveWith(new Loss(parameter(c2)), decided_later ? Few() : options_.max_iterations);
  }

  /// Weighted least squares whose weights end as 0 or 1. Each round has half the iterations of
  /// Graduate() and half the step (as a ratio), so that loops leave, and with them their fill-in, early.
  bool GraduateWeights() {
    const double c2 = problem_.threshold();
    problem_.SetLoss(nullptr);
    double mu = c2 / std::max(2 * options_.gnc_start * LargestChi2() - c2, 1e-3 * c2);
    for (int round = 0; round < options_.gnc_max_rounds; ++round, mu *= std::sqrt(options_.gnc_step)) {
      ++rounds_;
      SetWeights([c2, mu](double s) { return GncTlsWeight(s, c2, mu); });
      if (!solve_once_(kIterationsPerRound / 2)) return false;
      const bool binary = std::all_of(loops_.begin(), loops_.end(), [&](std::size_t e) {
        return problem_.weight(e) == 0 || problem_.weight(e) == 1;
      });
      if (binary) break;
    }
    return true;
  }

  /// Weights of the open loops from their chi-squares; false if none changed.
  template <typename Weight>
  bool SetWeights(Weight weight) {
    bool changed = false;
    for (const std::size_t e : loops_) {
      if (!problem_.IsOpen(e)) continue;
      const double w = weight(problem_.EdgeChi2(e));
      changed = changed || w != problem_.weight(e);
      problem_.SetWeight(e, w);
    }
    return changed;
  }

  GraphProblem<N>& problem_;
  const PoseGraphOptions& options_;
  std::function<bool(int)> solve_once_;
  std::vector<std::size_t> loops_;  // positions in edges()
  int rounds_ = 0;
};

}  // namespace tutti::internal
