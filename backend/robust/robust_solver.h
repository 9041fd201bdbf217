// The schedules of the robust losses. Private to the back end.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

#include "backend/solver/graph_problem.h"

namespace tutti::internal {

/// The noise that these chi-squares show, three sigma wide on top of the 99 % quantile, as a share of that
/// quantile: min(1, 9 median / median of the distribution). No noise makes it wider than the quantile itself.
double ShownShare(const std::vector<double>& chi2, int dimension);

/// Solves a problem with the loss that the options ask for, from the poses that the problem has. Huber is
/// solved directly. The other losses have many local minima: they start with a threshold so large that every
/// loop pulls (the drift of the odometry must not look like a false loop) and tighten it round by round
/// (graduated non-convexity, Yang et al., RA-L 2020).
class RobustSolver {
 public:
  /// `solve_once` runs so many iterations on the problem; false if they failed.
  RobustSolver(GraphProblem& problem, const PoseGraphOptions& options, std::function<bool(int)> solve_once);

  const std::vector<std::size_t>& loops() const { return loops_; }
  /// Those of weight above 0.
  std::vector<std::size_t> LoopsIn() const;
  /// Ways to go about it, each worth a try: with the graduation, and without.
  int Attempts() const { return options_.robust == RobustLoss::kHuber ? 1 : 2; }
  /// Rounds of graduation so far.
  int rounds() const { return rounds_; }
  /// The largest chi-square of a loop.
  double LargestChi2() const;

  bool Solve(int attempt);
  /// Truncated least squares: in or out for each loop, until the decision stands; then to convergence.
  bool DecideLoops(double c2);
  /// Second thoughts about the loops, from a solution of Solve().
  bool Refine();

 private:
  bool Tighten();
  bool ThresholdIsTooWide() const;
  double ShownThreshold() const;
  bool DropStrained();
  double DropWorst();
  bool Sort(double c2);
  bool Graduate(bool graduated, const std::function<ceres::LossFunction*(double)>& loss);
  bool SetWeights(const std::function<bool(std::size_t, double)>& is_in);
  /// Iterations of a solution that only decides which loops are in.
  int Few() const { return std::min(20, options_.max_iterations); }
  bool SolveWith(ceres::LossFunction* owned, int iterations);

  GraphProblem& problem_;
  const PoseGraphOptions& options_;
  std::function<bool(int)> solve_once_;
  std::vector<std::size_t> loops_;  // positions in edges()
  int rounds_ = 0;
};

}  // namespace tutti::internal
